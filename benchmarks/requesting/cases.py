"""What is asked for: sub-tasks of every kind that the controller is told of, on the scenes of the tasks."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import cycle, islice


@dataclass(frozen=True)
class Case:
    """A task's scene, and what is wanted there."""

    task: str
    kind: str
    """Of sub-task: on, into, stack, beside, drag to, drag by, rotate, alikes."""
    commands: tuple[str, ...]
    """Sub-tasks that are right as the next one, in words that the rules know too; the first is the rule-made one.
    "{goal}" is the point that the task draws."""
    instruction: str = ""
    """What the person says; the first command where empty."""


@dataclass(frozen=True)
class Request:
    """A case on one layout of its scene."""

    number: int
    """From 0; also the layout's seed, so that no two requests share a scene."""
    case: Case

    @property
    def name(self) -> str:
        """For people."""
        return f"{self.number} {self.case.task} ({self.case.kind})"


CASES = (
    Case("pepper-on-plate", "on", ("put the red pepper on the plate",)),
    Case("drag-plate", "drag to", ("drag the plate to {goal}",)),
    Case("stack-yellow-on-blue", "stack", ("stack the yellow block on the blue block",)),
    Case("middle-pepper", "alikes", ("put the pepper in the middle on the plate",)),
    Case("eggplant-in-basket", "into", ("put the eggplant in the basket",)),
    Case("lay-the-table", "beside", ("put the fork left of the plate",)),
    Case("spoon-on-towel", "rotate", ("rotate the spoon by 90 degrees",)),
    Case("hungry", "on", ("put the banana on the plate",), "I am hungry"),
    Case("drag-plate", "drag by", ("drag the plate to the right by 8 cm",)),
    Case("stack-yellow-on-blue", "beside", ("put the red block in front of the blue block",)),
    Case(
        "menemen",
        "on",
        ("put the egg on the plate", "put the green pepper on the plate"),
        "put the ingredients needed for Menemen onto the plate",
    ),
    Case("middle-pepper", "alikes", ("put the leftmost pepper on the plate",)),
    Case("carrot-on-plate", "rotate", ("rotate the carrot by 45 degrees clockwise",)),
    Case("write", "into", ("put the marker in the hand",), "I need to write something"),
    Case("green-on-yellow", "stack", ("stack the green block on the yellow block",)),
    Case(
        "lay-the-table",
        "beside",
        ("put the fork left of the plate", "put the knife right of the plate"),
        "lay the knife and the fork beside the plate by Western table etiquette",
    ),
    Case("carrot-on-plate", "drag by", ("push the plate to the left by 6 cm",)),
    Case("spoon-on-towel", "on", ("put the spoon on the towel",)),
    Case("green-on-yellow", "drag to", ("drag the green block to (0.30, 0.05)",)),
    Case("eggplant-in-basket", "beside", ("put the eggplant right of the basket",)),
)


def requests(count: int) -> Iterator[Request]:
    """The first `count` requests: the cases in turn, each time on a new layout."""
    return (Request(number, case) for number, case in enumerate(islice(cycle(CASES), count)))
