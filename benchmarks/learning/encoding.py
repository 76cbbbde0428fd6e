"""What it costs to put staged episodes into a LeRobot dataset: lerobot by itself, and as our writer has it do it.

For an interpreter that has lerobot; nothing of maniagent is needed but its writer's file:

    LEROBOT/bin/python benchmarks/learning/encoding.py carrots/episodes --episodes 6

The episodes are those of `maniagent collect ... --stage-only`. Both ways write the same rows with lerobot itself, in
turns, each time in a process of its own whose imports don't count; the figures are of the cheapest round. "lerobot" is
its own choice, AV1; "ours" is h264 at x264's fastest preset, with image statistics from counts, for which
data/lerobot/writer.py has the reasons.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

import av
import numpy as np

WRITER = Path(__file__).parents[2] / "src" / "maniagent" / "data" / "lerobot" / "writer.py"
CODECS = {"lerobot": "libsvtav1", "ours": "h264"}
ROUNDS = 3


def load_writer() -> Any:
    """The writer's module; it imports numpy, and lerobot where it is used."""
    spec = spec_from_file_location("writer", WRITER)
    assert spec is not None and spec.loader is not None  # noqa: PT018
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def features_of(columns: dict[str, np.ndarray]) -> dict[str, Any]:
    """A schema that fits the columns of a staged episode."""
    made: dict[str, Any] = {}
    for name, column in columns.items():
        if column.ndim == 4:
            made[name] = {"dtype": "video", "shape": column.shape[1:], "names": ["height", "width", "channels"]}
        elif column.dtype.kind == "U":
            made[name] = {"dtype": "string", "shape": (1,), "names": None}
        else:
            made[name] = {"dtype": "float32", "shape": column.shape[1:], "names": None}
    return made


def write(way: str, episodes: list[Path], out: Path) -> dict[str, float]:
    """Write them one way, in this process; returns seconds for each episode."""
    import lerobot.datasets.lerobot_dataset  # noqa: F401 - imports don't count

    writer = load_writer()
    if way == "ours":
        writer.mend()
    schema = {"fps": 10, "robot_type": "widowx_250s", "features": features_of(writer.read_columns(episodes[0]))}
    told = [{"folder": str(episode), "task": "put the carrot on the plate"} for episode in episodes]
    wall, processor = time.perf_counter(), time.process_time()
    writer.append(str(out), schema, CODECS[way], told)
    each = len(episodes)
    return {"processor": (time.process_time() - processor) / each, "wall": (time.perf_counter() - wall) / each}


def look(out: Path, episodes: list[Path]) -> dict[str, float]:
    """How large the videos are, how like the recorded images, and how long a processor decodes them."""
    files = sorted(out.glob("videos/*/*/*.mp4"))
    errors, frames, seconds = [], 0, 0.0
    for key in sorted({file.parts[-3] for file in files}):
        images = np.concatenate([np.load(e / f"rgb-{key.rsplit('.', 1)[1]}.npy", mmap_mode="r") for e in episodes])
        began = time.process_time()
        found = [
            frame.to_ndarray(format="rgb24")
            for file in files
            if file.parts[-3] == key
            for frame in av.open(str(file)).decode(video=0)
        ]
        seconds += time.process_time() - began
        frames += len(found)
        errors += [np.mean((a.astype(float) - b) ** 2) for a, b in zip(found, images, strict=True)]
    return {
        "kB a frame": sum(file.stat().st_size for file in files) / frames / 1000,
        "dB": 10 * np.log10(255**2 / np.mean(errors)),
        "ms to decode a frame": 1000 * seconds / frames,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("staged", type=Path, help="folder of staged episodes")
    parser.add_argument("--episodes", type=int, default=6)
    parser.add_argument("--way", choices=CODECS, help=argparse.SUPPRESS)
    parser.add_argument("--out", type=Path, help=argparse.SUPPRESS)
    args = parser.parse_args()
    episodes = sorted(path.parent for path in args.staged.glob("[!.]*/steps.npz"))[: args.episodes]
    if not episodes:
        sys.exit(f"{args.staged} holds no staged episodes")
    if args.way:
        print(json.dumps(write(args.way, episodes, args.out)))
        return
    found: dict[str, dict[str, float]] = {}
    for number in range(ROUNDS):
        for way in CODECS:
            with tempfile.TemporaryDirectory() as folder:
                out = Path(folder) / "dataset"
                command = [sys.executable, __file__, str(args.staged), "--episodes", str(args.episodes)]
                told = subprocess.run(  # noqa: S603 - this very file
                    [*command, "--way", way, "--out", str(out)], capture_output=True, text=True, check=True
                )
                costs = json.loads(told.stdout.splitlines()[-1])
                best = found.setdefault(way, costs | look(out, episodes))
                found[way] = best | {name: min(best[name], costs[name]) for name in costs}
        print(f"round {number + 1} of {ROUNDS}", file=sys.stderr)
    print(f"{len(episodes)} episodes, {'':16}{'lerobot':>10}{'ours':>10}{'ratio':>8}")
    for name in found["ours"]:
        theirs, ours = found["lerobot"][name], found["ours"][name]
        unit = "s an episode, " if name in ("processor", "wall") else ""
        print(f"{unit + name:28}{theirs:10.2f}{ours:10.2f}{theirs / ours:8.2f}")


if __name__ == "__main__":
    main()
