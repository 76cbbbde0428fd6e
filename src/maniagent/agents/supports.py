"""What things lie on or in may be touched when they are picked up: a plate's bounding box is fuller than the plate.

Whether the fingers have room is known better: grasps are proposed where the depth image leaves it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from ..geometry import rotation_z
from ..types import KeyPoint, ObjectInfo


def allow_supports(keypoints: Sequence[KeyPoint], things: Sequence[ObjectInfo]) -> tuple[KeyPoint, ...]:
    """The key points; those at which the empty hand is to touch an object may touch what it lies on as well.

    `things` is everything on the table, by the indices that the key points use.
    """
    by_index = {thing.index: thing for thing in things}

    def allowed(point: KeyPoint) -> KeyPoint:
        touched = [by_index[i] for i in point.touches if i in by_index]
        below = frozenset(other for thing in touched for other in _supports(thing, things))
        return replace(point, touches=point.touches | below)

    return tuple(allowed(point) if point.held is None else point for point in keypoints)


def _supports(thing: ObjectInfo, others: Sequence[ObjectInfo]) -> Iterator[int]:
    """Indices of what the thing's middle is over and that is larger from above; a container's rim may be higher."""
    for other in others:
        local = rotation_z(-other.yaw)[:2, :2] @ (thing.centre[:2] - other.centre[:2])
        under = (np.abs(local) <= other.extent[:2] / 2).all()
        if other.index != thing.index and under and np.prod(other.extent[:2]) > np.prod(thing.extent[:2]):
            yield other.index
