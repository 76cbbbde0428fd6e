"""The tasks that come with maniagent: the paper's eight on the real table, and the four of Bridge/SimplerEnv."""

from __future__ import annotations

from functools import cache
from importlib import resources
from pathlib import Path

from ..errors import UnknownNameError
from .conditions import Condition, Truth
from .task import Episode, Task, load_task

__all__ = ["Condition", "Episode", "Task", "Truth", "get", "load_task", "names", "task_named"]


@cache
def _library() -> dict[str, Task]:
    folder = Path(str(resources.files(__package__))) / "library"
    tasks = [load_task(path) for path in sorted(folder.glob("*.yaml"))]
    return {task.name: task for task in tasks}


def names() -> tuple[str, ...]:
    """The names of all tasks: the paper's eight in its order, then Bridge's four."""
    return tuple(_library())


def get(name: str) -> Task:
    """The task of that name; UnknownNameError suggests the nearest."""
    try:
        return _library()[name]
    except KeyError:
        raise UnknownNameError("task", name, _library()) from None


def task_named(said: str) -> Task:
    """A task of the library by its name, or the one in a scene file by its path."""
    return load_task(Path(said)) if Path(said).suffix in (".yaml", ".yml") else get(said)
