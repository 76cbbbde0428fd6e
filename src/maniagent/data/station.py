"""A table at which one worker collects: in the twin, with its own robot, its own scene, and its own plan of starts."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import replace
from types import TracebackType
from typing import Self

import numpy as np

from ..agents.memory import Memory
from ..agents.rules import rules_agents
from ..envs.tabletop import TabletopEnv
from ..robots.simulated import SimulatedRobot
from ..tasks import task_named
from ..tasks.conditions import AnyCondition
from ..types import ObjectInfo, Subtask, Verdict
from .chain import Chain, ChainSettings
from .settings import CollectSettings
from .starts import Pattern, Start, plan_starts
from .table import Table

STRAYED = 0.02
"""m from where it began, after which a person would put a thing back."""


class TwinStation:
    """A worker's table in simulation; a context manager."""

    def __init__(self, settings: CollectSettings, worker: int, table: Table | None = None) -> None:
        """Without `table`, what was written down of it earlier, the robot looks.

        Raises StageFailure where it doesn't see what the task is about.
        """
        self._settings, self._worker = settings, worker
        task = task_named(settings.task)
        self._env = TabletopEnv(task.scene)
        self._env.reset(seed=_seed(settings.seed, worker))
        self._episode = task.episode(self._env.layout, np.random.default_rng([settings.seed, worker]))
        self._homes = {name: thing.T_base_object for name, thing in self._env.truth().items()}
        robot = SimulatedRobot(self._env)
        self.chain = Chain(
            robot,
            settings.moves,
            settings.sampling,
            ChainSettings(threshold=settings.threshold, by_move=settings.texts == "move"),
        )
        seen, moved = self._look(robot)
        self.table = table or seen
        """What the plan of starts depends on."""
        self._success = self._success_of(moved)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._env.close()

    def starts(self, first: int) -> Iterator[Start]:
        """The plan from start number `first` on. A grid ends and begins anew; the other patterns don't end."""
        region = self.table.region(self._settings)
        seed, pattern = _seed(self._settings.seed, self._worker), self._settings.pattern
        if pattern in (Pattern.GRID, Pattern.SHUFFLED_GRID):
            grid = plan_starts(region, self._settings.quota(self._worker), pattern, seed, self._settings.yaw)
            for index in itertools.count(first):
                yield replace(grid[index % len(grid)], index=index)
        count = max(64, 2 * first)
        while True:
            yield from plan_starts(region, count, pattern, seed, self._settings.yaw)[first:count]
            first, count = max(first, count), 2 * count

    def put(self, start: Start) -> None:
        """Put the object at a start without the robot, and what else was moved where it began, as a person would."""
        now = self._env.truth()
        for name, home in self._homes.items():
            strayed = np.linalg.norm(now[name].T_base_object[:3, 3] - home[:3, 3])
            if name != self._true_name and strayed > STRAYED:
                self._env.put(name, home[:2, 3].tolist(), math.atan2(home[1, 0], home[0, 0]))
        self._env.put(self._true_name, start.xy, start.yaw)

    def truth(self) -> tuple[float | None, bool | None]:
        """The true distance (m) of the object from its target, and whether the task's predicate holds."""
        self._env.settle(0.5)
        truth = self._env.truth()
        thing, *target = (truth[name].T_base_object[:2, 3] for name in self._success.names())
        distance = float(np.linalg.norm(thing - target[0])) if target else None
        return distance, self._episode.achieved(truth)

    @property
    def _true_name(self) -> str:
        """What the scene calls the object that is moved first; for resets and statistics only."""
        return self._success.names()[0]

    def _success_of(self, moved: ObjectInfo) -> AnyCondition:
        """The task's condition on the object that the robot moves first, whatever that is called."""
        truth = self._env.truth()

        def off(condition: AnyCondition) -> float:
            return float(np.linalg.norm(truth[condition.names()[0]].T_base_object[:2, 3] - moved.centre[:2]))

        return min(self._episode.success, key=off)

    def _look(self, robot: SimulatedRobot) -> tuple[Table, ObjectInfo]:
        """What is on the table, as the robot sees it at first, and the object that moves first.

        Raises DetectionFailure where anything that the moves name isn't there.
        """
        robot.go_home()
        observation = robot.observe()
        eyes = rules_agents(robot.rig).objects
        for move in reversed(self._settings.moves):
            subtask = Subtask(previous=Verdict.INITIAL, reason="", text=move.text, objects=move.objects)
            located = eyes.locate(subtask, observation, Memory())
        moved, *others = (*located.objects, *located.surroundings)
        return Table.seen(moved, others), moved


def _seed(seed: int, worker: int) -> int:
    """A layout and a plan of its own for each worker."""
    return 1000 * seed + worker
