"""Which sequences may be kept: those that hold no number of the scene in which they were written.

A cached sequence is bound to other objects in other places. A coordinate or an angle in it is of use only where the
sub-task's own text says it; one that was read off the table is not. Offsets pass: they are what a skill is made of
(how high above, how far down), and one that was fitted to a scene fails elsewhere and is dropped.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable

from ...types import ActionSequence, PointAnchor

_NUMBER = re.compile(r"[-−]?\d+(?:\.\d+)?")
_UNITS = (1.0, 0.01, 0.001)
"""m, cm, mm, as metres."""
_ROUND = math.pi / 4
_SAME_LENGTH, _SAME_ANGLE = 5e-4, math.radians(0.5)


def has_fixed_point(sequence: ActionSequence) -> bool:
    """Whether a step goes to a point of the table rather than to an object."""
    return any(isinstance(step.anchor, PointAnchor) for step in sequence.steps)


def is_portable(sequence: ActionSequence, text: str) -> bool:
    """Whether every coordinate and every angle of a sequence is said in the sub-task's text, or is a round angle."""
    said = [float(number.replace("−", "-")) for number in _NUMBER.findall(text)]
    lengths = [number * unit for number in said for unit in _UNITS]
    angles = [*map(math.radians, said), *said]
    for step in sequence.steps:
        if isinstance(step.anchor, PointAnchor) and not (
            _among(step.anchor.x, lengths, _SAME_LENGTH) and _among(step.anchor.y, lengths, _SAME_LENGTH)
        ):
            return False
        yaw = step.orientation.yaw
        if abs(math.remainder(yaw, _ROUND)) > _SAME_ANGLE and not _among(abs(yaw), map(abs, angles), _SAME_ANGLE):
            return False
    return True


def _among(value: float, said: Iterable[float], tolerance: float) -> bool:
    return any(abs(value - number) <= tolerance for number in said)
