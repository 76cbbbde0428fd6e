"""A table at which one worker collects: in the twin, with its own robot, its own scene, and its own plan of starts."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np

from ..agents.memory import Memory
from ..agents.rules import rules_agents
from ..envs.tabletop import TabletopEnv
from ..motion import ArmModel, MotionLimits
from ..robots.simulated import SimulatedRobot
from ..tasks import Task, get, load_task
from ..types import OrientedBox, Subtask, Verdict
from .chain import Chain, ChainSettings
from .reach import Reach
from .settings import CollectSettings
from .starts import Region, Start, plan_starts


def task_named(name: str) -> Task:
    """A task of the library, or the one in a scene file."""
    return load_task(Path(name)) if Path(name).suffix in (".yaml", ".yml") else get(name)


class TwinStation:
    """A worker's table in simulation; a context manager."""

    def __init__(self, settings: CollectSettings, worker: int, folder: Path) -> None:
        self._settings, self._worker = settings, worker
        task = task_named(settings.task)
        self._env = TabletopEnv(task.scene)
        self._env.reset(seed=_seed(settings.seed, worker))
        self._episode = task.episode(self._env.layout, np.random.default_rng([settings.seed, worker]))
        robot = SimulatedRobot(self._env)
        self.chain = Chain(robot, settings.moves, settings.sampling, ChainSettings(threshold=settings.threshold))
        self._rig = robot.rig
        self._region = Region(
            Reach(ArmModel(), MotionLimits()),
            self._rig.workspace,
            x=settings.x,
            y=settings.y,
            kept_free=self._kept_free(folder / f"plan-w{worker:02d}.json", robot),
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._env.close()

    @property
    def region(self) -> Region:
        """Where objects may start."""
        return self._region

    def starts(self, first: int) -> Iterator[Start]:
        """The plan from start number `first` on; it doesn't end."""
        count = max(64, 2 * first)
        while True:
            plan = plan_starts(
                self._region,
                count,
                self._settings.pattern,
                _seed(self._settings.seed, self._worker),
                self._settings.yaw,
            )
            yield from plan[first:count]
            first, count = max(first, count), 2 * count

    def put(self, start: Start) -> None:
        """Put the object at a start without the robot, as a person would."""
        self._env.put(self._true_name, start.xy, start.yaw)

    def truth(self) -> tuple[float | None, bool | None]:
        """The true distance (m) of the object from its target, and whether the task's predicate holds."""
        self._env.settle(0.5)
        truth = self._env.truth()
        moved = truth[self._true_name].T_base_object[:2, 3]
        target = self._true_target(truth.keys())
        distance = None if target is None else float(np.linalg.norm(moved - truth[target].T_base_object[:2, 3]))
        return distance, self._episode.achieved(truth)

    @property
    def _true_name(self) -> str:
        """What the scene calls the object that is moved, by the task's condition; for resets and statistics only."""
        return self._episode.success[0].names()[0]

    def _true_target(self, names: object) -> str | None:
        spoken_of = self._episode.success[0].names()
        return spoken_of[1] if len(spoken_of) > 1 else None

    def _kept_free(self, path: Path, robot: SimulatedRobot) -> tuple[OrientedBox, ...]:
        """The boxes of everything but the object that is moved, as the robot saw them when the collection began."""
        if not path.exists():
            first = self._settings.moves[0]
            subtask = Subtask(previous=Verdict.INITIAL, reason="", text=first.text, objects=first.objects)
            robot.go_home()
            located = rules_agents(robot.rig).objects.locate(subtask, robot.observe(), Memory())
            boxes = [thing.box for thing in (*located.objects[1:], *located.surroundings)]
            plain = [{"centre": list(b.centre), "extent": list(b.extent), "yaw": b.yaw} for b in boxes]
            draft = path.with_suffix(".tmp")
            draft.write_text(json.dumps(plain, default=float) + "\n", encoding="utf-8")
            draft.replace(path)
        return tuple(
            OrientedBox(np.array(b["centre"]), np.array(b["extent"]), b["yaw"]) for b in json.loads(path.read_text())
        )


def _seed(seed: int, worker: int) -> int:
    """A layout and a plan of its own for each worker."""
    return 1000 * seed + worker
