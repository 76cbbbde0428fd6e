"""A picture of a collection: where episodes were to start, where they did, and what became of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Self

import numpy as np

from ..geometry import FloatArray, rotation_z
from ..perception.viewpoint import Viewpoint
from ..types import OrientedBox
from .chart import INK, SCALE, Chart, Colour, Entry
from .episode import EpisodeInfo, Label
from .outcome import THRESHOLD
from .starts import Region, Start

TABLE, REACHABLE, KEPT_FREE = (246, 246, 244), (206, 224, 242), (240, 228, 206)
AT_SOME_YAWS = (229, 236, 243)
RIM, PLANNED = (150, 160, 172), (84, 96, 112)
COLOURS: Mapping[Label, Colour] = {"valid": (22, 150, 84), "doubtful": (240, 150, 10), "failed": (208, 38, 48)}
"""The most telling uppermost. Each has a shape of its own as well: not everyone tells red from green."""
BASE_RADIUS = 0.04
"""m, of the robot's base as it is drawn."""
_SIDE = 3
"""px of the squares for which it is worked out whether they are within reach."""
_YAWS = 12
"""Over half a turn, at which it is."""


@dataclass(frozen=True)
class Tried:
    """An episode and what became of it."""

    planned: tuple[float, float]
    """m, base frame: where it was to begin."""
    label: Label
    began: tuple[float, float] | None = None
    """m, base frame: where the object was seen to begin; None where that isn't known."""
    distance: float | None = None
    """m, of the object from where it was to end; None where that isn't known."""

    @classmethod
    def of(cls, info: EpisodeInfo) -> Self:
        """An episode as it was noted."""
        return cls(info.start[:2], info.label, info.began, info.distance)


@dataclass(frozen=True)
class Covered:
    """One worker's table: where objects may begin on it, where they were to, and what became of that."""

    region: Region
    planned: Sequence[Start]
    tried: Sequence[Tried]


def draw_coverage(tables: Sequence[Covered], viewpoint: Viewpoint, out: Path, threshold: float = THRESHOLD) -> Path:
    """Draw all tables (one or more), laid over each other, as a PNG at `out`, and return `out`.

    They are seen from above, what is far from the viewer up. Planned starts are rings with a tick along the yaw. What
    became of them stands where the object was seen to begin, joined to its ring. `threshold` (m) is the distance from
    its place within which an object has arrived; it stands in the histogram of the distances.
    """
    region = tables[0].region
    planned = [start for table in tables for start in table.planned]
    tried = [episode for table in tables for episode in table.tried]
    corners = np.array([(x, y) for x in region.workspace.x for y in region.workspace.y])[[0, 1, 3, 2]]
    base = BASE_RADIUS * np.array([(1, 1), (-1, -1), (1, -1), (-1, 1)]) * 1.2
    chart = Chart.around(np.concatenate([corners, base]), viewpoint)
    chart.polygon(chart.pixel(corners), TABLE)
    kept_free = [box for table in tables for box in table.region.kept_free]
    for box in kept_free if len(tables) == 1 else ():
        chart.polygon(chart.pixel(_outline(box)), KEPT_FREE, RIM)
    area = _shade(chart, [table.region for table in tables])
    for box in kept_free:
        chart.polygon(chart.pixel(_outline(box)), None, RIM)
    chart.axes()
    chart.polygon(chart.pixel(corners), None, RIM, 1.5)
    _draw_base(chart)
    chart.view_direction()
    size = float(np.clip(0.3 * np.sqrt(area / max(len(planned), 1)) * SCALE, 4.0, 11.0))
    for start in planned:
        _draw_plan(chart, start, size)
    for label in COLOURS:
        for episode in (episode for episode in tried if episode.label == label):
            _draw_tried(chart, episode, size)
    chart.title("Where episodes begin" + (f", on {len(tables)} tables" if len(tables) > 1 else ""))
    entries = _legend(planned, tried, tables=len(tables), kept_free=bool(kept_free))
    below = chart.legend(entries)
    distances = np.array([episode.distance for episode in tried if episode.distance is not None])
    if len(distances):
        chart.histogram(below, 100 * distances, 100 * threshold, "How far from its place it ended, cm")
    out.parent.mkdir(parents=True, exist_ok=True)
    chart.finished().save(out)
    return out


def _shade(chart: Chart, regions: Sequence[Region]) -> float:
    """Colour where an object may begin, paler where not at every yaw and on every table; the area in m^2."""
    xy = chart.squares(_SIDE)
    yaws = np.arange(_YAWS) * np.pi / _YAWS
    allowed = (region.contains(xy, np.full(xy.shape[:2], yaw)) for region in regions for yaw in yaws)
    share = sum((here.astype(float) for here in allowed), np.zeros(xy.shape[:2])) / (len(regions) * _YAWS)
    chart.shade(share, REACHABLE, _SIDE)
    return float(share.sum()) * (_SIDE / SCALE) ** 2


def _outline(box: OrientedBox) -> FloatArray:
    """(4, 2) m: the corners of a box, seen from above."""
    corners = np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)]) * box.extent[:2] / 2
    return corners @ rotation_z(box.yaw)[:2, :2].T + box.centre[:2]


def _draw_base(chart: Chart) -> None:
    place = chart.pixel(np.zeros(2))
    chart.disc(place, BASE_RADIUS * SCALE, INK)
    chart.text(place, "robot", 15, (255, 255, 255), "mm")


def _draw_plan(chart: Chart, start: Start, size: float) -> None:
    along = np.array([np.cos(start.yaw), np.sin(start.yaw)])
    xy, width = np.array(start.xy), max(1.0, size / 6)
    chart.line(chart.pixel(xy), chart.pixel(xy + along * 1.9 * size / SCALE), PLANNED, width)
    chart.disc(chart.pixel(xy), size, None, PLANNED, width)


def _draw_tried(chart: Chart, episode: Tried, size: float) -> None:
    planned, began = (chart.pixel(np.array(xy)) for xy in (episode.planned, episode.began or episode.planned))
    chart.line(planned, began, COLOURS[episode.label], 1.5)
    _draw_label(chart, began, episode.label, 0.62 * size)


def _draw_label(chart: Chart, place: FloatArray, label: Label, size: float) -> None:
    """A disc, a diamond or a cross."""
    colour = COLOURS[label]
    if label == "valid":
        chart.disc(place, size, colour)
    elif label == "doubtful":
        chart.polygon(place + 1.35 * size * np.array([(1, 0), (0, 1), (-1, 0), (0, -1)]), colour, (255, 255, 255))
    else:
        for halo, width in (((255, 255, 255), 0.95 * size + 1.5), (colour, 0.75 * size)):
            for tip in (np.array([1.3, 1.3]) * size, np.array([1.3, -1.3]) * size):
                chart.line(place - tip, place + tip, halo, width)


def _legend(planned: Sequence[Start], tried: Sequence[Tried], *, tables: int, kept_free: bool) -> list[Entry]:
    starts = len({episode.planned for episode in tried})
    entries = [Entry(f"{len(planned)} planned, {starts} tried", _planned_sample)]
    for label in COLOURS:
        count = sum(episode.label == label for episode in tried)
        entries.append(Entry(f"{label} {count}", partial(_draw_label, label=label, size=6.5)))
    entries.append(Entry("within reach and sight", partial(_swatch, colour=REACHABLE)))
    entries.append(
        Entry(
            "so at some yaws only" if tables == 1 else "at some yaws or tables only",
            partial(_swatch, colour=AT_SOME_YAWS),
        )
    )
    if kept_free and tables == 1:
        entries.append(Entry("kept free", partial(_swatch, colour=KEPT_FREE)))
    elif kept_free:
        entries.append(Entry("kept free on one of them", _outline_sample))
    off = [1000 * np.hypot(*np.subtract(e.began, e.planned)) for e in tried if e.began is not None]
    if off:
        entries += [Entry("Began off the plan by"), Entry(f"{np.median(off):.0f} mm (median), {max(off):.0f} at most")]
    return entries


def _planned_sample(chart: Chart, place: FloatArray) -> None:
    chart.line(place, place + np.array([12, -12]), PLANNED, 1.2)
    chart.disc(place, 9, None, PLANNED, 1.2)


def _outline_sample(chart: Chart, place: FloatArray) -> None:
    chart.polygon(place + np.array([(-10, -10), (10, -10), (10, 10), (-10, 10)]), None, RIM)


def _swatch(chart: Chart, place: FloatArray, colour: Colour) -> None:
    chart.polygon(place + np.array([(-10, -10), (10, -10), (10, 10), (-10, 10)]), colour, RIM)
