"""Where an episode's objects start, off the benchmark's 24 layouts: anywhere in the area that these span, any yaw."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from ...geometry import FloatArray

APART = 0.13
"""m between the middles of two objects, at least; nearer only where the benchmark's own layouts have them nearer. No
two of its objects overlap at that distance, but for the tip of a spoon with the corner of a towel."""
_TRIES = 10_000
"""Draws until two objects are far enough apart; with the benchmark's layouts one in ten is."""


@dataclass(frozen=True)
class Start:
    """Poses from which the benchmark lets the object and its target settle; world frame."""

    positions: FloatArray
    """(2, 3) m: of the object, of the target."""
    quaternions: FloatArray
    """(2, 4), (w, x, y, z)."""


def draw_start(positions: FloatArray, quaternions: FloatArray, rng: np.random.Generator) -> Start:
    """Draw a start, given the benchmark's layouts of a task: (P, 2, 3) positions, m, and (Q, 2, 4) quaternions.

    Positions are uniform over the convex hulls of the layouts' positions, the two objects at least APART (in the
    plane), or as far apart as in the nearest layout. Each object has the attitude of one of the layouts, turned about
    the vertical by a uniform angle. What no layout ever moves (the eggplant's basket) stays where and as it is.
    """
    apart = min(APART, np.linalg.norm(positions[:, 0, :2] - positions[:, 1, :2], axis=1).min())
    areas = [_Area(positions[:, i]) for i in range(2)]
    attitude = quaternions[rng.integers(len(quaternions))]
    turned = np.stack([_turn(q, rng) if area.edges is not None else q for area, q in zip(areas, attitude, strict=True)])
    for _ in range(_TRIES):
        drawn = np.stack([area.draw(rng) for area in areas])
        if np.linalg.norm(drawn[0, :2] - drawn[1, :2]) >= apart:
            return Start(drawn, turned)
    raise ValueError(f"no two points of the layouts' areas were {apart:.3f} m apart in {_TRIES} draws")


class _Area:
    """The convex hull in the plane of where the layouts have an object; one point where they never move it."""

    def __init__(self, positions: FloatArray) -> None:
        """From (P, 3) positions."""
        self._low, self._high = positions.min(axis=0), positions.max(axis=0)
        plane = positions[:, :2].astype(float)
        moves = np.ptp(positions, axis=0).max() > 0
        self.edges: FloatArray | None = ConvexHull(plane).equations if moves else None
        """(E, 3) outward normal and offset of each edge; None for a point."""

    def draw(self, rng: np.random.Generator) -> FloatArray:
        """A point (3,), uniform over the area."""
        while True:
            point = rng.uniform(self._low, self._high)
            if self.edges is None or np.all(self.edges[:, :2] @ point[:2] + self.edges[:, 2] <= 1e-12):
                return point


def _turn(quaternion: FloatArray, rng: np.random.Generator) -> FloatArray:
    yaw = Rotation.from_euler("z", rng.uniform(-np.pi, np.pi))
    turned: FloatArray = (yaw * Rotation.from_quat(quaternion, scalar_first=True)).as_quat(scalar_first=True)
    return turned
