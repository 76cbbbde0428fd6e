"""Where an episode's objects start, off the benchmark's 24 layouts: anywhere in the area that these span, any yaw."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from ...geometry import FloatArray

_TRIES = 10_000
"""Draws until two objects are far enough apart; with the benchmark's layouts one in forty is."""


@dataclass(frozen=True)
class Start:
    """Poses from which the benchmark lets the object and its target settle; world frame."""

    positions: FloatArray
    """(2, 3) m: of the object, of the target."""
    quaternions: FloatArray
    """(2, 4), (w, x, y, z)."""


def draw_start(positions: FloatArray, quaternions: FloatArray, rng: np.random.Generator) -> Start:
    """Draw a start, given the benchmark's layouts of a task: (P, 2, 3) positions, m, and (Q, 2, 4) quaternions.

    Positions are uniform over the convex hulls of the layouts' positions, the two objects at least as far apart (in
    the plane) as in the nearest layout. Each object has the attitude of one of the layouts, turned about the vertical
    by a uniform angle. What no layout ever moves (the eggplant's basket) stays where and as it is.
    """
    apart = np.linalg.norm(positions[:, 0, :2] - positions[:, 1, :2], axis=1).min()
    attitude = quaternions[rng.integers(len(quaternions))]
    turned = np.stack([_turn(q, rng) if _moves(positions[:, i]) else q for i, q in enumerate(attitude)])
    for _ in range(_TRIES):
        drawn = np.stack([_point_within(positions[:, i], rng) for i in range(2)])
        if np.linalg.norm(drawn[0, :2] - drawn[1, :2]) >= apart:
            return Start(drawn, turned)
    raise ValueError(f"no two points of the layouts' areas were {apart:.3f} m apart in {_TRIES} draws")


def _moves(positions: FloatArray) -> bool:
    return bool(np.ptp(positions, axis=0).max() > 0)


def _point_within(positions: FloatArray, rng: np.random.Generator) -> FloatArray:
    """A point (3,) uniform over the convex hull of positions (P, 3) in the plane, at their mean height."""
    if not _moves(positions):
        return positions[0].copy()
    plane = positions[:, :2].astype(float)
    edges = ConvexHull(plane).equations  # outward normal and offset of each edge
    low, high = plane.min(axis=0), plane.max(axis=0)
    while True:
        point = rng.uniform(low, high)
        if np.all(edges[:, :2] @ point + edges[:, 2] <= 1e-12):
            return np.array([*point, positions[:, 2].mean()])


def _turn(quaternion: FloatArray, rng: np.random.Generator) -> FloatArray:
    yaw = Rotation.from_euler("z", rng.uniform(-np.pi, np.pi))
    turned: FloatArray = (yaw * Rotation.from_quat(quaternion, scalar_first=True)).as_quat(scalar_first=True)
    return turned
