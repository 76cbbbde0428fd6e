"""A table at which one worker collects: in the twin, with its own robot, its own scene, and its own plan of starts."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np
from pydantic import BaseModel

from ..agents.memory import Memory
from ..agents.rules import rules_agents
from ..envs.tabletop import TabletopEnv
from ..motion import ArmModel, MotionLimits
from ..perception.views import Workspace
from ..robots.simulated import SimulatedRobot
from ..tasks import task_named
from ..types import OrientedBox, Subtask, Verdict
from .chain import Chain, ChainSettings
from .reach import Reach
from .settings import CollectSettings
from .starts import Pattern, Region, Start, plan_starts


class TwinStation:
    """A worker's table in simulation; a context manager."""

    def __init__(self, settings: CollectSettings, worker: int, folder: Path) -> None:
        self._settings, self._worker = settings, worker
        task = task_named(settings.task)
        self._env = TabletopEnv(task.scene)
        self._env.reset(seed=_seed(settings.seed, worker))
        self._episode = task.episode(self._env.layout, np.random.default_rng([settings.seed, worker]))
        robot = SimulatedRobot(self._env)
        self.chain = Chain(
            robot,
            settings.moves,
            settings.sampling,
            ChainSettings(threshold=settings.threshold, by_move=settings.texts == "move"),
        )
        self._keep_free(folder / plan_name(worker), robot)
        self._region = region_of(settings, folder, worker)

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
        """The plan from start number `first` on. A grid ends and begins anew; the other patterns don't end."""
        seed, pattern = _seed(self._settings.seed, self._worker), self._settings.pattern
        if pattern in (Pattern.GRID, Pattern.SHUFFLED_GRID):
            grid = plan_starts(self._region, self._settings.quota(self._worker), pattern, seed, self._settings.yaw)
            for index in itertools.count(first):
                yield replace(grid[index % len(grid)], index=index)
        count = max(64, 2 * first)
        while True:
            yield from plan_starts(self._region, count, pattern, seed, self._settings.yaw)[first:count]
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

    def _keep_free(self, path: Path, robot: SimulatedRobot) -> None:
        """Write down what is on the table besides the object that is moved, as the robot sees it at first."""
        if path.exists():
            return
        first = self._settings.moves[0]
        subtask = Subtask(previous=Verdict.INITIAL, reason="", text=first.text, objects=first.objects)
        robot.go_home()
        located = rules_agents(robot.rig).objects.locate(subtask, robot.observe(), Memory())
        moved, *others = (*located.objects, *located.surroundings)
        plan = _Plan(
            size=(float(moved.extent[0]), float(moved.extent[1])),
            kept_free=tuple(_Box.of(thing.box) for thing in others),
        )
        draft = path.with_suffix(".tmp")
        draft.write_text(plan.model_dump_json() + "\n", encoding="utf-8")
        draft.replace(path)


class _Box(BaseModel):
    centre: tuple[float, float, float]
    extent: tuple[float, float, float]
    yaw: float

    @classmethod
    def of(cls, box: OrientedBox) -> Self:
        return cls.model_validate({"centre": box.centre.tolist(), "extent": box.extent.tolist(), "yaw": box.yaw})


class _Plan(BaseModel):
    """What a worker's plan of starts depends on, as it was seen when the collection began."""

    size: tuple[float, float]
    """m, length and width of the object that is moved."""
    kept_free: tuple[_Box, ...]


def plan_name(worker: int) -> str:
    """The file that holds it."""
    return f"plan-w{worker:02d}.json"


def region_of(settings: CollectSettings, folder: Path, worker: int) -> Region:
    """Where objects may start on a worker's table."""
    plan = _Plan.model_validate_json((folder / plan_name(worker)).read_text(encoding="utf-8"))
    radius = math.hypot(*plan.size) / 2
    return Region(
        Reach(ArmModel(), MotionLimits(), radius=radius),
        Workspace(),
        x=settings.x,
        y=settings.y,
        width=plan.size[1],
        kept_free=tuple(OrientedBox(np.array(b.centre), np.array(b.extent), b.yaw) for b in plan.kept_free),
    )


def _seed(seed: int, worker: int) -> int:
    """A layout and a plan of its own for each worker."""
    return 1000 * seed + worker
