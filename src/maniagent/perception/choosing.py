"""Which of several alikes is meant: by what lies where, in the viewer's eyes, and by size.

Every choice has a margin: where the first is not clearly ahead of the second, none is chosen.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..geometry import FloatArray, rotation_z
from .phrases import Pick, Where
from .referring import Size
from .segments import Segment
from .viewpoint import Viewpoint

CLEAR_DISTANCE = 0.01
"""m by which a thing must be further left (nearer, ...) than the next to count as the leftmost."""
CLEAR_RATIO = 1.12
"""By which a thing must be larger than the next to count as the largest."""
BESIDE = 0.08
"""m between the outline of a thing and the middle of another that lies next to it."""
MIDDLE_SHARE = 0.15
"""Share of a row's length by which the middle one must keep from its neighbours."""

_MEASURES: dict[Size, Callable[[Segment], float]] = {
    Size.LARGEST: lambda s: float(np.cbrt(np.prod(s.extent))),
    Size.SMALLEST: lambda s: -float(np.cbrt(np.prod(s.extent))),
    Size.LONGEST: lambda s: float(s.extent[0]),
    Size.SHORTEST: lambda s: -float(s.extent[0]),
    Size.TALLEST: lambda s: float(s.extent[2]),
    Size.FLATTEST: lambda s: -float(s.extent[2]),
}


def by_size(segments: Sequence[Segment], among: Sequence[int], size: Size) -> list[int]:
    """The one of that size, or all of `among` where it is not clear which."""
    measure = _MEASURES[size]
    order = sorted(among, key=lambda i: -measure(segments[i]))
    if len(order) < 2:
        return order
    first, second = sorted(abs(measure(segments[i])) for i in order[:2])
    return order[:1] if second > CLEAR_RATIO * first else list(among)


def by_position(
    segments: Sequence[Segment], among: Sequence[int], viewpoint: Viewpoint, pick: Pick, ordinal: int | None = None
) -> list[int]:
    """The one at that place (the `ordinal`-th from there), or all of `among` where it is not clear which.

    The empty list where fewer than `ordinal` are there.
    """
    if len(among) < 2 and ordinal in (None, 1):
        return list(among)
    if pick is Pick.MIDDLE:
        return _middle(segments, among)
    axis = {
        Pick.LEFT: viewpoint.right,
        Pick.RIGHT: -viewpoint.right,
        Pick.NEAR: viewpoint.away,
        Pick.FAR: -viewpoint.away,
    }[pick]
    along = {i: float(segments[i].centre[:2] @ axis) for i in among}
    order = sorted(among, key=along.__getitem__)
    rank = (ordinal or 1) - 1
    if rank >= len(order):
        return []
    neighbours = order[max(rank - 1, 0) : rank] + order[rank + 1 : rank + 2]
    clear = all(abs(along[i] - along[order[rank]]) >= CLEAR_DISTANCE for i in neighbours)
    return [order[rank]] if clear else list(among)


def _middle(segments: Sequence[Segment], among: Sequence[int]) -> list[int]:
    """The middle one of an odd number, along the direction in which they lie apart most."""
    if len(among) % 2 == 0:
        return list(among)
    places = np.array([segments[i].centre[:2] for i in among])
    row = np.linalg.svd(places - places.mean(axis=0))[2][0]
    along = places @ row
    order = np.argsort(along)
    half = len(among) // 2
    gaps = np.diff(along[order])[half - 1 : half + 1]
    clear = gaps.min() >= max(MIDDLE_SHARE * np.ptp(along), CLEAR_DISTANCE)
    return [among[int(order[half])]] if clear else list(among)


def by_relation(
    segments: Sequence[Segment], among: Sequence[int], viewpoint: Viewpoint, where: Where, landmark: int | None
) -> list[int]:
    """Those of `among` that lie so relative to the landmark; without one, relative to the table.

    For CLOSEST and FARTHEST the one, or all where it is not clear which.
    """
    if landmark is None:
        return [i for i in among if not any(_lies_within(segments[i], other) for other in segments)]
    mark = segments[landmark]
    others = [i for i in among if i != landmark]
    if where in (Where.CLOSEST, Where.FARTHEST):
        sign = 1.0 if where is Where.CLOSEST else -1.0
        distance = {i: sign * float(np.linalg.norm(segments[i].centre[:2] - mark.centre[:2])) for i in others}
        order = sorted(others, key=distance.__getitem__)
        clear = len(order) < 2 or distance[order[1]] - distance[order[0]] >= CLEAR_DISTANCE
        return order[:1] if clear else others
    if where in (Where.ON, Where.IN):
        return [i for i in others if _lies_within(segments[i], mark)]
    if where is Where.NEXT_TO:
        return [i for i in others if _gap(segments[i], mark) <= BESIDE and not _lies_within(segments[i], mark)]
    towards = {
        Where.LEFT_OF: -viewpoint.right,
        Where.RIGHT_OF: viewpoint.right,
        Where.IN_FRONT_OF: -viewpoint.away,
        Where.BEHIND: viewpoint.away,
    }[where]
    return [i for i in others if _lies_towards(segments[i], mark, towards)]


def _offset(segment: Segment, landmark: Segment) -> FloatArray:
    """(2,) from the landmark's middle, along and across its own sides."""
    return (segment.centre[:2] - landmark.centre[:2]) @ rotation_z(landmark.yaw)[:2, :2]


def _lies_within(segment: Segment, landmark: Segment) -> bool:
    """Over the footprint of something larger."""
    if segment is landmark or np.prod(segment.extent[:2]) >= np.prod(landmark.extent[:2]):
        return False
    return bool((np.abs(_offset(segment, landmark)) <= landmark.extent[:2] / 2).all())


def _gap(segment: Segment, landmark: Segment) -> float:
    """From the landmark's outline to the segment's outline, m; the latter taken as a disc of its width."""
    beyond = np.maximum(np.abs(_offset(segment, landmark)) - landmark.extent[:2] / 2, 0)
    return float(np.linalg.norm(beyond) - segment.extent[1] / 2)


def _lies_towards(segment: Segment, landmark: Segment, direction: FloatArray) -> bool:
    """Within 45 degrees of `direction` (2,), seen from the landmark, and not on it."""
    offset = segment.centre[:2] - landmark.centre[:2]
    ahead = float(offset @ direction)
    aside = abs(float(offset @ np.array([-direction[1], direction[0]])))
    return ahead >= aside and ahead > 0 and not _lies_within(segment, landmark)
