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
from .chart import SCALE, Chart, Colour, Entry
from .episode import EpisodeInfo, Label
from .starts import Region, Start

TABLE, REACHABLE, KEPT_FREE = (246, 246, 244), (206, 224, 242), (240, 228, 206)
AT_SOME_YAWS = (229, 236, 243)
INK, RIM, PLANNED = (38, 43, 51), (150, 160, 172), (84, 96, 112)
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

    @classmethod
    def of(cls, info: EpisodeInfo, began: tuple[float, float] | None = None) -> Self:
        """An episode as it is staged."""
        return cls(info.start[:2], info.label, began)


def draw_coverage(
    region: Region, planned: Sequence[Start], tried: Sequence[Tried], viewpoint: Viewpoint, out: Path
) -> Path:
    """Draw the table from above, what is far from the viewer up, as a PNG at `out`, and return `out`.

    Planned starts are rings with a tick along the yaw. What became of them stands where the object was seen to begin,
    joined to its ring.
    """
    corners = np.array([(x, y) for x in region.workspace.x for y in region.workspace.y])[[0, 1, 3, 2]]
    base = BASE_RADIUS * np.array([(1, 1), (-1, -1), (1, -1), (-1, 1)]) * 1.2
    chart = Chart.around(np.concatenate([corners, base]), viewpoint)
    chart.polygon(chart.pixel(corners), TABLE)
    area = _shade(chart, region)
    for box in region.kept_free:
        chart.polygon(chart.pixel(_outline(box)), KEPT_FREE, RIM)
    chart.axes()
    chart.polygon(chart.pixel(corners), None, RIM, 1.5)
    _draw_base(chart)
    size = float(np.clip(0.3 * np.sqrt(area / max(len(planned), 1)) * SCALE, 4.0, 11.0))
    for start in planned:
        _draw_plan(chart, start, size)
    for label in COLOURS:
        for episode in (episode for episode in tried if episode.label == label):
            _draw_tried(chart, episode, size)
    chart.title("Where episodes begin")
    chart.legend(_legend(planned, tried, kept_free=bool(region.kept_free)))
    out.parent.mkdir(parents=True, exist_ok=True)
    chart.finished().save(out)
    return out


def _shade(chart: Chart, region: Region) -> float:
    """Colour where an object may begin, paler where not at every yaw; the area in m^2."""
    xy = chart.squares(_SIDE)
    yaws = np.arange(_YAWS) * np.pi / _YAWS
    share = np.mean([region.contains(xy, np.full(xy.shape[:2], yaw)) for yaw in yaws], axis=0)
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


def _legend(planned: Sequence[Start], tried: Sequence[Tried], *, kept_free: bool) -> list[Entry]:
    starts = len({episode.planned for episode in tried})
    entries = [Entry(f"{len(planned)} planned, {starts} tried", _planned_sample)]
    for label in COLOURS:
        count = sum(episode.label == label for episode in tried)
        entries.append(Entry(f"{count} {label}", partial(_draw_label, label=label, size=6.5)))
    entries.append(Entry("within reach and sight", partial(_swatch, colour=REACHABLE)))
    entries.append(Entry("so at some yaws only", partial(_swatch, colour=AT_SOME_YAWS)))
    if kept_free:
        entries.append(Entry("kept free", partial(_swatch, colour=KEPT_FREE)))
    off = [1000 * np.hypot(*np.subtract(e.began, e.planned)) for e in tried if e.began is not None]
    if off:
        entries += [Entry("Began off the plan by"), Entry(f"{np.median(off):.0f} mm (median), {max(off):.0f} at most")]
    return entries


def _planned_sample(chart: Chart, place: FloatArray) -> None:
    chart.line(place, place + np.array([12, -12]), PLANNED, 1.2)
    chart.disc(place, 9, None, PLANNED, 1.2)


def _swatch(chart: Chart, place: FloatArray, colour: Colour) -> None:
    chart.polygon(place + np.array([(-10, -10), (10, -10), (10, 10), (-10, 10)]), colour, RIM)
