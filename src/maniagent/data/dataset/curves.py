"""The numbers of an episode over time: states and actions by dimension, over bands that say what was being done."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from PIL import Image

from ...geometry import FloatArray
from .drawing import GRID, INK, LINES, QUIET, TINTS, Box, Canvas, fitted, plain, ticks, width_of
from .layout import BOOKKEEPING, Feature
from .reading import Dataset, Episode

_COLUMNS = 3
_WIDTH, _HEIGHT = 470, 190
"""px, of a panel with its labels."""
_MARGIN = 24
_INSET = (52.0, 26.0, 12.0, 24.0)
"""px that labels take of a panel: left, top, right, bottom."""
_PANELS = 36
"""At most; nobody reads more."""


@dataclass(frozen=True)
class Curve:
    """One line of a panel."""

    name: str
    values: FloatArray
    """(T,)."""


@dataclass(frozen=True)
class Panel:
    """Lines with a common scale."""

    title: str
    curves: tuple[Curve, ...]


@dataclass(frozen=True)
class Band:
    """A stretch of frames with one sub-task."""

    text: str
    start: int
    stop: int


def curves(dataset: Dataset, episode: Episode) -> Image.Image:
    """Draw an episode: where a state's dimension has an action of the same name, both share a panel.

    Raises DatasetError where the numbers can't be read.
    """
    panels = _panels(dataset, episode)[:_PANELS]
    bands = list(_bands(dataset.subtasks(episode)))
    tints = {text: TINTS[i % len(TINTS)] for i, text in enumerate(dict.fromkeys(band.text for band in bands))}
    keys = _legend_rows(list(tints), _COLUMNS * _WIDTH)
    top = 58 + 22 * len(keys)
    rows = -(-len(panels) // _COLUMNS)
    canvas = Canvas(2 * _MARGIN + _COLUMNS * _WIDTH, top + rows * _HEIGHT + _MARGIN // 2)
    canvas.text(_MARGIN, 14, f"episode {episode.index}", 18)
    about = f"{' / '.join(episode.tasks)}  ·  {episode.length} frames, {episode.length / dataset.info.fps:.1f} s"
    canvas.text(_MARGIN, 37, fitted(plain(about), 12, _COLUMNS * _WIDTH), 12, QUIET)
    for i, row in enumerate(keys):
        _draw_legend(canvas, row, tints, 58 + 22 * i)
    for i, panel in enumerate(panels):
        left, above = _MARGIN + i % _COLUMNS * _WIDTH, top + i // _COLUMNS * _HEIGHT
        box = (left + _INSET[0], above + _INSET[1], left + _WIDTH - _INSET[2], above + _HEIGHT - _INSET[3])
        for band in bands:
            canvas.box(_band_box(box, band, episode.length), tints[band.text])
        _draw_panel(canvas, panel, box, dataset.info.fps)
    return canvas.finished()


def _panels(dataset: Dataset, episode: Episode) -> list[Panel]:
    vectors = [f for f in dataset.info.stored if f.is_vector and f.name not in BOOKKEEPING and f.dtype != "bool"]
    vectors = [feature for feature in vectors if not feature.name.endswith("_index")]
    numbers = dataset.numbers(episode, [feature.name for feature in vectors])
    columns = {f.name: numbers[f.name].reshape(episode.length, -1).astype(float) for f in vectors}
    state, action = dataset.info.features.get("observation.state"), dataset.info.features.get("action")
    panels: list[Panel] = []
    if state in vectors and action in vectors and state is not None and action is not None:
        panels = _paired(state, action, columns[state.name], columns[action.name])
        vectors = [feature for feature in vectors if feature not in (state, action)] if panels else vectors
    return panels + [panel for feature in vectors for panel in _together(feature, columns[feature.name])]


def _paired(state: Feature, action: Feature, states: FloatArray, actions: FloatArray) -> list[Panel]:
    """A panel for each dimension that both have; none where their names differ."""
    if state.names != action.names:
        return []
    return [
        Panel(name, (Curve("state", states[:, i]), Curve("action", actions[:, i])))
        for i, name in enumerate(state.names)
    ]


def _together(feature: Feature, column: FloatArray) -> Iterator[Panel]:
    """The dimensions of a feature in one panel, or in several where there are many."""
    for first in range(0, column.shape[1], len(LINES)):
        numbers = range(first, min(first + len(LINES), column.shape[1]))
        yield Panel(feature.name, tuple(Curve(feature.names[i], column[:, i]) for i in numbers))


def _bands(subtasks: Sequence[str]) -> Iterator[Band]:
    start = 0
    for i in range(1, len(subtasks) + 1):
        if i == len(subtasks) or subtasks[i] != subtasks[start]:
            if subtasks[start]:
                yield Band(subtasks[start], start, i)
            start = i


def _band_box(box: Box, band: Band, length: int) -> Box:
    scale = (box[2] - box[0]) / max(length - 1, 1)
    return (box[0] + band.start * scale, box[1], min(box[0] + band.stop * scale, box[2]), box[3])


def _legend_rows(keys: Sequence[str], width: float) -> list[list[str]]:
    """Keys in as many rows as they take."""
    rows: list[list[str]] = []
    used = width
    for key in keys:
        need = _key_width(key)
        if used + need > width:
            rows.append([])
            used = 0.0
        rows[-1].append(key)
        used += need
    return rows


def _key_width(key: str) -> float:
    return 40 + width_of(fitted(plain(key), 12, 420), 12)


def _draw_legend(canvas: Canvas, row: Sequence[str], tints: dict[str, tuple[int, int, int]], y: float) -> None:
    x = float(_MARGIN)
    for key in row:
        canvas.box((x, y + 1, x + 16, y + 14), tints[key], QUIET)
        canvas.text(x + 22, y, fitted(plain(key), 12, 420), 12, INK)
        x += _key_width(key)


def _draw_panel(canvas: Canvas, panel: Panel, box: Box, fps: float) -> None:
    low, high = _span(panel)
    length = max(len(curve.values) for curve in panel.curves)
    x_scale, y_scale = (box[2] - box[0]) / max(length - 1, 1), (box[3] - box[1]) / (high - low)
    for value in ticks(low, high):
        y = box[3] - (value - low) * y_scale
        canvas.line([(box[0], y), (box[2], y)], GRID)
        canvas.text(box[0] - 5, y, f"{value:.6g}", 10, QUIET, "rm")
    seconds = (length - 1) / fps
    for time in ticks(0, seconds, 6):
        canvas.text(box[0] + time * fps * x_scale, box[3] + 4, f"{time:g} s", 10, QUIET, "ma")
    canvas.box(box, outline=GRID)
    x = box[0] + _draw_title(canvas, panel.title, box)
    for i, curve in enumerate(panel.curves):
        colour = LINES[i % len(LINES)]
        known = np.isfinite(curve.values)
        points = [(box[0] + t * x_scale, box[3] - (curve.values[t] - low) * y_scale) for t in np.flatnonzero(known)]
        if len(points) > 1:
            canvas.line(points, colour, 1.4)
        name = plain(curve.name)
        if x + 24 + width_of(name, 11) <= box[2]:
            canvas.line([(x, box[1] - 11), (x + 12, box[1] - 11)], colour, 2.5)
            canvas.text(x + 16, box[1] - 11, name, 11, QUIET, "lm")
            x += 26 + width_of(name, 11)


def _draw_title(canvas: Canvas, title: str, box: Box) -> float:
    """Write a panel's title above its box; the px that it takes."""
    text = fitted(plain(title), 13, (box[2] - box[0]) / 2)
    canvas.text(box[0], box[1] - 11, text, 13, INK, "lm")
    return width_of(text, 13) + 16


def _span(panel: Panel) -> tuple[float, float]:
    """The common scale, a little wider than the values, and 1e-3 at least, so that noise doesn't look like motion."""
    values = np.concatenate([curve.values[np.isfinite(curve.values)] for curve in panel.curves])
    if not values.size:
        return 0.0, 1.0
    low, high = float(values.min()), float(values.max())
    pad = max(0.06 * (high - low), 5e-4, 1e-6 * abs(high))
    return low - pad, high + pad
