"""Splitting what stands on the table into objects, by geometry and colour.

On the height map: steps in colour or height are edges; what lies between edges seeds a region; a watershed grows the
regions to the edges. That splits too much (the stem of a pepper, the ring on a plate), so regions are merged again
by the rules in `merging.py`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ..types import BoolArray, Observation
from .heightmap import HeightMap, build_height_map
from .merging import merge_regions
from .rig import Rig
from .segments import Segment
from .views import ViewPoints, foreground

Labels = NDArray[np.int32]
"""(X, Y), 0 where nothing stands, else the number of a region, from 1."""

COLOUR_STEP = 15.0
"""CIE Lab distance over EDGE_SPAN that makes an edge."""
HEIGHT_STEP = 0.006
"""m over EDGE_SPAN that makes an edge."""
EDGE_SPAN = 2
"""Cells to either side of the one that is judged."""
MIN_SEED = 5
"""Cells; smaller islands between edges seed nothing."""
MIN_OBJECT_AREA = 0.8e-4
"""m^2; anything smaller from above is noise."""
MAX_POINTS = 6000
"""Points kept of a segment: more make nothing better."""


@dataclass(frozen=True)
class TableView:
    """Everything perception knows of one observation."""

    segments: tuple[Segment, ...]
    """In the order of base y, lowest first: in the twin, left to right in the main view."""
    height_map: HeightMap


def segment(observation: Observation, rig: Rig) -> TableView:
    """Split what the cameras see into segments, without naming them.

    Raises
    ------
    CameraFailure
        Where the main view is of no use.

    """
    views = foreground(observation, rig.covers_robot, rig.workspace, rig.tuning)
    grid = build_height_map(views, rig.workspace, trust_bare=rig.tuning.foot is not None)
    labels = merge_regions(split_regions(grid), grid)
    supports = find_supports(labels, grid)
    segments = cut_segments(views, labels, supports, grid)
    order = np.argsort([s.centre[1] for s in segments], kind="stable")
    return TableView(tuple(segments[i] for i in order), grid)


def split_regions(grid: HeightMap) -> Labels:
    """Seeds between the edges, grown by a watershed."""
    lab = grid.lab
    edges = np.zeros(grid.occupied.shape, bool)
    inside = slice(EDGE_SPAN, -EDGE_SPAN)
    before, after = slice(None, -2 * EDGE_SPAN), slice(2 * EDGE_SPAN, None)
    for low, high, middle in (
        ((before, inside), (after, inside), (inside, inside)),
        ((inside, before), (inside, after), (inside, inside)),
        ((before, before), (after, after), (inside, inside)),
        ((before, after), (after, before), (inside, inside)),
    ):
        both = grid.occupied[low] & grid.occupied[high]
        difference = lab[low] - lab[high]
        colour = np.einsum("xyc,xyc->xy", difference, difference) > COLOUR_STEP**2
        step = np.abs(grid.height[low] - grid.height[high]) > HEIGHT_STEP
        edges[middle] |= both & (colour | step)
    seeds = (grid.occupied & ~edges).astype(np.uint8)
    count, found, stats, _ = cv2.connectedComponentsWithStats(seeds, connectivity=4)
    markers = np.asarray(found, np.int32)
    small = stats[:, cv2.CC_STAT_AREA] < MIN_SEED
    markers = np.where(small[markers], 0, markers).astype(np.int32)
    markers = _seed_the_unseeded(markers, grid.occupied, count)
    markers[~grid.occupied] = markers.max() + 1  # a region of its own for the table, so that nothing floods it
    relief = np.clip(grid.height * (255.0 / 0.10), 0, 255)
    image = np.dstack([relief, lab[..., 1], lab[..., 2]]).astype(np.uint8)
    table = int(markers.max())
    grown = cv2.watershed(image, markers.astype(np.int32))
    return _fill_ridges(np.where((grown == table) | ~grid.occupied, 0, grown), grid.occupied)


def _seed_the_unseeded(markers: Labels, occupied: BoolArray, first: int) -> Labels:
    """Seed whole islands that consist of nothing but edges (a thin fork, a steep egg)."""
    count, islands = cv2.connectedComponents(occupied.astype(np.uint8), connectivity=8)
    seeded = np.zeros(count, bool)
    seeded[np.unique(islands[markers > 0])] = True
    seeded[0] = True
    out = markers.astype(np.int32)
    unseeded = ~seeded[islands]
    out[unseeded] = first + islands[unseeded]
    return out


def _fill_ridges(labels: Labels, occupied: BoolArray) -> Labels:
    """Give the watershed's ridges (-1), and edges that the table flooded (0), to their neighbours."""
    out = np.maximum(labels, 0).astype(np.int32)
    missing = occupied & (out == 0)
    while missing.any():
        spread = cv2.dilate(out.astype(np.float32), np.ones((3, 3), np.uint8)).astype(np.int32)
        out[missing] = spread[missing]
        still = occupied & (out == 0)
        if still.sum() == missing.sum():  # an island of its own, too small for a region
            break
        missing = still
    return out


def find_supports(labels: Labels, grid: HeightMap) -> Mapping[int, tuple[float, int]]:
    """By region: the height (m) it rests on, and which region that is (0: the table).

    A region rests on what most of its visible border is with, where it is higher than that; of several (the walls and
    the bottom of a sink), on the one with the longest border, at the height of them all.
    """
    supports: dict[int, tuple[float, int]] = {}
    kernel = np.ones((7, 7), np.uint8)
    for label in np.unique(labels[labels > 0]):
        mask = labels == label
        ring = (cv2.dilate(mask.astype(np.uint8), kernel) > 0) & ~mask
        occupied = ring & (labels > 0)
        supports[int(label)] = (0.0, 0)
        if np.count_nonzero(occupied) > 0.6 * np.count_nonzero(occupied | (ring & grid.bare)):
            neighbours, counts = np.unique(labels[occupied], return_counts=True)
            # The lower part: beside it may stand a wall.
            level = float(np.percentile(grid.height[occupied], 25))
            below = int(neighbours[counts.argmax()])
            middle, top = np.percentile(grid.height[mask], [50, 90])
            # A basin isn't on its rim, whose height it reaches; nor is the rim on the basin.
            higher = middle > level + 0.001 and top > level + 0.004
            if higher and np.count_nonzero(mask) < _outline_area(labels == below):
                supports[int(label)] = (level, below)
    return supports


def _outline_area(mask: BoolArray) -> float:
    """Cells within the convex outline of a region, what covers it included."""
    return float(cv2.contourArea(cv2.convexHull(np.argwhere(mask).astype(np.int32))))


def cut_segments(
    views: tuple[ViewPoints, ...], labels: Labels, supports: Mapping[int, tuple[float, int]], grid: HeightMap
) -> list[Segment]:
    """The points of every region, from all views, and its mask in each."""
    pixel_labels = []
    for view in views:
        rows, columns = grid.cells(view.points).T
        of_pixel = labels[rows, columns]
        # What is seen below a region that rests on another is the other's flank.
        for label, (level, below) in supports.items():
            if below:
                of_pixel[(of_pixel == label) & (view.points[:, 2] < level + 0.0015)] = below
        pixel_labels.append(of_pixel)
    all_points = np.concatenate([view.points for view in views])
    all_colours = np.concatenate([view.colours for view in views])
    all_labels = np.concatenate(pixel_labels)
    carriers = {below for _, below in supports.values() if below}
    segments = []
    for label, (level, _) in supports.items():
        if np.count_nonzero(labels == label) * grid.cell**2 < MIN_OBJECT_AREA:
            continue
        chosen = np.flatnonzero(all_labels == label)
        if len(chosen) < 20:
            continue
        chosen = chosen[:: max(1, len(chosen) // MAX_POINTS)]
        masks = {}
        for view, of_pixel in zip(views, pixel_labels, strict=True):
            mask = np.zeros(view.shape, bool)
            mask.ravel()[view.pixels[of_pixel == label]] = True
            masks[view.name] = mask
        spot = _free_spot(labels == label, grid) if label in carriers else None
        segments.append(Segment(all_points[chosen], all_colours[chosen], level, masks, spot))
    return segments


def _free_spot(free: BoolArray, grid: HeightMap) -> NDArray[np.float64]:
    """(2,) m, base frame: the point of a partly covered surface that is farthest from everything else."""
    level = np.median(grid.height[free])
    # Off the level of the surface is its rim.
    surface = free & (np.abs(grid.height - level) < 0.006)
    distance = cv2.distanceTransform(surface.astype(np.uint8), cv2.DIST_L2, 3)
    row, column = np.unravel_index(int(distance.argmax()), distance.shape)
    return grid.positions(np.asarray(row), np.asarray(column))
