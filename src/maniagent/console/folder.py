"""What a run folder is called, what lies in it, and when a folder may become one."""

from __future__ import annotations

import datetime
import re
import shutil
import zlib
from pathlib import Path

from ..errors import UsageError
from ..models.record import EXCHANGES, PICTURES

EVENTS, VIDEO, SUMMARY, REPORT = "events.jsonl", "video.mp4", "summary.json", "report.html"
OBSERVATIONS, DETECTIONS, SEQUENCES = "observations", "detections", "sequences"
_MODELS = (EXCHANGES, PICTURES)  # what models were asked, and the pictures that they were shown
_VIDEO_PART = "video.part"  # stands there for the blink of an eye while the video gets its index
_OURS = frozenset({EVENTS, VIDEO, SUMMARY, REPORT, OBSERVATIONS, DETECTIONS, SEQUENCES, *_MODELS, _VIDEO_PART})


def default_folder(name: str | None, seed: int, now: datetime.datetime | None = None) -> Path:
    """runs/<timestamp>-<name>-s<seed>: where a run goes when nobody said where; `name` is the task's or the scene's."""
    stamp = (now or datetime.datetime.now()).strftime("%Y%m%d-%H%M%S")
    slug = re.sub(r"[^a-z0-9]+", "-", (name or "scene").lower())[:40].strip("-") or "scene"
    return Path("runs") / f"{stamp}-{slug}-s{seed}"


def picture_name(turn: int, view: str, what: str = "") -> str:
    """The picture of a view, within OBSERVATIONS; `what` says what of it is shown where it isn't its colours."""
    slug = re.sub(r"[^A-Za-z0-9_]+", "_", view)
    if slug != view:  # two views that are spelled alike don't share a file
        slug += f"_{zlib.crc32(view.encode('utf-8', 'replace')):08x}"
    return f"turn-{turn:02d}-{slug}{f'-{what}' if what else ''}.png"


def look_name(turn: int) -> str:
    """All that was seen on a turn but the colours, within OBSERVATIONS."""
    return f"turn-{turn:02d}.npz"


def prepare(folder: Path) -> None:
    """Make `folder` an empty folder: a new one, or the one of an earlier run, which is deleted.

    Raises UsageError where it holds anything that no recorder wrote, or can't be made.
    """
    if folder.exists() and not folder.is_dir():
        raise UsageError(f"{folder} is a file; a run needs a folder.")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        present = {path.name for path in folder.iterdir()}
        foreign = present - _OURS or (present if present and EVENTS not in present else set())
        if foreign:
            named = ", ".join(sorted(foreign)[:3])
            raise UsageError(f"{folder} holds what no run left there ({named}). Name an empty or a new folder.")
        for name in present:
            _remove(folder / name)
    except OSError as error:
        raise UsageError(f"{folder} can't be made a run folder: {error.strerror}. Name another one.") from error


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink()
