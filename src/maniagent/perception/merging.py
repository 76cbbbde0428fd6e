"""Which regions of the height map belong to one object after all.

Each rule is a fact about things on tables: a print has no height, a rim surrounds its well, a stem is small, a cap
continues its pen. Objects that touch side by side, or lie on one another, meet none of them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ..geometry import FloatArray
from .heightmap import HeightMap

Labels = NDArray[np.int32]

SAME_COLOUR = 16.0
"""CIE Lab distance (lightness scaled down) below which two surfaces have one colour."""
LEVEL = 0.004
"""m; a smaller step between two surfaces is none."""
FLAT = 0.010
"""m; lower things are cloth, paper, print."""
TINY = 1.8e-4
"""m^2; a part, never an object."""
ELONGATED = 2.4
"""Length over width from which end-to-end parts may make one tool, fruit or pen."""
STEP_SPAN = 2
"""Cells to either side of a border between which its step is measured."""


@dataclass(frozen=True)
class _Region:
    cells: NDArray[np.intp]
    """(N, 2) rows and columns."""
    area: float
    """m^2."""
    colour: FloatArray
    """(3,) median Lab."""
    top: float
    """m, 90th percentile of its height."""
    perimeter: int
    """Cells it has in common with anything else, the table included."""
    outer: int
    """Of those, with the table."""


@dataclass(frozen=True)
class _Border:
    """Two neighbouring regions, the smaller one first."""

    small: _Region
    large: _Region
    length: int
    """Cells."""
    step: float
    """m, median height of the large one minus that of the small one, next to the border."""
    cell: float
    """m"""

    @property
    def share(self) -> float:
        """Share of the small region's perimeter."""
        return self.length / max(self.small.perimeter, 1)

    @property
    def same_colour(self) -> bool:
        return float(np.linalg.norm(self.small.colour - self.large.colour)) < SAME_COLOUR

    @property
    def is_level(self) -> bool:
        return abs(self.step) < LEVEL


def _one_surface(border: _Border) -> bool:
    return border.same_colour and border.is_level


def _print(border: _Border) -> bool:
    """A pattern within a surface: no step, and (almost) no border with the table."""
    return border.is_level and border.share > 0.35 and border.small.outer < 0.1 * border.small.perimeter


def _cloth(border: _Border) -> bool:
    return border.is_level and max(border.small.top, border.large.top) < FLAT


def _rim(border: _Border) -> bool:
    """One colour, and the higher one surrounds the lower one for the most part."""
    low, step = (border.small, border.step) if border.step > 0 else (border.large, -border.step)
    return step > 0 and border.same_colour and border.length > 0.45 * low.perimeter


def _attachment(border: _Border) -> bool:
    """A stem, a beak, a leaf: tiny, or small and level with what it grows from."""
    if border.small.area < TINY:
        return border.share > 0.15
    return border.small.area < 0.35 * border.large.area and abs(border.step) < 0.006 and border.share > 0.25


def _end_to_end(border: _Border) -> bool:
    """Cap and pen, leaf and carrot, husk and cob: together one long, full shape, joined across its width."""
    length, width, fill = _rectangle(np.concatenate([border.small.cells, border.large.cells]), border.cell)
    if length < ELONGATED * width or fill < 0.6 or abs(border.step) > 0.012:
        return False
    if border.length * border.cell > 1.8 * width:
        return False
    return all(_rectangle(part.cells, border.cell)[1] < 1.15 * width for part in (border.small, border.large))


_RULES: tuple[Callable[[_Border], bool], ...] = (_one_surface, _cloth, _print, _rim, _attachment, _end_to_end)
"""Tried in this order: the surest first."""


def merge_regions(labels: Labels, grid: HeightMap) -> Labels:
    """Merge neighbouring regions until no rule applies; the new labels."""
    lab = grid.lab()
    labels = labels.copy()
    for _ in range(len(np.unique(labels))):
        borders = list(_borders(labels, grid, lab))
        pair = next((pair for rule in _RULES for pair, border in borders if rule(border)), None)
        if pair is None:
            break
        labels[labels == pair[1]] = pair[0]
    return labels


def _borders(labels: Labels, grid: HeightMap, lab: NDArray[np.float32]) -> Iterator[tuple[tuple[int, int], _Border]]:
    """Every pair of neighbouring regions with their border, longest first."""
    first, second, step = _contacts(labels, grid.height)
    base = int(labels.max()) + 1
    low, high = np.minimum(first, second), np.maximum(first, second)
    step = np.where(first < second, step, -step)  # height of `high` minus height of `low`
    keys, inverse, counts = np.unique(low * base + high, return_inverse=True, return_counts=True)
    regions = _regions(labels, grid, lab, keys, counts, base)
    for i in np.argsort(-counts, kind="stable"):
        a, b = divmod(int(keys[i]), base)
        if a == 0:
            continue
        rise = float(np.median(step[inverse == i]))
        small, large = regions[a], regions[b]
        if small.area > large.area:
            small, large, rise = large, small, -rise
        yield (a, b), _Border(small, large, int(counts[i]), rise, grid.cell)


def _contacts(labels: Labels, height: NDArray[np.float32]) -> tuple[NDArray[np.int64], ...]:
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


def _regions(
    labels: Labels,
    grid: HeightMap,
    lab: NDArray[np.float32],
    keys: NDArray[np.int64],
    counts: NDArray[np.int64],
    base: int,
) -> dict[int, _Region]:
    regions: dict[int, _Region] = {}
    low, high = keys // base, keys % base
    for label in np.unique(labels[labels > 0]):
        cells = np.argwhere(labels == label)
        rows, columns = cells.T
        mine = (low == label) | (high == label)
        regions[int(label)] = _Region(
            cells=cells,
            area=len(cells) * grid.cell**2,
            colour=np.median(lab[rows, columns], axis=0),
            top=float(np.percentile(grid.height[rows, columns], 90)),
            perimeter=int(counts[mine].sum()),
            outer=int(counts[mine & (low == 0)].sum()),
        )
    return regions


def _rectangle(cells: NDArray[np.intp], cell: float) -> tuple[float, float, float]:
    """Length and width (m) of the smallest rectangle around some cells, and the share of it that they fill."""
    _, sides, _ = cv2.minAreaRect(cells.astype(np.float32))
    length, width = max(sides) + 1.0, min(sides) + 1.0
    return length * cell, width * cell, len(cells) / (length * width)
