"""The loop: look, describe, reason, locate, write, bind, move, look again (ManiAgent, figure 2).

One sub-task a turn, planned against the table as it is now. Whatever fails is told to the observers, goes into
memory and is retried within the budget; whatever happens, the arm ends at rest in its safe pose.
"""

from __future__ import annotations

import re
import time
from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace

from ..errors import CameraFailure, FormatFailure, GraspFailure, MotionRejected, StageFailure
from ..perception.viewpoint import Viewpoint
from ..robots.robot import Boxes, Robot
from ..types import (
    ActionSequence,
    ExecutionReport,
    KeyPoint,
    ObjectInfo,
    Observation,
    RunResult,
    RunVerdict,
    Subtask,
    SubtaskRecord,
    Verdict,
)
from .binding import bind
from .events import EventLog
from .memory import Memory
from .protocols import Agents, Located
from .supports import allow_supports


@dataclass(frozen=True)
class Budget:
    """How long a run may go on."""

    turns: int = 20
    seconds: float = 3600.0
    """Wall time."""
    failed_looks: int = 3
    """Turns in a row that may end without an attempt (nothing seen, nothing understood) before the run gives up."""
    answers: int = 3
    """Action sequences the controller may write for one sub-task: the first and its repairs."""
    grasps: int = 6
    """Grasps tried in planning for one sequence."""


class AgentLoop:
    """Carries out one instruction after another with one robot and one set of agents."""

    def __init__(self, robot: Robot, agents: Agents, log: EventLog, budget: Budget = Budget()) -> None:
        self._robot = robot
        self._agents = agents
        self._log = log
        self._budget = budget
        self._run: _Run | None = None
        robot.on_move(self._tell_move)

    def run(self, instruction: str) -> RunResult:
        """Carry out an instruction; never raises a StageFailure. KeyboardInterrupt stops the arm and is raised on."""
        self._run = run = _Run(self._robot, self._agents, self._log, self._budget, instruction)
        self._log.emit("begun", instruction=instruction, budget=self._budget, rig=self._robot.rig)
        try:
            run.go_home()  # where the arm is out of the cameras' way
            verdict, reason = run.until_the_end()
            home = run.go_home()
        except BaseException:
            self._robot.stop()
            raise
        if not home.completed:
            reason += f" The arm did not get home: {home.reason}"
        return RunResult(instruction, verdict, reason, run.memory.records, dict(run.seconds))

    def _tell_move(self, description: str, seconds: float) -> None:
        turn = self._run.turn if self._run is not None else 0
        self._log.emit("move", turn=turn, description=description, seconds=seconds)


class _Run:
    """The state of one run."""

    def __init__(self, robot: Robot, agents: Agents, log: EventLog, budget: Budget, instruction: str) -> None:
        self.robot, self.agents, self.log, self.budget, self.instruction = robot, agents, log, budget, instruction
        self.memory = Memory()
        self.seconds: defaultdict[str, float] = defaultdict(float)
        self._start = time.monotonic()
        self.turn = 0
        self._failed_looks = 0

    def until_the_end(self) -> tuple[RunVerdict, str]:
        """Take turns until the agents are done, give up, or run out of budget."""
        while self.turn < self.budget.turns:
            self.turn += 1
            if time.monotonic() - self._start > self.budget.seconds:
                return RunVerdict.OUT_OF_BUDGET, f"The run took longer than its {self.budget.seconds:.0f} s."
            try:
                end = self._take_turn()
                self._failed_looks = 0
            except StageFailure as failure:
                self._tell(failure)
                self._failed_looks += 1
                if self._failed_looks >= self.budget.failed_looks:
                    return RunVerdict.CANNOT, str(failure)
                continue
            if end is not None:
                return end
        return RunVerdict.OUT_OF_BUDGET, f"Not done after {self.budget.turns} turns."

    def _take_turn(self) -> tuple[RunVerdict, str] | None:
        """One turn; the verdict where it was the last. Raises StageFailure where nothing could be attempted."""
        turn = self.turn
        with self.timed("observe"):
            observation = self.robot.observe()
        self.log.emit("observed", turn=turn, observation=observation)
        with self.timed("scene"):
            scene = self.agents.scene.describe(self.instruction, observation)
        self.log.emit("described", turn=turn, scene=scene)
        with self.timed("reasoning"):
            subtask = self.agents.reasoning.next_subtask(self.instruction, scene, self.memory)
        self.log.emit("reasoned", turn=turn, subtask=subtask)
        self._judge_last(subtask)
        if subtask.done:
            return RunVerdict.ACHIEVED, subtask.reason
        if subtask.cannot:
            return RunVerdict.CANNOT, subtask.reason
        self._attempt(subtask, observation)
        return None

    def _judge_last(self, subtask: Subtask) -> None:
        """Write the verdict into memory; the controller hears it too, once for every attempt."""
        waiting = self.memory.last is not None and self.memory.last.verdict is Verdict.INITIAL
        self.memory.judge_last(subtask.previous, subtask.reason)
        judged = self.memory.last
        if waiting and judged is not None and judged.verdict is not Verdict.INITIAL:
            self.agents.controller.learn(judged)

    def _attempt(self, subtask: Subtask, observation: Observation) -> None:
        """Try one sub-task; what came of it is in memory afterwards, failures before the first move included."""
        located = Located((), ())
        try:
            with self.timed("detection"):
                located = self.agents.objects.locate(subtask, observation, self.memory)
            self.log.emit("located", turn=self.turn, objects=located.objects, detections=located.detections)
            boxes = {info.index: info.box for info in (*located.objects, *located.surroundings)}
            sequence, objects, keypoints = self._plan(subtask, located, boxes, Viewpoint.of(observation))
        except CameraFailure:
            raise
        except StageFailure as failure:
            self._tell(failure)
            report = ExecutionReport(completed=False, reached=0, reason=str(failure), stage=str(failure.stage))
            self._remember(subtask, located.objects, located, report)
            return
        with self.timed("execution"):
            report = self.robot.execute(keypoints, boxes)
        home = self.go_home()
        if report.completed and not home.completed:
            report = home
        self.log.emit("executed", turn=self.turn, report=report)
        if not report.completed:
            self.log.emit("failed", turn=self.turn, stage=report.stage, reason=report.reason)
        self._remember(subtask, objects, located, report, sequence)

    def go_home(self) -> ExecutionReport:
        """Bring the arm to its safe pose."""
        with self.timed("execution"):
            home = self.robot.go_home()
        self.log.emit("homed", turn=self.turn, report=home)
        return home

    def _remember(
        self,
        subtask: Subtask,
        objects: tuple[ObjectInfo, ...],
        located: Located,
        report: ExecutionReport,
        sequence: ActionSequence | None = None,
    ) -> None:
        record = SubtaskRecord(
            subtask.text,
            objects,
            report,
            queries=subtask.objects,
            surroundings=located.surroundings,
            sequence=sequence,
        )
        self.memory.add(record)

    def _plan(
        self, subtask: Subtask, located: Located, boxes: Boxes, viewpoint: Viewpoint
    ) -> tuple[ActionSequence, tuple[ObjectInfo, ...], tuple[KeyPoint, ...]]:
        """A sequence whose key points the robot accepts, the objects with the grasps these use, the key points.

        A sequence that doesn't bind or can't be moved goes back to the controller with the reason, until its answers
        are used up or it repeats itself.
        """
        refused: ActionSequence | None = None
        refusal: StageFailure = FormatFailure("The controller was not asked.")
        for _ in range(self.budget.answers):
            with self.timed("control"):
                sequence = self.agents.controller.write(subtask, located.objects, str(refusal) if refused else "")
            if sequence == refused:
                break
            if refused is not None:
                self._tell(refusal)
            try:
                with self.timed("planning"):
                    objects, keypoints = self._bind_and_check(sequence, located, boxes, viewpoint)
            except MotionRejected as failure:
                refused, refusal = sequence, MotionRejected(_by_name(str(failure), located))
            except (FormatFailure, GraspFailure) as failure:
                refused, refusal = sequence, failure
            else:
                self.log.emit("planned", turn=self.turn, sequence=sequence, keypoints=keypoints)
                return sequence, objects, keypoints
        raise refusal

    def _tell(self, failure: StageFailure) -> None:
        self.log.emit("failed", turn=self.turn, stage=str(failure.stage), reason=str(failure))

    def _bind_and_check(
        self, sequence: ActionSequence, located: Located, boxes: Boxes, viewpoint: Viewpoint
    ) -> tuple[tuple[ObjectInfo, ...], tuple[KeyPoint, ...]]:
        """Bind to the best grasps that the robot can reach; raises the first choice's rejection where none is."""
        first_rejection: MotionRejected | None = None
        for choice in _grasp_choices(located.objects, self.budget.grasps):
            keypoints = allow_supports(bind(sequence, choice, viewpoint), (*choice, *located.surroundings))
            try:
                self.robot.check(keypoints, boxes)
            except MotionRejected as rejection:
                self.log.emit("checked", turn=self.turn, keypoints=keypoints, reason=str(rejection))
                first_rejection = first_rejection or rejection
            else:
                self.log.emit("checked", turn=self.turn, keypoints=keypoints, reason="")
                return choice, keypoints
        raise first_rejection or MotionRejected("There is nothing to move.")

    @contextmanager
    def timed(self, stage: str) -> Iterator[None]:
        """Add the time spent inside to a stage."""
        start = time.monotonic()
        try:
            yield
        finally:
            self.seconds[stage] += time.monotonic() - start


def _by_name(reason: str, located: Located) -> str:
    """A planner's reason with the objects' names beside their numbers, which are all that motion knows."""
    names = {info.index: info.name for info in (*located.objects, *located.surroundings)}
    return re.sub(r"\bobject (\d+)\b", lambda m: f"object {m[1]} ({names.get(int(m[1]), 'unknown')})", reason)


def _grasp_choices(objects: Sequence[ObjectInfo], limit: int) -> Iterator[tuple[ObjectInfo, ...]]:
    """The objects as they are, then with the next grasps of the first one tried in turn (it is the one that moves)."""
    yield tuple(objects)
    if not objects:
        return
    first, rest = objects[0], tuple(objects[1:])
    for k in range(1, min(limit, len(first.grasps))):
        grasps = (first.grasps[k], *first.grasps[:k], *first.grasps[k + 1 :])
        yield (replace(first, grasps=grasps), *rest)
