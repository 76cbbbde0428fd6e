"""A plain command: the only thing the rules can carry out, and its canonical English."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass


class Action(enum.StrEnum):
    """What is done to the object; the value is the verb in canonical text."""

    PLACE = "put"
    STACK = "stack"
    PICK_UP = "pick up"
    DRAG = "drag"
    PUSH = "push"
    ROTATE = "rotate"


class Relation(enum.StrEnum):
    """Where the object is to go; the value is the preposition in canonical text."""

    ON = "on"
    IN = "in"
    NEXT_TO = "next to"
    LEFT_OF = "left of"
    RIGHT_OF = "right of"
    IN_FRONT_OF = "in front of"
    BEHIND = "behind"
    AT = "at"
    """At `point`."""
    TOWARDS = "towards"
    """By `distance` in `direction` from where it is."""


class Direction(enum.StrEnum):
    """As seen by the viewer, that is, in the main view."""

    LEFT = "left"
    RIGHT = "right"
    FORWARD = "forward"
    """Away from the viewer."""
    BACK = "back"
    """Towards the viewer."""


@dataclass(frozen=True, kw_only=True)
class Command:
    """One imperative. `str(command)` is English that parses to the same command.

    Raises ValueError where fields are missing or don't go together.
    """

    action: Action
    object: str
    """Noun phrase without its article: "pepper in the middle", "block that is left of the plate", "any block"."""
    relation: Relation | None = None
    """None for PICK_UP and ROTATE."""
    target: str | None = None
    """Noun phrase; given for every relation but AT and TOWARDS."""
    point: tuple[float, float] | None = None
    """(x, y) m, base frame; given for AT."""
    angle: float | None = None
    """rad, counter-clockwise seen from above; given for ROTATE."""
    direction: Direction | None = None
    """Given for TOWARDS."""
    distance: float | None = None
    """m, positive; given for TOWARDS."""

    def __post_init__(self) -> None:
        rotates, moves = self.action is Action.ROTATE, self.action not in (Action.ROTATE, Action.PICK_UP)
        towards = self.relation is Relation.TOWARDS
        beside = self.relation not in (None, Relation.AT, Relation.TOWARDS)
        given_as_wanted = {
            "object": bool(self.object),
            "relation": (self.relation is not None) == moves,
            "target": bool(self.target) == beside,
            "point": (self.point is not None) == (self.relation is Relation.AT),
            "angle": (self.angle is not None) == rotates,
            "direction": (self.direction is not None) == towards,
            "distance": (self.distance is not None and self.distance > 0) == towards,
            "relation of a stack": self.action is not Action.STACK or self.relation is Relation.ON,
        }
        wrong = [name for name, right in given_as_wanted.items() if not right]
        if wrong:
            raise ValueError(f"a command to {self.action} with relation {self.relation} has a bad {', '.join(wrong)}")

    def __str__(self) -> str:
        words = [self.action.value, _with_article(self.object)]
        if self.angle is not None:
            sense = "clockwise" if self.angle < 0 else "counterclockwise"
            words.append(f"by {_plain(abs(math.degrees(self.angle)))} degrees {sense}")
        elif self.direction is not None and self.distance is not None:
            words.append(f"{self.direction} by {_plain(self.distance)} m")
        elif self.point is not None:
            preposition = "to" if self.action in (Action.DRAG, Action.PUSH) else "at"
            words.append(f"{preposition} ({_plain(self.point[0])}, {_plain(self.point[1])})")
        elif self.relation is not None and self.target is not None:
            words += [self.relation.value, _with_article(self.target)]
        return " ".join(words)


def _with_article(noun_phrase: str) -> str:
    return noun_phrase if noun_phrase.startswith("any ") else f"the {noun_phrase}"


def _plain(value: float) -> str:
    """`value` to six decimals, without exponent, trailing zeros or a negative zero."""
    text = f"{value:.6f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text
