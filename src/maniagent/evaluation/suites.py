"""What is evaluated, by name: tasks that belong together, and how one episode of them is run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Protocol

from .. import tasks
from ..errors import UnknownNameError
from . import tabletop
from .episode import EpisodeResult, Job


class RunEpisode(Protocol):
    """Plays one episode of a task."""

    def __call__(self, task: str, seed: int, episode: int, actor: str, out: Path | None) -> EpisodeResult:
        """Play it, with a run folder at `out` where one is wanted, and say what became of it.

        Whatever it raises counts as a failed episode, except for UsageError and SetupError, which end the evaluation.
        """
        ...


@dataclass(frozen=True)
class Suite:
    """Tasks that are measured together. Its functions stand at the top of a module: worker processes import them."""

    name: str
    tasks: tuple[str, ...]
    run_episode: RunEpisode
    repeat: Callable[[Job, str], str]
    """The command that plays a job again, given the actor's name."""


@cache
def _suites() -> dict[str, Suite]:
    library = [tasks.get(name) for name in tasks.names()]
    members = {
        "paper8": [task for task in library if task.suite == "paper8"],
        "bridge": [task for task in library if task.suite == "bridge"],
        "tabletop4": [task for task in library if task.suite == "paper8" and not task.needs_model],
        "tabletop": [task for task in library if not task.needs_model],
    }
    return {
        name: Suite(name, tuple(task.name for task in chosen), tabletop.run_episode, tabletop.repeat)
        for name, chosen in members.items()
    }


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
