"""Which regions of the height map belong to one object after all.

Each rule is a fact about things on tables: a print has no height, what would hold water is one vessel, a stem is
small, a cap continues its pen. Objects that touch side by side, or lie on one another, meet none of them.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations, permutations

import numpy as np
from scipy.spatial.distance import cdist

from .heightmap import HeightMap
from .regions import FLAT, LEVEL, SMALL, STOREY, Border, Labels, Region, RegionGraph, rectangle, same_hue

TINY = 1.8e-4
"""m^2; a part, never an object."""
PART, LIMB = 1.2e-3, 1e-2
"""m^2; no stem or leaf, and no head, is larger: the rims and bottoms of a sink are."""
ELONGATED = 2.4
"""Length over width from which end-to-end parts may make one tool, fruit or pen."""
NECK = 0.012
"""m; a spoon's neck that lies too flat to be seen is no longer, and what it joins ends no higher."""
ON_AXIS = 0.007
"""m by which a spoon's head may be off the axis of its handle."""
SAME_ANGLE = 8.0
"""Degrees between hues that are one, however pale."""
REACH = 8
"""Cells from a crumb within which the object it belongs to is looked for."""


def _one_surface(border: Border) -> bool:
    return border.same_colour and border.is_level


def _shaded_side(border: Border) -> bool:
    """The side of a round thing that lies in shade."""
    return border.same_hue and border.colourful and abs(border.step) < 0.012 and border.share > 0.25


def _washed_out(border: Border) -> bool:
    """The side of a glossy thing that faces the light: of the same hue, paler, and all along the other side."""
    return border.colourful and border.hue_angle < SAME_ANGLE and border.share > 0.35 and abs(border.step) < 0.006


def _limb(border: Border) -> bool:
    """Head and body: of one colour, side by side, whatever their heights. What stands ON a thing has no outer side."""
    one_colour = border.same_colour or (border.same_hue and border.colourful)
    beside = border.share > 0.1 and border.outer > 0.25 * border.perimeter
    return one_colour and beside and not border.lies_on_cloth and border.small.area < LIMB


def _vessel(border: Border) -> bool:
    """Bottom and walls of what would hold water; what lies on the bottom stands out of it and touches no outside."""
    inside = border.outer < 0.1 * border.perimeter and border.share > 0.85
    if inside and border.step < -LEVEL:
        return False
    return border.small.basin > 0 and border.small.basin == border.large.basin and border.same_hue


def _print(border: Border) -> bool:
    """A pattern within a surface: no step, and (almost) no border with the table."""
    no_higher = border.small.top < border.large.top + LEVEL
    return border.is_level and no_higher and border.share > 0.35 and border.outer < 0.2 * border.perimeter


def _cloth(border: Border) -> bool:
    return border.is_level and max(border.small.top, border.large.top) < FLAT


def _attachment(border: Border) -> bool:
    """A stem, a beak, a leaf: tiny, or small and at the edge of what it grows from, not on it."""
    small, large = border.small.area, border.large.area
    if border.step > STOREY or small > PART:
        return False
    if small < TINY:
        return border.share > 0.05
    if border.lies_on_cloth:
        return False
    if small < min(SMALL, 0.25 * large) and border.outer > 0.4 * border.perimeter:
        return True
    level = abs(border.step) < 0.006
    return level and small < 0.35 * large and border.share > 0.25 and border.outer > 0.15 * border.perimeter


def _end_to_end(border: Border) -> bool:
    """Cap and pen, leaf and carrot, husk and cob: together one long, full shape, joined across its width."""
    length, width, fill = rectangle(np.concatenate([border.small.cells, border.large.cells]), border.cell)
    if length < ELONGATED * width or fill < 0.4 or abs(border.step) > 0.012:
        return False
    if border.length * border.cell > 3.0 * width:
        return False
    return all(rectangle(part.cells, border.cell)[1] < 1.25 * width for part in (border.small, border.large))


_RULES: tuple[Callable[[Border], bool], ...] = (
    _one_surface,
    _shaded_side,
    _washed_out,
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
    graph = RegionGraph(labels, grid)
    while pairs := _agreeing(graph):
        graph.merge(pairs)
    while pair := _parted(graph):
        graph.merge([pair])
    while pair := _stray(graph):
        graph.merge([pair])
    while pair := _necked(graph):
        graph.merge([pair])
    return graph.labels


def _agreeing(graph: RegionGraph) -> list[tuple[int, int]]:
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


def _parted(graph: RegionGraph) -> tuple[int, int] | None:
    """Two pieces of one thing that something on it parts: pieces of a cloth, or of what a storey stands on."""
    beside: dict[int, list[int]] = {}
    for (a, b), _ in graph.borders():
        for low, high in ((a, b), (b, a)):
            if graph.regions[low].top < FLAT < graph.regions[high].top or graph.carries(low, high):
                beside.setdefault(high, []).append(low)
    for pieces in beside.values():
        for a, b in combinations(pieces, 2):
            cloth = max(graph.regions[a].top, graph.regions[b].top) < FLAT
            if cloth or same_hue(graph.regions[a], graph.regions[b]):
                return a, b
    return None


def _stray(graph: RegionGraph) -> tuple[int, int] | None:
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


def _necked(graph: RegionGraph) -> tuple[int, int] | None:
    """A handle and the head beyond its thin end, whose neck lies too flat to be seen."""
    touching = {pair for pair, _ in graph.borders()}
    for (a, handle), (b, head) in permutations(graph.regions.items(), 2):
        apart = (a, b) not in touching and (b, a) not in touching
        if apart and TINY < head.area < 1.5 * handle.area < 6 * SMALL and _points_at(handle, head, graph):
            return a, b
    return None


def _points_at(handle: Region, head: Region, graph: RegionGraph) -> bool:
    """Whether a long region narrows towards another that lies on its axis, a neck's length away, both ends low."""
    length, width, _ = rectangle(handle.cells, graph.cell)
    if length < ELONGATED * width:
        return False
    distances = cdist(handle.cells, head.cells)
    i, j = np.unravel_index(int(distances.argmin()), distances.shape)
    end, start = handle.cells[i], head.cells[j]
    if distances.min() * graph.cell > NECK or max(graph.height_at(end), graph.height_at(start)) > NECK:
        return False
    centred = handle.cells - handle.cells.mean(axis=0)
    along, across = np.linalg.svd(centred, full_matrices=False)[2]
    off_axis = abs((head.cells.mean(axis=0) - handle.cells.mean(axis=0)) @ across) * graph.cell
    tip = centred[np.abs((handle.cells - end) @ along) * graph.cell < NECK]
    return bool(off_axis < ON_AXIS and np.ptp(tip @ across) * graph.cell < 0.75 * width)
