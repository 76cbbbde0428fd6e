"""From the flat steps that a model writes to an ActionSequence.

What a model gets wrong easily is worked out here: which object is in the gripper, and which way the gripper points.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from ...models.question import Unfit
from ...types import (
    ActionSequence,
    ActionStep,
    Gripper,
    HereAnchor,
    ObjectAnchor,
    Orientation,
    Part,
    PointAnchor,
)
from .answers import Heading, Written, WrittenStep

HIGHEST_DROP = 0.03
"""m above a place from which something held may be let go."""
_HEADINGS: Mapping[Heading, float] = {"right": 0.0, "away": math.pi / 2, "left": math.pi, "towards": -math.pi / 2}
"""rad, counter-clockwise from the viewer's right."""


def to_sequence(written: Written) -> ActionSequence:
    """The sequence that was meant. Raises Unfit, naming the step, where it can't be carried out as it stands."""
    held: int | None = None
    opened = False
    steps: list[ActionStep] = []
    for number, step in enumerate(written.steps, 1):
        where = f"Step {number} ({step.do})"
        if step.to == "grasp" and step.gripper == "close" and not opened:
            raise Unfit(f"{where} closes the fingers on the grasp, but no step before opens them above it.")
        if held is not None and step.gripper == "open" and step.up > HIGHEST_DROP:
            if _lets_go(written.steps[number:]):  # once more and lower: it wasn't meant to fall
                step = step.model_copy(update={"gripper": "keep"})
            elif step.to != "here":
                raise Unfit(f"{where} drops the object from {step.up:.2f} m. Lower it first.")
        steps.append(_to_step(step, held, where, first=number == 1))
        if step.gripper == "open":
            held, opened = None, True
        elif step.gripper == "close" and step.to == "grasp" and held is None:
            held = step.object
    return ActionSequence(skill=written.skill, steps=tuple(steps))


def _lets_go(steps: Sequence[WrittenStep]) -> bool:
    """Whether the fingers open low above a place in one of these steps, before any in which they close."""
    for step in steps:
        if step.gripper == "close":
            return False
        if step.gripper == "open" and step.to != "here" and step.up <= HIGHEST_DROP:
            return True
    return False


def _to_step(step: WrittenStep, held: int | None, where: str, *, first: bool) -> ActionStep:
    anchor = _anchor(step, where)
    return ActionStep(
        description=step.do,
        anchor=anchor,
        offset=(step.right, step.away, step.up),
        offset_frame="viewer",
        carrying=None if isinstance(anchor, HereAnchor) else held,
        orientation=_orientation(step, held, where, first=first),
        gripper=Gripper(step.gripper),
    )


def _anchor(step: WrittenStep, where: str) -> ObjectAnchor | PointAnchor | HereAnchor:
    if step.to == "here":
        return HereAnchor(here=True)
    if step.to == "point":
        if step.x is None or step.y is None:
            raise Unfit(f"{where} goes to a point and lacks its x or y.")
        return PointAnchor(x=step.x, y=step.y)
    if step.object is None:
        raise Unfit(f"{where} goes to the {step.to} of an object and doesn't say of which: give its index.")
    return ObjectAnchor(index=step.object, part=Part(step.to))


def _orientation(step: WrittenStep, held: int | None, where: str, *, first: bool) -> Orientation:
    if step.lie != "keep":
        if held is None:
            raise Unfit(f"{where} says how the object shall lie, but none is held there.")
        end = None if step.end is None else _HEADINGS[step.end]
        return Orientation(kind="align", yaw=_HEADINGS[step.lie], end=end)
    if step.turn:
        return Orientation(kind="turn", yaw=math.radians(step.turn))
    if step.to == "grasp" and held is None:
        return Orientation(kind="grasp", index=step.object)
    return Orientation(kind="top-down") if first else Orientation()
