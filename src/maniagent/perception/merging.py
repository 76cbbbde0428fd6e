"""Which regions of the height map belong to one object after all.

Each rule is a fact about things on tables: a print has no height, what would hold water is one vessel, a stem is
small, a cap continues its pen. Objects that touch side by side, or lie on one another, meet none of them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from ..geometry import FloatArray
from ..types import BoolArray
from .heightmap import HeightMap

Labels = NDArray[np.int32]

SAME_COLOUR = 16.0
"""CIE Lab distance (lightness scaled down) below which two surfaces have one colour."""
SAME_HUE = 13.0
"""Distance in the a, b plane below which two surfaces have one colour, however lit."""
LEVEL = 0.004
"""m; a smaller step between two surfaces is none."""
FLAT = 0.010
"""m; lower things are cloth, paper, print."""
TINY = 1.8e-4
"""m^2; a part, never an object."""
SMALL = 5e-4
"""m^2; next to something larger, a part: a stem, a handle's knob."""
STOREY = 0.015
"""m; what is that much higher than its surroundings stands on them, or beside them."""
ELONGATED = 2.4
"""Length over width from which end-to-end parts may make one tool, fruit or pen."""
REACH = 8
"""Cells from a crumb within which the object it belongs to is looked for."""
STEP_SPAN = 2
"""Cells to either side of a border between which its step is measured."""
WATER_LEVELS = (0.008, 0.012, 0.016, 0.024, 0.036, 0.050)
"""m, heights up to which the table is flooded in thought to find vessels."""
MIN_BASIN = 5e-4
"""m^2; smaller hollows are dents."""


@dataclass(frozen=True, eq=False)
class _Region:
    cells: NDArray[np.intp]
    """(N, 2) rows and columns."""
    area: float
    """m^2."""
    colour: FloatArray
    """(3,) median Lab."""
    top: float
    """m, 90th percentile of its height."""
    basin: int
    """Number of the basin it is part of, as its bottom or its wall; 0 for none."""


def _same_hue(a: _Region, b: _Region) -> bool:
    """One colour but for the light: in shade, chroma fades along with lightness."""
    dark, bright = sorted((a.colour, b.colour), key=lambda lab: float(lab[0]))
    faded = (bright[1:] - 128.0) * dark[0] / max(float(bright[0]), 1.0)
    return float(np.linalg.norm(dark[1:] - 128.0 - faded)) < SAME_HUE


@dataclass(frozen=True, eq=False)
class _Border:
    """Two neighbouring regions, the smaller one first."""

    small: _Region
    large: _Region
    length: int
    """Cells."""
    step: float
    """m, mean height of the large one minus that of the small one, next to the border."""
    perimeter: int
    """Cells the small one has in common with anything else, the table included."""
    outer: int
    """Of those, with the table."""
    cell: float
    """m"""

    @property
    def share(self) -> float:
        """Share of the small region's perimeter."""
        return self.length / max(self.perimeter, 1)

    @property
    def same_colour(self) -> bool:
        return float(np.linalg.norm(self.small.colour - self.large.colour)) < SAME_COLOUR

    @property
    def same_hue(self) -> bool:
        return _same_hue(self.small, self.large)

    @property
    def colourful(self) -> bool:
        """Both have a hue at all: among greys, lightness is all there is to tell things apart."""
        return all(np.linalg.norm(part.colour[1:] - 128.0) > SAME_HUE for part in (self.small, self.large))

    @property
    def lies_on_cloth(self) -> bool:
        """The large one is flat and the small one is not: nothing grows out of a cloth."""
        return self.large.top < FLAT and self.small.top > self.large.top + LEVEL

    @property
    def is_level(self) -> bool:
        return abs(self.step) < LEVEL


def _one_surface(border: _Border) -> bool:
    return border.same_colour and border.is_level


def _shaded_side(border: _Border) -> bool:
    """The side of a round thing that lies in shade."""
    return border.same_hue and border.colourful and abs(border.step) < 0.012 and border.share > 0.25


def _limb(border: _Border) -> bool:
    """Head and body: of one colour, side by side, whatever their heights. What stands ON a thing has no outer side."""
    one_colour = border.same_colour or (border.same_hue and border.colourful)
    beside = border.share > 0.1 and border.outer > 0.25 * border.perimeter
    return one_colour and beside and not border.lies_on_cloth


def _vessel(border: _Border) -> bool:
    """Bottom and walls of what would hold water; what lies on the bottom stands out of it and touches no outside."""
    inside = border.outer < 0.1 * border.perimeter and border.share > 0.85
    if inside and border.step < -LEVEL:
        return False
    return border.small.basin > 0 and border.small.basin == border.large.basin and border.same_hue


def _print(border: _Border) -> bool:
    """A pattern within a surface: no step, and (almost) no border with the table."""
    no_higher = border.small.top < border.large.top + LEVEL
    return border.is_level and no_higher and border.share > 0.35 and border.outer < 0.2 * border.perimeter


def _cloth(border: _Border) -> bool:
    return border.is_level and max(border.small.top, border.large.top) < FLAT


def _attachment(border: _Border) -> bool:
    """A stem, a beak, a leaf: tiny, or small and at the edge of what it grows from, not on it."""
    small, large = border.small.area, border.large.area
    if border.step > STOREY:
        return False
    if small < TINY:
        return border.share > 0.05
    if border.lies_on_cloth:
        return False
    if small < min(SMALL, 0.25 * large) and border.outer > 0.4 * border.perimeter:
        return True
    level = abs(border.step) < 0.006
    return level and small < 0.35 * large and border.share > 0.25 and border.outer > 0.15 * border.perimeter


def _end_to_end(border: _Border) -> bool:
    """Cap and pen, leaf and carrot, husk and cob: together one long, full shape, joined across its width."""
    length, width, fill = _rectangle(np.concatenate([border.small.cells, border.large.cells]), border.cell)
    if length < ELONGATED * width or fill < 0.4 or abs(border.step) > 0.012:
        return False
    if border.length * border.cell > 3.0 * width:
        return False
    return all(_rectangle(part.cells, border.cell)[1] < 1.15 * width for part in (border.small, border.large))


_RULES: tuple[Callable[[_Border], bool], ...] = (
    _one_surface,
    _shaded_side,
    _vessel,
    _limb,
    _cloth,
    _print,
    _attachment,
    _end_to_end,
)
"""Tried in this order: the surest first."""


def merge_regions(labels: Labels, grid: HeightMap) -> Labels:
    """Merge neighbouring regions until no rule applies; the new labels."""
    graph = _Graph(labels, grid)
    while pairs := _agreeing(graph):
        graph.merge(pairs)
    while pair := _parted(graph):
        graph.merge([pair])
    while pair := _stray(graph):
        graph.merge([pair])
    return graph.labels


def _agreeing(graph: _Graph) -> list[tuple[int, int]]:
    """All pairs that the surest applicable rule would merge; empty where none applies."""
    for rule in _RULES:
        found = [(pair, border) for pair, border in graph.borders() if rule(border)]
        if found and rule is _attachment:
            # A part belongs to one thing: a stem that touches plate and pepper must not make them one.
            found.sort(key=lambda item: abs(item[1].step))
            nearest = {id(border.small): pair for pair, border in reversed(found)}
            return list(nearest.values())
        if found:
            return [pair for pair, _ in found]
    return []


def _parted(graph: _Graph) -> tuple[int, int] | None:
    """Two pieces of one thing that something on it parts: pieces of a cloth, or of what a storey stands on."""
    beside: dict[int, list[int]] = {}
    for (a, b), _ in graph.borders():
        for low, high in ((a, b), (b, a)):
            if graph.regions[low].top < FLAT < graph.regions[high].top or graph.carries(low, high):
                beside.setdefault(high, []).append(low)
    for pieces in beside.values():
        for a, b in combinations(pieces, 2):
            cloth = max(graph.regions[a].top, graph.regions[b].top) < FLAT
            if cloth or _same_hue(graph.regions[a], graph.regions[b]):
                return a, b
    return None


def _stray(graph: _Graph) -> tuple[int, int] | None:
    """A crumb beside an object: the end of a stem whose thin middle no camera saw. The object comes first."""
    for label, region in graph.regions.items():
        if region.area < TINY:
            (top, left), (bottom, right) = region.cells.min(axis=0), region.cells.max(axis=0)
            around = (slice(max(top - REACH, 0), bottom + REACH + 1), slice(max(left - REACH, 0), right + REACH + 1))
            near = graph.labels[around]
            others = near[(near > 0) & (near != label)]
            if len(others):
                return int(np.bincount(others).argmax()), label
    return None


class _Graph:
    """The regions and who borders on whom, kept up to date while regions are merged."""

    def __init__(self, labels: Labels, grid: HeightMap) -> None:
        self.labels = labels.copy()
        self._grid = grid
        self._lab = grid.lab
        self._basins, self._levels = _basins(grid)
        self._first, self._second, self._step = _contacts(labels, grid.height)
        order = np.argsort(labels, axis=None, kind="stable")
        bounds = np.searchsorted(labels.ravel()[order], np.arange(labels.max() + 2))
        cells = np.column_stack(np.unravel_index(order, labels.shape))
        self.regions = {
            label: self._measure(cells[low:high], label)
            for label, (low, high) in enumerate(pairwise(bounds))
            if label > 0 and high > low
        }
        self._borders: list[tuple[tuple[int, int], _Border]] | None = None

    def merge(self, pairs: Sequence[tuple[int, int]]) -> None:
        """Make one region of each chain of pairs; it keeps the chain's first number."""
        kept = np.arange(self.labels.max() + 1)
        for a, b in pairs:
            kept[kept == kept[b]] = kept[a]
        self._first, self._second = kept[self._first], kept[self._second]
        for label in np.unique(kept[np.bincount(kept, minlength=len(kept))[kept] > 1]):
            parts = [self.regions.pop(int(part)).cells for part in np.flatnonzero(kept == label)]
            cells = np.concatenate(parts)
            self.labels[cells[:, 0], cells[:, 1]] = label
            self.regions[int(label)] = self._measure(cells, int(label))
        border = self._first != self._second
        self._first, self._second, self._step = self._first[border], self._second[border], self._step[border]
        self._borders = None

    def borders(self) -> list[tuple[tuple[int, int], _Border]]:
        """Every pair of neighbouring regions with their border, longest first."""
        if self._borders is None:
            self._borders = list(self._find_borders())
        return self._borders

    def carries(self, low: int, high: int) -> bool:
        """Whether one region may be part of what the other stands on: lower by a storey, and a corner or all around."""
        if self.regions[high].top < self.regions[low].top + STOREY:
            return False
        if self.regions[low].area < SMALL:
            return True
        mine = (self._first == high) | (self._second == high)
        to_table = mine & ((self._first == 0) | (self._second == 0))
        return bool(to_table.sum() < 0.4 * mine.sum())

    def _find_borders(self) -> Iterator[tuple[tuple[int, int], _Border]]:
        base = int(self.labels.max()) + 1
        low, high = np.minimum(self._first, self._second), np.maximum(self._first, self._second)
        step = np.where(self._first < self._second, self._step, -self._step)  # from `low` to `high`
        keys, inverse, counts = np.unique(low * base + high, return_inverse=True, return_counts=True)
        rises = np.bincount(inverse, weights=step) / counts
        perimeter = np.bincount(low, minlength=base) + np.bincount(high, minlength=base)
        outer = np.bincount(high[low == 0], minlength=base)
        for i in np.argsort(-counts, kind="stable"):
            a, b = divmod(int(keys[i]), base)
            if a == 0:
                continue
            rise = float(rises[i])
            small, large = (a, b) if self.regions[a].area <= self.regions[b].area else (b, a)
            yield (
                (a, b),
                _Border(
                    small=self.regions[small],
                    large=self.regions[large],
                    length=int(counts[i]),
                    step=rise if small == a else -rise,
                    perimeter=int(perimeter[small]),
                    outer=int(outer[small]),
                    cell=self._grid.cell,
                ),
            )

    def _measure(self, cells: NDArray[np.intp], label: int) -> _Region:
        rows, columns = cells.T
        heights, middle = np.sort(self._grid.height[rows, columns]), len(cells) // 2
        return _Region(
            cells=cells,
            area=len(cells) * self._grid.cell**2,
            colour=np.partition(self._lab[rows, columns], middle, axis=0)[middle],
            top=float(heights[int(0.9 * len(heights))]),
            basin=self._basin_of(rows, columns, float(heights[middle]), label),
        )

    def _basin_of(self, rows: NDArray[np.intp], columns: NDArray[np.intp], height: float, label: int) -> int:
        """The basin a region is bottom or wall of: mostly under water, or between the water and the table."""
        touched = self._basins[rows, columns]
        if not touched.any():
            return 0
        basin = int(np.bincount(touched[touched > 0]).argmax())
        share = float(np.mean(touched == basin))
        if height < self._levels[basin] and share > 0.8:
            return basin
        mine = (self._first == label) | (self._second == label)
        outer = mine & ((self._first == 0) | (self._second == 0))
        near = share > 0.4 and abs(height - self._levels[basin]) < 0.02  # a cloth around a spoon's bowl is no wall
        is_wall = near and outer.sum() > 0.1 * mine.sum()
        return basin if is_wall else 0


def _basins(grid: HeightMap) -> tuple[Labels, FloatArray]:
    """Hollows that would hold water: their numbers from 1 (X, Y), grown by a wall's width, and their water levels."""
    kernel = np.ones((5, 5), np.uint8)  # a rim has gaps where no camera saw it
    level_of = np.zeros(grid.height.shape, np.float32)
    for level in WATER_LEVELS:
        wall = np.asarray(cv2.morphologyEx((grid.height > level).astype(np.uint8), cv2.MORPH_CLOSE, kernel), np.uint8)
        level_of[_holes(wall) & grid.occupied] = level
    count, basins, stats, _ = cv2.connectedComponentsWithStats((level_of > 0).astype(np.uint8), connectivity=4)
    levels = np.zeros(count)
    for basin in range(1, count):
        if stats[basin, cv2.CC_STAT_AREA] * grid.cell**2 < MIN_BASIN:
            basins[basins == basin] = 0
        else:
            levels[basin] = np.percentile(level_of[basins == basin], 90)
    grown = cv2.dilate(basins.astype(np.float32), np.ones((13, 13), np.uint8)).astype(np.int32)
    return np.where(basins > 0, basins, grown), levels


def _holes(wall: NDArray[np.uint8]) -> BoolArray:
    """What a wall surrounds: everything that can't be reached from the border of the map."""
    padded = cv2.copyMakeBorder(wall, 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=0)
    cv2.floodFill(padded, None, (0, 0), 2)
    return padded[1:-1, 1:-1] == 0


def _contacts(labels: Labels, height: NDArray[np.float32]) -> tuple[NDArray[np.int64], NDArray[np.int64], FloatArray]:
    """All pairs of neighbouring cells with different labels, and the step from the first to the second (m)."""
    first, second, steps = [], [], []
    for axis in (0, 1):
        a = np.moveaxis(labels, axis, 0)
        h = np.moveaxis(height, axis, 0)
        rows, columns = np.nonzero(a[:-1] != a[1:])
        first.append(a[rows, columns])
        second.append(a[rows + 1, columns])
        # Measured a little inside either region: right at a border the surfaces are rounded off and mixed.
        before, after = np.maximum(rows - STEP_SPAN, 0), np.minimum(rows + 1 + STEP_SPAN, len(a) - 1)
        before = np.where(a[before, columns] == a[rows, columns], before, rows)
        after = np.where(a[after, columns] == a[rows + 1, columns], after, rows + 1)
        steps.append(h[after, columns] - h[before, columns])
    return np.concatenate(first).astype(np.int64), np.concatenate(second).astype(np.int64), np.concatenate(steps)


def _rectangle(cells: NDArray[np.intp], cell: float) -> tuple[float, float, float]:
    """Length and width (m) of the smallest rectangle around some cells, and the share of it that they fill."""
    _, sides, _ = cv2.minAreaRect(cells.astype(np.float32))
    length, width = max(sides) + 1.0, min(sides) + 1.0
    return length * cell, width * cell, len(cells) / (length * width)
