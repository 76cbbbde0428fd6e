"""Stand-ins with real interfaces, for tests of agents, loops and observers of your own.

agents = ScriptedAgents([put, done], [Located((pepper, plate), ())], [sequence])
robot = FakeRobot()
result = AgentLoop(robot, agents.as_agents(), EventLog()).run("put the pepper on the plate")
assert robot.calls[-1] == "go_home"
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ValidationError

from .agents.memory import Memory
from .agents.protocols import Agents, Located
from .errors import FormatFailure, MotionRejected
from .geometry import look_at, make_transform, rotation_z, top_down_rotation
from .models.question import Question, Unfit
from .perception.rig import Rig
from .robots.robot import Boxes
from .types import (
    ActionSequence,
    BoolArray,
    CameraFrame,
    ExecutionReport,
    GraspPose,
    KeyPoint,
    ObjectInfo,
    Observation,
    RobotState,
    SceneDescription,
    Subtask,
    SubtaskRecord,
)

T = TypeVar("T")
A = TypeVar("A", bound=BaseModel)


class Script(Generic[T]):
    """Answers in order, the last one for ever; an exception among them is raised instead."""

    def __init__(self, answers: Sequence[T | BaseException]) -> None:
        self._answers: Iterator[T | BaseException] = iter(answers)
        self._last: T | BaseException = LookupError("The script has no answer to this.")

    def next(self) -> T:
        """The next answer."""
        self._last = next(self._answers, self._last)
        if isinstance(self._last, BaseException):
            raise self._last
        return self._last


class ScriptedAgents:
    """All four roles in one, saying what they were told to say and writing down what they were asked."""

    def __init__(
        self,
        subtasks: Sequence[Subtask | BaseException],
        located: Sequence[Located | BaseException] = (),
        sequences: Sequence[ActionSequence | BaseException] = (),
        scenes: Sequence[SceneDescription | BaseException] = (SceneDescription("A table."),),
    ) -> None:
        self._scenes, self._subtasks = Script(scenes), Script(subtasks)
        self._located, self._sequences = Script(located), Script(sequences)
        self.described: list[Observation] = []
        self.remembered: list[int] = []
        """Length of the memory at every question for the next sub-task."""
        self.sought: list[Subtask] = []
        self.feedback: list[str] = []
        """What the controller was told at every question; empty at the first of a sub-task."""
        self.learned: list[SubtaskRecord] = []

    def as_agents(self, name: str = "scripted") -> Agents:
        """The four roles as the loop takes them."""
        return Agents(name, self, self, self, self)

    def describe(self, instruction: str, observation: Observation) -> SceneDescription:
        """The next scene."""
        self.described.append(observation)
        return self._scenes.next()

    def next_subtask(self, instruction: str, scene: SceneDescription, memory: Memory) -> Subtask:
        """The next sub-task."""
        self.remembered.append(len(memory))
        return self._subtasks.next()

    def locate(self, subtask: Subtask, observation: Observation, memory: Memory) -> Located:
        """The next objects."""
        self.sought.append(subtask)
        return self._located.next()

    def write(self, subtask: Subtask, objects: Sequence[ObjectInfo], feedback: str = "") -> ActionSequence:
        """The next sequence."""
        self.feedback.append(feedback)
        return self._sequences.next()

    def learn(self, record: SubtaskRecord) -> None:
        """Write it down."""
        self.learned.append(record)


class ScriptedModel:
    """A `ChatModel` that gives, role by role, the answers it was told to give; where one is refused, the next."""

    def __init__(
        self,
        answers: Mapping[str, Sequence[Mapping[str, Any] | BaseException]],
        name: str = "scripted",
        rounds: int = 3,
    ) -> None:
        """`answers` by role, as JSON objects; `rounds` is how many answers a question may take."""
        self.name = name
        self._scripts = {role: Script(given) for role, given in answers.items()}
        self._rounds = rounds
        self.asked: list[Question[Any]] = []
        self.refusals: list[str] = []
        """Why answers were refused."""

    def ask(self, question: Question[A]) -> A:
        """The next answer of that role that fits."""
        self.asked.append(question)
        for _ in range(self._rounds):
            try:
                answer = question.answer.model_validate(self._scripts[question.role].next())
                question.check(answer)
            except (ValidationError, Unfit) as refusal:
                self.refusals.append(str(refusal))
            else:
                return answer
        raise FormatFailure(f"No answer of {self.name} fits: {self.refusals[-1]}")


class FakeRobot:
    """A `Robot` without a body: it writes down what is asked of it.

    `refuse` gives the reason to reject key points for, or "". `execute` raises AssertionError for key points that
    `check` hasn't accepted with the same boxes: a loop that moves unchecked has a bug.
    """

    def __init__(
        self,
        observations: Sequence[Observation | BaseException] = (),
        reports: Sequence[ExecutionReport | BaseException] = (),
        refuse: Callable[[Sequence[KeyPoint]], str] = lambda keypoints: "",
        way_home: Sequence[ExecutionReport | BaseException] = (ExecutionReport(completed=True, reached=1),),
    ) -> None:
        """`reports` are what `execute` answers, `way_home` what `go_home` does; exceptions in them are raised."""
        self._observations = Script(observations or [made_observation()])
        self._reports, self._way_home = Script(reports), Script(way_home)
        self._always_succeeds = not reports
        self._refuse = refuse
        self._accepted: tuple[Sequence[KeyPoint], Boxes] | None = None
        self._hooks: list[Callable[[str, float], None]] = []
        self.rig = Rig(no_body)
        self.calls: list[str] = []
        """Names of the methods called, in order."""
        self.checked: list[Sequence[KeyPoint]] = []
        self.executed: list[Sequence[KeyPoint]] = []
        self.boxes: Boxes = {}
        """Those of the last check."""

    def observe(self) -> Observation:
        """The next observation."""
        self.calls.append("observe")
        return self._observations.next()

    def check(self, keypoints: Sequence[KeyPoint], boxes: Boxes) -> None:
        """Raise MotionRejected where `refuse` gives a reason."""
        self.calls.append("check")
        self.checked.append(keypoints)
        self.boxes = boxes
        if reason := self._refuse(keypoints):
            raise MotionRejected(reason)
        self._accepted = (keypoints, boxes)

    def execute(self, keypoints: Sequence[KeyPoint], boxes: Boxes) -> ExecutionReport:
        """Announce one move a key point, and give the next report."""
        self.calls.append("execute")
        if self._accepted is None or self._accepted[0] is not keypoints or self._accepted[1] is not boxes:
            raise AssertionError("execute was called with what check has not accepted")
        self.executed.append(keypoints)
        for keypoint in keypoints:
            for hook in self._hooks:
                hook(keypoint.description, 1.0)
        return ExecutionReport(True, len(keypoints)) if self._always_succeeds else self._reports.next()

    def go_home(self) -> ExecutionReport:
        """The next report of the way home."""
        self.calls.append("go_home")
        return self._way_home.next()

    def stop(self) -> None:
        """Write it down."""
        self.calls.append("stop")

    def on_move(self, hook: Callable[[str, float], None]) -> None:
        """Call `hook` for every key point executed."""
        self._hooks.append(hook)


def no_body(points: NDArray[np.float32], state: RobotState) -> BoolArray:
    """The `covers_robot` of a robot without a body: no point lies on it."""
    return np.zeros(len(points), bool)


def made_observation(eye: tuple[float, float, float] = (0.8, 0.0, 0.5)) -> Observation:
    """A tiny grey picture from a camera at `eye` (m, base frame) that looks at the table; the arm is at zero."""
    K = np.array([[8.0, 0.0, 3.5], [0.0, 8.0, 2.5], [0.0, 0.0, 1.0]])
    frame = CameraFrame("main", np.full((6, 8, 3), 128), np.full((6, 8), 0.9), K, look_at(eye, (0.25, 0.0, 0.0)))
    state = RobotState(np.zeros(6), make_transform(top_down_rotation(0.0), [0.2, 0.0, 0.24]), 0.048, 0.0)
    return Observation({"main": frame}, "main", state)


def made_object(
    index: int,
    name: str,
    at: tuple[float, float] = (0.25, 0.0),
    *,
    size: tuple[float, float, float] = (0.10, 0.03, 0.03),
    yaw: float = 0.0,
    base_z: float = 0.0,
    colour: tuple[int, int, int] = (200, 40, 30),
    grasps: int = 1,
) -> ObjectInfo:
    """A box-shaped object at `at` (m, base frame), standing at height `base_z`, with top-down grasps along its length.

    The first grasp is in its middle, the next ones 1 cm further along each; all close across its width.
    """
    length, width, height = size
    along = rotation_z(yaw)[:, 0]
    centre = np.array([*at, base_z + height / 2])
    poses = tuple(
        GraspPose(make_transform(top_down_rotation(yaw), centre + 0.01 * k * along), width + 0.01, 1.0 / (1 + k))
        for k in range(grasps)
    )
    return ObjectInfo(index, name, centre, np.array([length, width, height]), yaw, base_z + height, colour, poses)
