"""Action sequences for the rules' commands: the same parameterised steps that a language model writes.

Three skills (ManiAgent, section III-D): pick-and-place, drag, rotate. Object 0 is the one that moves, object 1 the one
it is brought to. No number depends on where things are today.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ...errors import ReasoningFailure
from ...geometry import FloatArray
from ...perception.viewpoint import Viewpoint
from ...types import (
    ActionSequence,
    ActionStep,
    Gripper,
    HereAnchor,
    ObjectAnchor,
    ObjectInfo,
    Orientation,
    Part,
    PointAnchor,
    Subtask,
    SubtaskRecord,
)
from .commands import Action, Command, Direction, Relation
from .language import parse_instruction

HOVER = 0.10
"""m above an object from where the gripper comes down, and to which it goes up again."""
CARRY = 0.10
"""m above the place where a carried object is put down."""
SETTLE = 0.006
"""m above the surface at which a carried object is let go."""
INTO = -0.015
"""m below a container's rim to which the carried object's underside is lowered."""
PICK_UP_HEIGHT = 0.12
"""m."""
TURN_HEIGHT = 0.05
"""m above its place at which an object is turned."""

_DRAG = re.compile(r"\b(?:drag|pull|push|slide|shove)\b", re.IGNORECASE)
_SIDES = {
    Relation.LEFT_OF: Part.LEFT,
    Relation.RIGHT_OF: Part.RIGHT,
    Relation.IN_FRONT_OF: Part.NEAR,
    Relation.BEHIND: Part.FAR,
    Relation.NEXT_TO: Part.RIGHT,
}
_SIDE_NAMES = {Part.LEFT: "left of", Part.RIGHT: "right of", Part.NEAR: "in front of", Part.FAR: "behind"}
_DIRECTIONS: dict[Direction, tuple[float, float]] = {
    Direction.LEFT: (-1.0, 0.0),
    Direction.RIGHT: (1.0, 0.0),
    Direction.FORWARD: (0.0, 1.0),
    Direction.BACK: (0.0, -1.0),
}


class RulesControllerAgent:
    """Writes the sequence for a sub-task that `RulesReasoningAgent` named."""

    def write(self, subtask: Subtask, objects: Sequence[ObjectInfo], feedback: str = "") -> ActionSequence:
        """The sequence. Of the feedback the rules read one thing: "next to" on the right may be out of the workspace.

        Raises ReasoningFailure for a sub-task that is no command.
        """
        command = parse_instruction(subtask.text)[0]
        match command.action:
            case Action.PICK_UP:
                return ActionSequence(skill="pick-and-place", steps=(*_take(command), _rise("Lift it", PICK_UP_HEIGHT)))
            case Action.ROTATE:
                return _rotate(command)
            case Action.DRAG | Action.PUSH:
                return _drag(command)
            case Action.PLACE | Action.STACK:
                return _pick_and_place(command, feedback)

    def learn(self, record: SubtaskRecord) -> None:
        """Rules don't learn."""


def direction_of(command: Command, start: FloatArray, viewpoint: Viewpoint) -> FloatArray:
    """(2,) unit vector, base frame, in which a command moves an object at `start`; zero where it says no direction."""
    if command.point is not None:
        way = np.asarray(command.point) - start
    elif command.direction is not None:
        right, away = _DIRECTIONS[command.direction]
        way = right * viewpoint.right + away * viewpoint.away
    else:
        return np.zeros(2)
    return way / max(float(np.linalg.norm(way)), 1e-6)


def drag_direction(text: str, start: FloatArray, viewpoint: Viewpoint) -> FloatArray | None:
    """(2,) as of `direction_of` for a sub-task in anybody's words; None where it drags nothing.

    A sub-task that is no plain command drags where it has a word for that; in which direction isn't known.
    """
    try:
        command = parse_instruction(text)[0]
    except ReasoningFailure:
        return np.zeros(2) if _DRAG.search(text) else None
    return direction_of(command, start, viewpoint) if command.action in (Action.DRAG, Action.PUSH) else None


def _take(command: Command) -> tuple[ActionStep, ...]:
    grasp = ObjectAnchor(index=0, part=Part.GRASP)
    as_grasp = Orientation(kind="grasp", index=0)
    return (
        ActionStep(
            description=f"Go above the {command.object}, fingers open",
            anchor=grasp,
            offset=(0.0, 0.0, HOVER),
            orientation=as_grasp,
            gripper=Gripper.OPEN,
        ),
        ActionStep(
            description=f"Go down and take the {command.object}",
            anchor=grasp,
            orientation=as_grasp,
            gripper=Gripper.CLOSE,
        ),
    )


def _rise(description: str, height: float) -> ActionStep:
    return ActionStep(description=description, anchor=HereAnchor(here=True), offset=(0.0, 0.0, height))


def _pick_and_place(command: Command, feedback: str) -> ActionSequence:
    goal = _goal_of(command, prefer_left="outside the workspace" in feedback)
    above = (goal.offset[0], goal.offset[1], goal.offset[2] + CARRY)
    carry = ActionStep(
        description=f"Carry it {goal.where}",
        anchor=goal.anchor,
        offset=above,
        offset_frame=goal.offset_frame,
        carrying=0,
    )
    lower = carry.model_copy(
        update={"description": "Lower it and let go", "offset": goal.offset, "gripper": Gripper.OPEN}
    )
    steps = (*_take(command), _rise("Lift it", HOVER), carry, lower, _rise("Come up", CARRY))
    return ActionSequence(skill="pick-and-place", steps=steps)


def _drag(command: Command) -> ActionSequence:
    """Slide the object over the table: at the height at which it was taken, down to the table again, let go."""
    goal = _goal_of(command)
    slide = ActionStep(
        description=f"Drag it {goal.where}",
        anchor=goal.anchor,
        offset=(goal.offset[0], goal.offset[1], 0.0),
        offset_frame=goal.offset_frame,
        carrying=0,
        gripper=Gripper.OPEN,
    )
    return ActionSequence(skill="drag", steps=(*_take(command), slide, _rise("Come up", HOVER)))


def _rotate(command: Command) -> ActionSequence:
    """Lift the object a little, turn it, and put it back where it was."""
    turn = ActionStep(
        description=f"Turn it by {math.degrees(command.angle or 0.0):.0f} degrees",
        anchor=ObjectAnchor(index=0, part=Part.BASE),
        offset=(0.0, 0.0, TURN_HEIGHT),
        carrying=0,
        orientation=Orientation(kind="turn", yaw=command.angle or 0.0),
    )
    lower = ActionStep(
        description="Put it back",
        anchor=ObjectAnchor(index=0, part=Part.BASE),
        offset=(0.0, 0.0, SETTLE),
        carrying=0,
        gripper=Gripper.OPEN,
    )
    steps = (*_take(command), _rise("Lift it", TURN_HEIGHT), turn, lower, _rise("Come up", HOVER))
    return ActionSequence(skill="rotate", steps=steps)


@dataclass(frozen=True)
class _Goal:
    """Where object 0 is brought to, as the anchor and offset of the step that lets it go."""

    anchor: ObjectAnchor | PointAnchor
    where: str
    offset: tuple[float, float, float] = (0.0, 0.0, SETTLE)
    offset_frame: Literal["base", "viewer"] = "base"


def _goal_of(command: Command, *, prefer_left: bool = False) -> _Goal:
    if command.point is not None:
        x, y = command.point
        return _Goal(PointAnchor(x=x, y=y), f"to ({x:.2f}, {y:.2f})")
    if command.direction is not None and command.distance is not None:
        right, away = _DIRECTIONS[command.direction]
        offset = (right * command.distance, away * command.distance, SETTLE)
        return _Goal(ObjectAnchor(index=0, part=Part.BASE), str(command.direction), offset, "viewer")
    if command.relation is Relation.IN:
        return _Goal(ObjectAnchor(index=1, part=Part.TOP), f"over the {command.target}", (0.0, 0.0, INTO))
    if command.relation is Relation.ON:
        return _Goal(ObjectAnchor(index=1, part=Part.FREE), f"above the {command.target}")
    side = Part.LEFT if prefer_left and command.relation is Relation.NEXT_TO else _SIDES[_relation(command)]
    return _Goal(ObjectAnchor(index=1, part=side), f"{_SIDE_NAMES[side]} the {command.target}")


def _relation(command: Command) -> Relation:
    if command.relation is None:
        raise ReasoningFailure(f"{str(command)!r} says no place to go to.")
    return command.relation
