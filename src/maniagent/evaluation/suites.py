"""What is evaluated, by name: tasks that belong together, and how one episode of them is run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import Protocol

from .. import tasks
from ..envs.simpler import LAYOUTS, TASKS
from ..envs.simpler.assets import require
from ..errors import UnknownNameError, UsageError
from . import simpler, tabletop
from .episode import MOST_EPISODES, EpisodeResult, Job
from .poses import ON_GRID, Poses


class RunEpisode(Protocol):
    """Plays one episode of a task."""

    def __call__(self, task: str, seed: int, episode: int, actor: str, out: Path | None) -> EpisodeResult:
        """Play it, with a run folder at `out` where one is wanted, and say what became of it.

        Whatever it raises counts as a failed episode, except for UsageError and SetupError, which end the evaluation.
        """
        ...


def _always_ready() -> None:
    """Nothing can be missing."""


@dataclass(frozen=True)
class Suite:
    """Tasks that are measured together. Its functions stand at the top of a module: worker processes import them."""

    name: str
    tasks: tuple[str, ...]
    run_episode: RunEpisode
    repeat: Callable[[Job, str], str]
    """The command that plays a job again, given the actor's name."""
    ready: Callable[[], None] = _always_ready
    """Raises SetupError where it is plain from the start that no episode can be played on this machine."""
    episodes: int = MOST_EPISODES
    """How many different episodes there are for each task and seed."""
    seeds_draw_scenes: bool = True
    """Whether another seed is another scene. Otherwise it is a repetition, and intervals count each scene once."""
    poses: Poses | None = None
    """How objects are placed, where that is left to choose."""
    episodes_per_process: int = 25
    """After so many a worker process is replaced: simulators and renderers keep some megabytes of every episode."""


@cache
def _suites() -> dict[str, Suite]:
    library = [tasks.get(name) for name in tasks.names()]
    members = {
        "paper8": [task for task in library if task.suite == "paper8"],
        "bridge": [task for task in library if task.suite == "bridge"],
        "tabletop4": [task for task in library if task.suite == "paper8" and not task.needs_model],
        "tabletop": [task for task in library if not task.needs_model],
    }
    twin = {
        name: Suite(name, tuple(task.name for task in chosen), tabletop.run_episode, tabletop.repeat)
        for name, chosen in members.items()
    }
    return {**twin, "simpler": _simpler()}


def _simpler() -> Suite:
    # Starting a process costs as much as several episodes here, and its memory doesn't grow with them.
    return Suite(
        name="simpler",
        tasks=tuple(TASKS),
        run_episode=simpler.run_episode,
        repeat=simpler.repeat,
        ready=require,
        episodes=LAYOUTS,
        seeds_draw_scenes=False,
        poses=ON_GRID,
        episodes_per_process=200,
    )


def names() -> tuple[str, ...]:
    """The names of all suites."""
    return tuple(_suites())


def get(name: str) -> Suite:
    """The suite of that name, or a suite of the one task of that name; UnknownNameError suggests the nearest."""
    suites = _suites()
    if name in suites:
        return suites[name]
    for suite in suites.values():
        if name in suite.tasks:
            return replace(suite, name=name, tasks=(name,))
    known = [*suites, *(task for suite in suites.values() for task in suite.tasks)]
    raise UnknownNameError("suite or task", name, dict.fromkeys(known))


def placed(suite: Suite, poses: Poses) -> Suite:
    """The suite with its objects placed like that; UsageError where it has a way of its own."""
    if suite.poses is None:
        raise UsageError(f"{suite.name} draws its scenes from the seed. --poses is for simpler and its tasks.")
    return replace(
        suite,
        poses=poses,
        episodes=LAYOUTS if poses.on_grid else MOST_EPISODES,
        run_episode=partial(simpler.run_episode, poses=poses),
        repeat=partial(simpler.repeat, poses=poses),
    )
