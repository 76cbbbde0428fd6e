"""A robot that answers as another one did: it stands in for the recorded run's robot, and nothing moves."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence

from pydantic import TypeAdapter, ValidationError

from ..console.folder import OBSERVATIONS, look_name, picture_name
from ..errors import FailureStage, MotionRejected, StageFailure, UsageError
from ..perception.rig import Rig
from ..robots.robot import Boxes
from ..types import ExecutionReport, KeyPoint, Observation
from .looks import load_look
from .record import Json, RecordedRun

_ANSWERS = frozenset({"observed", "checked", "move", "homed", "executed"})


class EndOfRecord(Exception):
    """The robot is asked for something that is not in the record."""


class ReplayRobot:
    """A `Robot` made of a recorded run: it gives its answers in their order, and raises EndOfRecord after the last."""

    def __init__(self, run: RecordedRun) -> None:
        self._folder = run.folder
        self._answers = deque(event for event in run.events if event["kind"] in _ANSWERS)
        self._failures = {event["turn"]: event for event in reversed(run.events) if event["kind"] == "failed"}
        self._hooks: list[Callable[[str, float], None]] = []
        self._turn = 0
        self.rig: Rig = run.rig

    def observe(self) -> Observation:
        """What was seen on this turn, or why nothing was."""
        self._turn += 1
        if not (self._answers and self._answers[0]["kind"] == "observed" and self._answers[0]["turn"] == self._turn):
            failure = self._failures.get(self._turn)
            if failure is None:
                raise EndOfRecord
            raise _failure_of(failure)
        self._answers.popleft()
        pictures = self._folder / OBSERVATIONS
        return load_look(pictures / look_name(self._turn), lambda view: pictures / picture_name(self._turn, view))

    def check(self, keypoints: Sequence[KeyPoint], boxes: Boxes) -> None:
        """Refuse what was refused."""
        reason = str(self._next("checked")["reason"])
        if reason:
            raise MotionRejected(reason)

    def execute(self, keypoints: Sequence[KeyPoint], boxes: Boxes) -> ExecutionReport:
        """Announce what was announced, and report what was reported.

        The log tells of an execution after the way home that follows it, and with the way home's report where that
        failed: whoever asks for both comes to the same.
        """
        self._announce()
        told = next((event for event in self._answers if event["kind"] == "executed"), None)
        if told is None:
            raise EndOfRecord
        self._answers.remove(told)
        return _report(told)

    def go_home(self) -> ExecutionReport:
        """Likewise."""
        self._announce()
        return _report(self._next("homed"))

    def stop(self) -> None:
        """Nothing moves."""

    def on_move(self, hook: Callable[[str, float], None]) -> None:
        """Call `hook(description, seconds)` where a move began."""
        self._hooks.append(hook)

    def _announce(self) -> None:
        while self._answers and self._answers[0]["kind"] == "move":
            move = self._answers.popleft()
            for hook in self._hooks:
                hook(move["description"], move["seconds"])

    def _next(self, kind: str) -> Json:
        if not self._answers or self._answers[0]["kind"] != kind:
            raise EndOfRecord
        return self._answers.popleft()


def _failure_of(event: Json) -> StageFailure:
    """The failure with the recorded stage; no other class of it makes a difference before anything was seen."""
    failure = StageFailure(str(event["reason"]))
    try:
        failure.stage = FailureStage(event["stage"])
    except ValueError as error:
        raise UsageError(f"The log is damaged: turn {event['turn']} failed at {event['stage']!r}.") from error
    return failure


def _report(event: Json) -> ExecutionReport:
    try:
        return TypeAdapter(ExecutionReport).validate_python(event["report"])
    except ValidationError as error:
        raise UsageError(f"The log is damaged: a report of turn {event['turn']} is none.") from error
