"""Makes docs/images/demo.png, the picture at the top of the README, from a real run.

    python scripts/demo_picture.py

What was found, on the way, and the end, side by side: the run's own pictures, nothing retouched.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import av
import numpy as np
from PIL import Image

import maniagent

TASK, SEED = "menemen", 1
INSTRUCTION = "put the egg on the plate, then put the green pepper on the plate"
TARGET = Path(__file__).parent.parent / "docs" / "images" / "demo.png"
CAPTION_ROWS = 48


def frames(video: Path) -> list[np.ndarray]:
    """Every frame of a video, (H, W, 3) uint8, without the recorder's caption bar."""
    with av.open(str(video)) as container:
        return [frame.to_ndarray(format="rgb24")[CAPTION_ROWS:] for frame in container.decode(video=0)]


def main() -> None:
    """Run the task, put three of its pictures side by side."""
    with tempfile.TemporaryDirectory() as folder:
        outcome = maniagent.run(INSTRUCTION, task=TASK, seed=SEED, out=folder)
        if not outcome.achieved:
            raise SystemExit(f"The run failed, there is nothing to show: {outcome.result.reason}")
        found = np.asarray(Image.open(Path(folder) / "detections" / "turn-01.png").convert("RGB"))
        film = frames(Path(folder) / "video.mp4")
    pictures = [found, film[int(len(film) * 0.32)], film[-1]]
    gap = np.full((pictures[0].shape[0], 8, 3), 255, np.uint8)
    strip = np.hstack([pictures[0], gap, pictures[1], gap, pictures[2]])
    TARGET.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(strip).resize((strip.shape[1] * 2 // 3, strip.shape[0] * 2 // 3)).save(TARGET, optimize=True)


if __name__ == "__main__":
    main()
