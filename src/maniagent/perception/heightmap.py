"""The table seen straight from above: one grid of heights and colours, fused from all views.

Objects on a table differ first of all from above, and a gripper that comes from above meets exactly this surface:
both segmentation and grasp checks work on it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from ..types import BoolArray
from .views import ViewPoints, Workspace

MIN_ISLAND = 6
"""Cells; smaller islands are noise."""
LIGHTNESS_WEIGHT = 0.4
"""How much lightness counts beside the two colour axes: a round object is dark on one side and still one object."""


@dataclass(frozen=True)
class HeightMap:
    """Cells are indexed [row, column] = [x, y]; row 0 is at the lowest x, column 0 at the lowest y."""

    origin: tuple[float, float]
    """(x, y) m, base frame, of the corner of cell [0, 0]."""
    cell: float
    """m, side of a cell."""
    height: NDArray[np.float32]
    """(X, Y) m above the table; 0 where nothing stands."""
    rgb: NDArray[np.uint8]
    """(X, Y, 3) colour of the topmost surface; 0 where nothing stands."""
    occupied: BoolArray
    """(X, Y), True where something stands."""
    bare: BoolArray
    """(X, Y), True where the bare table is seen. What is neither is hidden."""

    def cells(self, points: NDArray[np.floating]) -> NDArray[np.intp]:
        """Rows and columns (..., 2) of points (..., 2 or 3), clipped to the grid."""
        # Truncation differs from floor only off the grid, where clipping makes up for it.
        index = ((points[..., :2] - self.origin) / self.cell).astype(np.intp)
        return np.clip(index, 0, np.subtract(self.height.shape, 1))

    def positions(self, rows: NDArray[np.intp], columns: NDArray[np.intp]) -> NDArray[np.float64]:
        """(..., 2) m, base frame: centres of these cells."""
        return (np.stack([rows, columns], axis=-1) + 0.5) * self.cell + np.asarray(self.origin)

    @cached_property
    def lab(self) -> NDArray[np.float32]:
        """(X, Y, 3) CIE Lab (8-bit scale), lightly smoothed inside what is occupied, lightness scaled down."""
        weight = np.maximum(cv2.blur(self.occupied.astype(np.float32), (3, 3)), 1e-6)
        inside = np.where(self.occupied[..., None], self.rgb, 0).astype(np.float32)
        rgb = cv2.blur(inside, (3, 3)) / weight[..., None]
        lab = cv2.cvtColor(np.clip(rgb, 0, 255).astype(np.uint8), cv2.COLOR_RGB2LAB).astype(np.float32)
        lab[..., 0] *= LIGHTNESS_WEIGHT
        return lab


def build_height_map(
    views: Sequence[ViewPoints], workspace: Workspace, cell: float = 0.002, *, trust_bare: bool = False
) -> HeightMap:
    """Fuse the foreground of all views; gaps of a few cells are closed from their neighbours.

    With `trust_bare` a gap through which the table is seen is none: two things side by side.
    """
    origin = (workspace.x[0], workspace.y[0])
    shape = (
        round((workspace.x[1] - workspace.x[0]) / cell),
        round((workspace.y[1] - workspace.y[0]) / cell),
    )
    height = np.zeros(shape, np.float32)
    rgb = np.zeros((*shape, 3), np.uint8)
    occupied, bare = np.zeros(shape, bool), np.zeros(shape, bool)
    if views and sum(len(view.points) for view in views):
        points = np.concatenate([view.points for view in views])
        colours = np.concatenate([view.colours for view in views])
        index = ((points[:, :2] - np.array(origin, np.float32)) / np.float32(cell)).astype(np.int32)
        np.clip(index, 0, np.array(shape, np.int32) - 1, out=index)
        flat = index[:, 0] * shape[1] + index[:, 1]
        heights = np.maximum(points[:, 2], np.float32(0))
        np.maximum.at(height.reshape(-1), flat, heights)
        topmost = heights == height.reshape(-1)[flat]
        rgb.reshape(-1, 3)[flat[topmost]] = colours[topmost]
        occupied.reshape(-1)[flat] = True
    for view in views:
        index = ((view.bare - origin) / np.float32(cell)).astype(np.int32)
        bare[np.clip(index[:, 0], 0, shape[0] - 1), np.clip(index[:, 1], 0, shape[1] - 1)] = True
    return _close_gaps(HeightMap(origin, cell, height, rgb, occupied, bare & ~occupied), trust_bare)


def _close_gaps(grid: HeightMap, trust_bare: bool) -> HeightMap:
    grid = _without_specks(grid)
    window = (5, 5)
    closed = cv2.morphologyEx(grid.occupied.astype(np.uint8), cv2.MORPH_CLOSE, np.ones(window, np.uint8)) > 0
    if trust_bare:
        closed &= ~grid.bare
    gaps = closed & ~grid.occupied
    weight = cv2.blur(grid.occupied.astype(np.float32), window)
    scale = 1.0 / np.maximum(weight, 1e-6)
    height, rgb = grid.height.copy(), grid.rgb.copy()
    height[gaps] = (cv2.blur(grid.height, window) * scale)[gaps]
    rgb[gaps] = np.clip(cv2.blur(grid.rgb.astype(np.float32), window) * scale[..., None], 0, 255)[gaps]
    bare = cv2.dilate(grid.bare.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0  # the sample leaves cells out
    # One pixel's noise mustn't make a peak of the topmost surface.
    smooth = np.where(closed, cv2.medianBlur(height, 3), np.float32(0))
    return HeightMap(grid.origin, grid.cell, smooth, rgb, closed, bare & ~closed)


def _without_specks(grid: HeightMap) -> HeightMap:
    """The map without islands of a few cells: single wrong pixels at the edges of things."""
    _, islands, stats, _ = cv2.connectedComponentsWithStats(grid.occupied.astype(np.uint8), connectivity=8)
    large = stats[:, cv2.CC_STAT_AREA] >= MIN_ISLAND
    large[0] = False
    kept = large[islands]
    return HeightMap(grid.origin, grid.cell, np.where(kept, grid.height, np.float32(0)), grid.rgb, kept, grid.bare)
