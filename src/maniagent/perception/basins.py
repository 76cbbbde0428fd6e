"""Hollows on the table: what would hold water is one vessel, bottom and walls."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from ..geometry import FloatArray
from ..types import BoolArray
from .heightmap import HeightMap

WATER_LEVELS = (0.008, 0.012, 0.016, 0.024, 0.036, 0.050)
"""m, heights up to which the table is flooded in thought to find vessels."""
MIN_BASIN = 5e-4
"""m^2; smaller hollows are dents."""


def find_basins(grid: HeightMap) -> tuple[NDArray[np.int32], FloatArray]:
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
