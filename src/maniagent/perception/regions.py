"""Regions of the height map, and who borders on whom: what the rules of `merging.py` are stated in."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from ..geometry import FloatArray
from .basins import find_basins
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
SMALL = 5e-4
"""m^2; next to something larger, a part: a stem, a handle's knob."""
STEP_SPAN = 2
"""Cells to either side of a border between which its step is measured."""
STOREY = 0.015
"""m; what is that much higher than its surroundings stands on them, or beside them."""


@dataclass(frozen=True, eq=False)
class Region:
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


def same_hue(a: Region, b: Region) -> bool:
    """One colour but for the light: in shade, chroma fades along with lightness."""
    dark, bright = sorted((a.colour, b.colour), key=lambda lab: float(lab[0]))
    faded = (bright[1:] - 128.0) * dark[0] / max(float(bright[0]), 1.0)
    return float(np.linalg.norm(dark[1:] - 128.0 - faded)) < SAME_HUE


@dataclass(frozen=True, eq=False)
class Border:
    """Two neighbouring regions, the smaller one first."""

    small: Region
    large: Region
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
        return same_hue(self.small, self.large)

    @property
    def hue_angle(self) -> float:
        """Degrees between the two hues in the a, b plane."""
        a, b = (part.colour[1:] - 128.0 for part in (self.small, self.large))
        return float(np.degrees(np.arccos(np.clip(a @ b / (np.linalg.norm(a) * np.linalg.norm(b) + 1e-9), -1.0, 1.0))))

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


class RegionGraph:
    """The regions and who borders on whom, kept up to date while regions are merged."""

    def __init__(self, labels: Labels, grid: HeightMap) -> None:
        self.labels = labels.copy()
        self.cell = grid.cell
        self._grid = grid
        self._lab = grid.lab
        self._basins, self._levels = find_basins(grid)
        self._first, self._second, self._step = _contacts(labels, grid.height)
        order = np.argsort(labels, axis=None, kind="stable")
        bounds = np.searchsorted(labels.ravel()[order], np.arange(labels.max() + 2))
        cells = np.column_stack(np.unravel_index(order, labels.shape))
        self.regions = {
            label: self._measure(cells[low:high], label)
            for label, (low, high) in enumerate(pairwise(bounds))
            if label > 0 and high > low
        }
        self._borders: list[tuple[tuple[int, int], Border]] | None = None

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

    def borders(self) -> list[tuple[tuple[int, int], Border]]:
        """Every pair of neighbouring regions with their border, longest first."""
        if self._borders is None:
            self._borders = list(self._find_borders())
        return self._borders

    def height_at(self, cell: NDArray[np.intp]) -> float:
        """m, of the surface at a cell (row, column)."""
        return float(self._grid.height[cell[0], cell[1]])

    def carries(self, low: int, high: int) -> bool:
        """Whether one region may be part of what the other stands on: lower by a storey, and a corner or all around."""
        if self.regions[high].top < self.regions[low].top + STOREY:
            return False
        if self.regions[low].area < SMALL:
            return True
        mine = (self._first == high) | (self._second == high)
        to_table = mine & ((self._first == 0) | (self._second == 0))
        return bool(to_table.sum() < 0.4 * mine.sum())

    def _find_borders(self) -> Iterator[tuple[tuple[int, int], Border]]:
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
                Border(
                    small=self.regions[small],
                    large=self.regions[large],
                    length=int(counts[i]),
                    step=rise if small == a else -rise,
                    perimeter=int(perimeter[small]),
                    outer=int(outer[small]),
                    cell=self._grid.cell,
                ),
            )

    def _measure(self, cells: NDArray[np.intp], label: int) -> Region:
        rows, columns = cells.T
        heights, middle = np.sort(self._grid.height[rows, columns]), len(cells) // 2
        return Region(
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


def rectangle(cells: NDArray[np.intp], cell: float) -> tuple[float, float, float]:
    """Length and width (m) of the smallest rectangle around some cells, and the share of it that they fill."""
    _, sides, _ = cv2.minAreaRect(cells.astype(np.float32))
    length, width = max(sides) + 1.0, min(sides) + 1.0
    return length * cell, width * cell, len(cells) / (length * width)
