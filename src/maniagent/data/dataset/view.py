"""Pictures of a dataset, written into a folder."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from ...errors import UnknownNameError, UsageError
from .curves import curves
from .reading import Dataset, Episode
from .sheet import contact_sheet

SHOWN = 6
"""Episodes that are drawn where none are named."""


def view(
    dataset: Dataset,
    out: Path,
    *,
    episodes: Sequence[int] | None = None,
    moments: int = 6,
    camera: str | None = None,
) -> list[Path]:
    """Write sheet-CAMERA.png of each camera, or of one, and episode-NUMBER.png with the curves of each episode.

    Without `episodes` a few are drawn, spread from the first to the last. Returns what was written. Raises UsageError
    where there is no such episode or camera, or `out` can't be written; DatasetError where something is broken.
    """
    if camera is not None and camera not in dataset.info.pictures:
        raise UnknownNameError("camera", camera, dataset.info.pictures)
    chosen = spread(dataset.episodes) if episodes is None else [dataset.episode(i) for i in dict.fromkeys(episodes)]
    if not chosen:
        raise UsageError(f"{dataset.root} has no episode yet.")
    sheets = [
        _write(contact_sheet(dataset, name, chosen, moments), out / f"sheet-{_file_name(name)}.png")
        for name in (dataset.info.pictures if camera is None else (camera,))
    ]
    return sheets + [_write(curves(dataset, e), out / f"episode-{e.index:04d}.png") for e in chosen]


def spread(episodes: Sequence[Episode]) -> list[Episode]:
    """A few episodes, evenly from the first to the last."""
    if not episodes:
        return []
    numbers = np.linspace(0, len(episodes) - 1, min(SHOWN, len(episodes)))
    return [episodes[i] for i in dict.fromkeys(round(number) for number in numbers)]


def _file_name(camera: str) -> str:
    """A camera's last name, in characters that every file system takes."""
    short = camera.removeprefix("observation.images.")
    return "".join(c if c.isalnum() or c in "-_." else "-" for c in short)[:80].lstrip(".") or "camera"


def _write(picture: Image.Image, path: Path) -> Path:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        picture.save(path)
    except OSError as error:
        raise UsageError(f"{path} can't be written: {error.strerror or error}.") from error
    return path
