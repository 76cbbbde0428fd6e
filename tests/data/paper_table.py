"""A table on paper: what is put somewhere lies there. For what a simulator can't be made to do when a test wants it."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from maniagent.agents.memory import Memory
from maniagent.agents.protocols import Agents, Located
from maniagent.data.outcome import release_point
from maniagent.errors import DetectionFailure, GraspFailure
from maniagent.geometry import make_transform, top_down_rotation
from maniagent.perception.rig import Rig
from maniagent.robots.robot import Boxes
from maniagent.robots.sampling import Picture, Sample, SampleListener, Sampling
from maniagent.testing import FakeRobot, ScriptedAgents, made_object
from maniagent.types import ExecutionReport, KeyPoint, ObjectInfo, Observation, SceneDescription, Subtask

WENT = ExecutionReport(completed=True, reached=1)
SLIPPED = ExecutionReport(completed=False, reached=3, reason="It slipped.", stage="grasp")


class Table(FakeRobot):
    """Things, eyes that see them, and a robot that moves them and can be recorded."""

    def __init__(self, **things: tuple[float, float]) -> None:
        """Each thing by its name, at x, y (m, base frame)."""
        super().__init__(refuse=lambda keypoints: self.refuse(keypoints))
        self.things = {name: _thing(k, name, xy) for k, (name, xy) in enumerate(things.items())}
        self.hidden: set[str] = set()
        self.flat: set[str] = set()
        """Those that can be dragged, not lifted."""
        self.off = 0.0
        """m along x by which things miss their places."""
        self.report = WENT
        self.refuse: Callable[[Sequence[KeyPoint]], str] = lambda keypoints: ""
        self.while_moving: Callable[[Table], None] = lambda table: None
        self.tried: list[str] = []
        """The sub-tasks that anything was sought for."""
        self.listener: SampleListener | None = None
        self._located: tuple[ObjectInfo, ...] = ()
        self._row = 0

    def eyes(self, rig: Rig) -> Agents:
        """In the place of `rules_agents`."""
        return Agents("paper", self, ScriptedAgents([]), self, ScriptedAgents([]))

    @property
    def sought(self) -> str:
        """The thing that is to be moved now."""
        return self._located[0].name

    def put(self, name: str, xy: Sequence[float]) -> None:
        """Lay a thing somewhere."""
        self.things[name] = _thing(0, name, xy, like=self.things[name])

    def at(self, name: str) -> tuple[float, float]:
        """Where a thing lies, to the tenth of a millimetre."""
        x, y = self.things[name].centre[:2]
        return round(float(x), 4), round(float(y), 4)

    # As the eyes --------------------------------------------------------------------------------------------------

    def describe(self, instruction: str, observation: Observation) -> SceneDescription:
        """All that isn't hidden."""
        return SceneDescription("A table.", tuple(t for name, t in self.things.items() if name not in self.hidden))

    def locate(self, subtask: Subtask, observation: Observation, memory: Memory) -> Located:
        """The things by their names."""
        self.tried.append(subtask.text)
        for name in subtask.objects:
            if name in self.hidden:
                raise DetectionFailure(f"No {name} is in view.")
        if subtask.objects[0] in self.flat and not subtask.text.startswith("drag"):
            raise GraspFailure("It lies too flat.")
        found = [self.things[name] for name in subtask.objects]
        self._located = tuple(_thing(k, thing.name, thing.centre, like=thing) for k, thing in enumerate(found))
        return Located(self._located, ())

    # As the robot -------------------------------------------------------------------------------------------------

    def execute(self, keypoints: Sequence[KeyPoint], boxes: Boxes) -> ExecutionReport:
        """Put down what is carried."""
        super().execute(keypoints, boxes)
        self.while_moving(self)
        place = release_point(keypoints, self._located)
        if place is not None and self.report.completed:
            self.flat.discard(self.sought)
            self.put(self.sought, (place[0] + self.off, place[1]))
        return self.report

    def on_move(self, hook: Callable[[str, float], None]) -> None:
        """Tell of a row after every move that is announced."""
        super().on_move(hook)
        super().on_move(lambda description, seconds: self.tell())

    def start_sampling(self, listener: SampleListener, sampling: Sampling) -> None:
        """Remember whom to tell."""
        self.listener = listener

    def stop_sampling(self) -> None:
        """Forget them."""
        self.listener = None

    def tell(self) -> None:
        """A row in which everything moves."""
        self._row += 1
        if self.listener is None:
            return
        time, joints = self._row / 10, np.full(6, 0.1 * self._row)
        T = make_transform(top_down_rotation(0.0), [0.3, 0.0, 0.2])
        picture = Picture(np.zeros((2, 3, 3), np.uint8), time)
        self.listener.on_sample(Sample(time, time, joints, 0.03, T, joints, 0.03, T, {"main": picture}))


def _thing(index: int, name: str, xy: Sequence[float], like: ObjectInfo | None = None) -> ObjectInfo:
    colour = like.colour if like is not None else (40 + 70 * (index % 3), 40 + 60 * (index // 3), 200 - 70 * index)
    return made_object(index, name, (float(xy[0]), float(xy[1])), colour=colour)
