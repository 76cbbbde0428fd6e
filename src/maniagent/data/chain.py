"""The chain of one demonstration: bring the object to its start, carry out the task, measure, label.

The same robot does both, so that no hand touches the scene (ManiAgent, section on automatic data collection).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ..agents.events import EventLog
from ..agents.loop import AgentLoop, Budget
from ..errors import CameraFailure, FailureStage, ManiAgentError, StageFailure
from ..robots.sampling import RecordableRobot, Sampling
from ..types import ObjectInfo, RunResult, RunVerdict
from .episode import Label, Recording
from .moves import KnownMoves, Move, move_to, moves_of
from .outcome import THRESHOLD, Outcomes
from .recording import EpisodeRecorder, RecorderSettings
from .starts import Start

DOUBT = 0.005
"""m either side of the threshold within which perception doesn't decide."""

_TURNS = 1000
"""More than any list of moves takes: a move that fails too often ends the run by itself."""


class Stuck(ManiAgentError):
    """The robot can't go on by itself: a person has to put the object back."""


@dataclass(frozen=True)
class Attempt:
    """What came of carrying out the task once."""

    label: Label
    reason: str
    distance: float | None
    """m from its place, the farthest of the objects that were moved; None where one isn't seen."""
    recording: Recording | None
    """None where nothing could be recorded."""
    began: tuple[float, float] | None = None
    """m, base frame: where the object that moves first was seen; None where it wasn't."""


@dataclass(frozen=True)
class ChainSettings:
    """How patient the chain is."""

    threshold: float = THRESHOLD
    """m"""
    bring_attempts: int = 3
    """At bringing an object to one place."""
    by_move: bool = False
    """Whether rows tell of single moves instead of sub-tasks."""


class Chain:
    """Works on one robot, for one task."""

    def __init__(
        self,
        robot: RecordableRobot,
        moves: Sequence[Move],
        sampling: Sampling,
        settings: ChainSettings = ChainSettings(),
    ) -> None:
        self._robot, self._moves, self._settings = robot, tuple(moves), settings
        self._outcomes = Outcomes(settings.threshold)
        self._recorder = EpisodeRecorder(robot, sampling, RecorderSettings(by_move=settings.by_move))
        self._known = KnownMoves(self._outcomes)
        # One loop for all: a robot keeps every loop that listens to it, and a loop what its agents saw last.
        log = EventLog([self._outcomes, self._recorder])
        self._loop = AgentLoop(robot, self._known.agents(robot.rig), log, Budget(turns=_TURNS))
        self._homes: dict[str, ObjectInfo] = {}
        """Where the things that the task moves later were when they were first moved."""
        self._astray: dict[str, None] = {}
        """Those of them that aren't there now, in the order in which they left."""

    @property
    def moved(self) -> str:
        """What the object is called that the task moves first, and that is brought to each start."""
        return self._moves[0].objects[0]

    def bring(self, start: Start) -> str:
        """Put the object at a start; returns why that start can't be had, empty where the object is there.

        Everything else that the task moves goes back to where it began: what was moved last goes first, and once more
        after the object where that lay in its way. Raises Stuck where the robot can't get hold of an object at all,
        wherever it was to go: then a person puts all of them back.
        """
        try:
            self._bring_home()
            why = self._bring_to(start)
            if still_astray := self._bring_home():
                raise Stuck(still_astray)
        except Stuck:
            self._astray.clear()
            raise
        return why

    def _bring_home(self) -> str:
        """Take home what is astray; returns why that can't be done with the last of those with which it can't."""
        why = ""
        for name in reversed(list(self._astray)):
            home = self._homes[name]
            x, y = map(float, home.centre[:2])
            result = self._run((move_to(name, (x, y), home.yaw),), self._settings.bring_attempts)
            if result.verdict is RunVerdict.ACHIEVED:
                del self._astray[name]
            else:
                why = f"The {name} can't be brought back to where it began, ({x:.2f}, {y:.2f}): {result.reason}"
        return why

    def _bring_to(self, start: Start) -> str:
        carry = (move_to(self.moved, start.xy, start.yaw),)
        result = self._run(carry, self._settings.bring_attempts)
        if result.verdict is not RunVerdict.ACHIEVED and not _refused(result) and self._pull_to(start):
            result = self._run(carry, self._settings.bring_attempts)
        if result.verdict is RunVerdict.ACHIEVED:
            return ""
        if _refused(result):
            return result.reason
        raise Stuck(f"The {self.moved} can't be brought to its next start: {result.reason}")

    def _pull_to(self, start: Start) -> bool:
        """Drag the object where it can't be lifted: what lies on its edge, or too flat, may lie better afterwards."""
        x, y = start.xy
        return self._run(moves_of(f"drag the {self.moved} to ({x:.2f}, {y:.2f})"), 1).verdict is RunVerdict.ACHIEVED

    def perform(self, seed: int) -> Attempt:
        """Carry out the task once, recorded; `seed` draws the noise of the recorded pictures."""
        self._recorder.begin(seed=seed)
        try:
            result = self._run(self._moves, attempts=1)
        except BaseException:
            self._recorder.cancel()
            raise
        self._note_moved(result)
        objects = result.subtasks[0].objects if result.subtasks else ()
        began = (float(objects[0].centre[0]), float(objects[0].centre[1])) if objects else None
        try:
            recording = self._recorder.finish()
        except StageFailure as failure:  # a camera stopped, or nothing moved
            reason = str(failure) if isinstance(failure, CameraFailure) else result.reason
            return Attempt("failed", reason, None, None, began)
        label, reason, distance = self._judge(result)
        return Attempt(label, reason, distance, recording, began)

    def _note_moved(self, result: RunResult) -> None:
        """Remember what has to go back before the next start besides the object that is brought there anyway."""
        for record in result.subtasks:
            name = record.queries[0]
            if record.sequence is not None and name != self.moved:
                self._homes.setdefault(name, record.objects[0])
                self._astray[name] = None

    def _judge(self, result: RunResult) -> tuple[Label, str, float | None]:
        """The label, why it isn't valid, and the farthest distance (m) from where things were to be."""
        distances = self._outcomes.distances
        seen = [d for d in distances if d is not None]
        distance = max(seen) if seen and len(seen) == len(distances) else None
        if distance is not None and abs(distance - self._settings.threshold) <= DOUBT:
            return "doubtful", "It lies so near the threshold that the look doesn't decide.", distance
        if distances and distances[-1] is None and result.subtasks[-1].outcome.completed:
            return "doubtful", "The arm made every movement, but the object isn't seen any more.", None
        if result.verdict is RunVerdict.ACHIEVED:
            return "valid", "", distance
        return "failed", result.reason, distance

    def _run(self, moves: Sequence[Move], attempts: int) -> RunResult:
        self._outcomes.begin()
        self._known.begin(moves, attempts)
        return self._loop.run(", then ".join(move.text for move in moves))


def _refused(result: RunResult) -> bool:
    """Whether the object was found, and the way to where it was to go was refused."""
    last = result.subtasks[-1] if result.subtasks else None
    return last is not None and last.outcome.stage == FailureStage.PLANNING and bool(last.objects)
