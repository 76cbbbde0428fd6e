"""Labelled scenes: a picture of the twin, what is said to the robot, and what is truly there. For scoring alone."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...envs.tabletop import TabletopEnv, TrueObject
from ...errors import UsageError
from ...geometry import project, transform_points
from ...perception.rig import Rig
from ...perception.viewpoint import Viewpoint
from ...robots.simulated import SimulatedRobot
from ...tasks import Task, get, load_task, names
from ...types import CameraFrame, Observation
from .matching import Thing


@dataclass(frozen=True)
class SceneOf:
    """One layout of a task, not drawn yet."""

    task: Task
    seed: int

    @property
    def name(self) -> str:
        """Also of its files."""
        return f"{self.task.name}-s{self.seed}"


@dataclass(frozen=True)
class LabelledScene:
    """What a SceneAgent is shown, and what is true."""

    name: str
    instruction: str
    observation: Observation
    """The one that opens `maniagent run` with the same task and seed."""
    rig: Rig
    things: tuple[Thing, ...]
    """All that is on the table."""
    spots: Mapping[str, tuple[float, float, float]]
    """By a thing's name: the circle around it in the main view, px; its middle and its radius."""


def scenes_of(tasks: Iterable[str] = (), files: Iterable[Path] = (), seeds: int = 2) -> tuple[SceneOf, ...]:
    """`seeds` layouts of each named task and of each scene file; of all tasks that come with maniagent by default.

    Raises UsageError for unknown names, bad files, scene files that don't say what is wanted and when it is achieved,
    and two of one name.
    """
    if seeds < 1:
        raise UsageError(f"The number of seeds is {seeds}; it should be 1 or more.")
    tasks, files = tuple(tasks), tuple(files)
    chosen = [get(name) for name in tasks or (() if files else names())]
    chosen += [_labelled(path) for path in files]
    if twice := next((task.name for i, task in enumerate(chosen) if task.name in {t.name for t in chosen[:i]}), None):
        raise UsageError(f"Two scenes are named {twice!r}; name each once.")
    return tuple(SceneOf(task, seed) for seed in range(seeds) for task in chosen)


def _labelled(path: Path) -> Task:
    task = load_task(path)
    if not task.success or not task.instruction.strip():
        raise UsageError(f"{path} doesn't say what matters: it needs an instruction and success (docs/scenes.md).")
    return task


def draw(scene: SceneOf) -> LabelledScene:
    """Draw the layout and take its picture. Raises SetupError where nothing renders."""
    with closing(TabletopEnv(scene.task.scene)) as env:
        env.reset(seed=scene.seed)
        episode = scene.task.episode(env.layout, np.random.default_rng([scene.seed, 1]))
        robot = SimulatedRobot(env)
        observation = robot.observe()
        matter = {name for condition in episode.success for name in condition.names()}
        truth, viewpoint = env.truth(), Viewpoint.of(observation)
    return LabelledScene(
        name=scene.name,
        instruction=episode.instruction,
        observation=observation,
        rig=robot.rig,
        things=tuple(_thing(name, true, viewpoint, name in matter) for name, true in truth.items()),
        spots={name: _spot(true, observation.main_frame) for name, true in truth.items()},
    )


def _thing(name: str, true: TrueObject, viewpoint: Viewpoint, matters: bool) -> Thing:
    xy = true.T_base_object[:2, 3]
    return Thing(name, true.model.title, float(xy @ viewpoint.right), float(xy @ viewpoint.away), matters)


def _spot(true: TrueObject, frame: CameraFrame) -> tuple[float, float, float]:
    middle = transform_points(frame.T_camera_base, true.T_base_object[:3, 3])
    u, v = project(frame.K, middle)
    return float(u), float(v), float(frame.K[0, 0] * true.model.radius / middle[2])


def mattering(things: Sequence[Thing]) -> tuple[Thing, ...]:
    """Those that the task's conditions speak of."""
    return tuple(thing for thing in things if thing.matters)
