"""One object's worth of RGB-D points, and the plain measurements every later step uses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from ..geometry import FloatArray, wrap_angle
from ..types import BoolArray, GraspPose, ObjectInfo

ROUND_FILL, ROUND_RATIO = 0.85, 1.1
"""A footprint is round where its hull fills less of its rectangle (a disc fills 0.79, an octagon 0.83), and length
and width differ less."""


@dataclass(frozen=True)
class _Footprint:
    """The smallest rectangle around an object seen from above."""

    centre: FloatArray
    length: float
    width: float
    yaw: float


@dataclass(frozen=True)
class Segment:
    """A thing on the table, seen by one or more cameras, not yet named."""

    points: NDArray[np.float32]
    """(N, 3) m, base frame, fused over all views."""
    colours: NDArray[np.uint8]
    """(N, 3) RGB, row by row with `points`."""
    support_z: float = 0.0
    """m, base frame: height of what the object stands on; cameras above never see an underside."""
    masks: Mapping[str, BoolArray] = field(default_factory=dict)
    """By view: (H, W), True where the object is seen."""
    free_spot: FloatArray | None = None
    """(2,) m, base frame: the middle of what is free of its upper side; None where nothing lies on it."""

    @cached_property
    def _footprint(self) -> _Footprint:
        xy = self.points[:, :2].astype(np.float32)
        found = _rectangle(xy, float(np.radians(cv2.minAreaRect(xy)[2])))
        area = float(cv2.contourArea(cv2.convexHull(xy)))
        # Which way a disc's smallest rectangle lies is chance, and its corners are not the disc's.
        is_round = found.length < ROUND_RATIO * found.width and area < ROUND_FILL * found.length * found.width
        return _rectangle(xy, 0.0) if is_round else found

    @cached_property
    def top_z(self) -> float:
        """Height of the highest point (99th percentile), m."""
        return float(np.percentile(self.points[:, 2], 99.0))

    @property
    def yaw(self) -> float:
        """Direction of the longer horizontal side, rad in (-pi/2, pi/2]; along or across base x for a round thing."""
        return self._footprint.yaw

    @cached_property
    def extent(self) -> FloatArray:
        """(3,) m, full lengths: longer horizontal side, shorter horizontal side, height."""
        return np.array([self._footprint.length, self._footprint.width, max(self.top_z - self.support_z, 1e-3)])

    @cached_property
    def centre(self) -> FloatArray:
        """(3,) m, base frame: middle of the bounding box."""
        return np.array([*self._footprint.centre, (self.top_z + self.support_z) / 2])

    @cached_property
    def surface_z(self) -> float:
        """Height (m, base frame) at the object's middle, where a thing put onto it comes to rest."""
        near = np.linalg.norm(self.points[:, :2] - self._footprint.centre, axis=1) < max(
            0.2 * self._footprint.width, 4e-3
        )
        return float(np.median(self.points[near, 2])) if near.any() else self.top_z

    @cached_property
    def colour(self) -> tuple[int, int, int]:
        """Median RGB."""
        red, green, blue = np.median(self.colours, axis=0)
        return int(red), int(green), int(blue)

    def to_object(self, index: int, name: str, grasps: tuple[GraspPose, ...] = ()) -> ObjectInfo:
        """The segment as a named, numbered object."""
        return ObjectInfo(
            index, name, self.centre, self.extent, self.yaw, self.surface_z, self.colour, grasps, self.free_spot
        )


def _rectangle(xy: NDArray[np.float32], yaw: float) -> _Footprint:
    """The rectangle, one side of which points along `yaw`, around points (N, 2).

    Its sides are cut a little inside the extremes: one stray depth pixel mustn't stretch it.
    """
    axes = np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]])  # rows: along, across
    low, high = np.percentile(xy @ axes.T, [0.2, 99.8], axis=0)
    length, width = map(float, high - low)
    centre = (low + high) / 2 @ axes
    if width > length:
        length, width, yaw = width, length, yaw + np.pi / 2
    return _Footprint(centre, length, width, wrap_angle(yaw, np.pi))
