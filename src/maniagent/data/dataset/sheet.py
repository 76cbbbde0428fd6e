"""A contact sheet: a row an episode, some moments of it, what was asked, and what the robot was doing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from PIL import Image

from .drawing import INK, PAPER, QUIET, TINTS, Canvas, fitted, plain, width_of, wrapped
from .reading import Dataset, Episode
from .video import Picture

_MARGIN, _GAP = 24, 10
_TITLE, _HEAD, _FOOT = 58, 30, 44
"""px above all rows, above a row's pictures, below them."""
_WIDTH = 220
"""px, of a picture."""


@dataclass(frozen=True)
class _Row:
    episode: Episode
    frames: tuple[int, ...]
    pictures: list[Picture]
    subtasks: tuple[str, ...]


def contact_sheet(dataset: Dataset, camera: str, episodes: Sequence[Episode], moments: int) -> Image.Image:
    """Draw `moments` pictures of each episode, spread evenly from its first frame to its last.

    Raises DatasetError where a picture can't be read.
    """
    rows = [_read(dataset, camera, episode, moments) for episode in episodes if episode.length]
    height, width, *_ = rows[0].pictures[0].shape if rows else (3, 4)
    tall = round(_WIDTH * height / width)
    row_height = _HEAD + tall + _FOOT
    columns = max((len(row.pictures) for row in rows), default=1)
    canvas = Canvas(2 * _MARGIN + columns * (_WIDTH + _GAP) - _GAP, _TITLE + len(rows) * row_height + _MARGIN // 2)
    name = "/".join(dataset.root.resolve().parts[-2:])
    canvas.text(_MARGIN, 16, plain(f"{name}  ·  {camera}"), 18)
    about = f"{len(dataset.episodes)} episodes, {dataset.info.total_frames} frames at {dataset.info.fps:g} a second"
    canvas.text(_MARGIN, 38, about, 12, QUIET)
    for number, row in enumerate(rows):
        _draw_row(canvas, row, dataset.info.fps, _TITLE + number * row_height, tall)
    return canvas.finished()


def _read(dataset: Dataset, camera: str, episode: Episode, moments: int) -> _Row:
    count = min(moments, episode.length)
    frames = tuple(round(frame) for frame in np.linspace(0, episode.length - 1, count))
    return _Row(episode, frames, dataset.pictures(episode, camera, frames), dataset.subtasks(episode))


def _draw_row(canvas: Canvas, row: _Row, fps: float, top: float, tall: int) -> None:
    number = f"episode {row.episode.index}"
    canvas.text(_MARGIN, top + 8, number, 14)
    x = _MARGIN + width_of(number, 14) + 14
    task = plain(" / ".join(row.episode.tasks))
    room = len(row.pictures) * (_WIDTH + _GAP) + _MARGIN - x - 140
    task = fitted(task, 14, max(room, 40))
    canvas.text(x, top + 8, task, 14, QUIET)
    length = f"{row.episode.length} frames, {row.episode.length / fps:.1f} s"
    canvas.text(_MARGIN + len(row.pictures) * (_WIDTH + _GAP) - _GAP, top + 10, length, 12, QUIET, "ra")
    tints = {text: TINTS[i % len(TINTS)] for i, text in enumerate(dict.fromkeys(filter(None, row.subtasks)))}
    for column, (frame, picture) in enumerate(zip(row.frames, row.pictures, strict=True)):
        left = _MARGIN + column * (_WIDTH + _GAP)
        canvas.picture(left, top + _HEAD, Image.fromarray(picture), _WIDTH, tall)
        subtask = row.subtasks[frame] if row.subtasks else ""
        _caption(canvas, left, top + _HEAD + tall, f"{frame / fps:.1f} s", subtask, tints.get(subtask, PAPER))


def _caption(canvas: Canvas, left: float, top: float, time: str, subtask: str, tint: tuple[int, int, int]) -> None:
    canvas.box((left, top, left + _WIDTH, top + _FOOT - 8), tint)
    canvas.text(left + 6, top + 4, time, 11, QUIET)
    for i, line in enumerate(wrapped(plain(subtask), 11, _WIDTH - 50, 2)):
        canvas.text(left + 44, top + 4 + 15 * i, line, 11, INK)
