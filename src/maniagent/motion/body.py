"""Which points of a cloud lie on the robot itself."""

from __future__ import annotations

import mujoco
import numpy as np

from ..geometry import FloatArray
from ..types import BoolArray


class ArmBody:
    """The primitives (looks and collision shapes alike) that make up the arm."""

    def __init__(self, model: mujoco.MjModel) -> None:
        self._model = model
        self._geoms_of_body = [
            np.flatnonzero(model.geom_bodyid == body) for body in range(model.nbody) if model.body_geomnum[body]
        ]

    def covers(self, data: mujoco.MjData, points: FloatArray, margin: float) -> BoolArray:
        """Which of the (N, 3) base-frame points are within `margin` (m) of a primitive, posed as in `data`.

        Bounds first: a point is tested against a primitive only when it is in the axis-aligned box of the whole
        arm, and of the link that the primitive belongs to.
        """
        covered = np.zeros(len(points), dtype=bool)
        low, high = self._bounds(data, margin)
        near = _inside(points, low.min(axis=0), high.max(axis=0))
        candidates = points[near]
        hit = np.zeros(len(candidates), dtype=bool)
        for geoms in self._geoms_of_body:
            at_link = _inside(candidates, low[geoms].min(axis=0), high[geoms].max(axis=0))
            at_link = at_link[~hit[at_link]]
            for geom in geoms:
                local = (candidates[at_link] - data.geom_xpos[geom]) @ data.geom_xmat[geom].reshape(3, 3)
                distance = _signed_distance(self._model.geom_type[geom], self._model.geom_size[geom], local)
                touched = distance <= margin
                hit[at_link[touched]] = True
                at_link = at_link[~touched]
        covered[near[hit]] = True
        return covered

    def _bounds(self, data: mujoco.MjData, margin: float) -> tuple[FloatArray, FloatArray]:
        """Corners (n_geoms, 3) of every primitive's axis-aligned box in the base frame, grown by `margin`."""
        rotation = data.geom_xmat.reshape(-1, 3, 3)
        centre = data.geom_xpos + np.einsum("nij,nj->ni", rotation, self._model.geom_aabb[:, :3])
        half = np.einsum("nij,nj->ni", np.abs(rotation), self._model.geom_aabb[:, 3:]) + margin
        return centre - half, centre + half


def _inside(points: FloatArray, low: FloatArray, high: FloatArray) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
    """Indices of the points in an axis-aligned box; each axis looks only at what the one before left over."""
    kept = np.flatnonzero((points[:, 0] >= low[0]) & (points[:, 0] <= high[0]))
    for axis in (1, 2):
        values = points[kept, axis]
        kept = kept[(values >= low[axis]) & (values <= high[axis])]
    return kept


def _signed_distance(kind: int, size: FloatArray, points: FloatArray) -> FloatArray:
    """Distance (N,) of points (N, 3) in a primitive's own frame to its surface; negative inside.

    Raises ValueError for a shape the arm's MJCF doesn't use.
    """
    match mujoco.mjtGeom(kind):
        case mujoco.mjtGeom.mjGEOM_BOX:
            return _outside_and_in(np.abs(points) - size)
        case mujoco.mjtGeom.mjGEOM_CYLINDER:
            radial = np.hypot(points[:, 0], points[:, 1]) - size[0]
            return _outside_and_in(np.stack([radial, np.abs(points[:, 2]) - size[1]], axis=1))
        case mujoco.mjtGeom.mjGEOM_CAPSULE:
            past_end = np.maximum(np.abs(points[:, 2]) - size[1], 0.0)
            return np.sqrt(points[:, 0] ** 2 + points[:, 1] ** 2 + past_end**2) - size[0]
        case other:
            raise ValueError(f"the arm's body is made of boxes, cylinders and capsules, not {other.name}")


def _outside_and_in(excess: FloatArray) -> FloatArray:
    """Signed distance from how far a point lies beyond each face (N, k)."""
    outside = np.linalg.norm(np.maximum(excess, 0.0), axis=1)
    return outside + np.minimum(excess.max(axis=1), 0.0)
