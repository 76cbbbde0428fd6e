"""What a collection is told to do, and the folder that holds it.

collect.json         CollectSettings: the same command goes on from there
attempts-wNN.jsonl   one EpisodeInfo a line: every attempt of worker NN, whatever came of it
plan-wNN.json        what worker NN keeps free on its table
episodes/            staged episodes (staging.py), until they are in the dataset; quarantine/ within
dataset/             the LeRobotDataset v3
coverage.png, summary.json, summary.md
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from ..agents.cache import ActionCache, CacheStore
from ..envs.scene import describe_validation
from ..errors import ReasoningFailure, UsageError
from ..robots.sampling import Sampling
from ..tasks import task_named
from .disk import disk_errors_told, draft_of, write_whole
from .learnt import learnt_moves
from .moves import Move, check_moves, moves_of
from .outcome import THRESHOLD
from .starts import Pattern

SETTINGS = "collect.json"
Reset = Literal["robot", "teleport"]
Texts = Literal["subtask", "move"]
Span = tuple[float, float]


class CollectSettings(BaseModel):
    """All that decides what is collected: the same settings give the same episodes."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    task: str
    """A task's name, or the path of a scene file."""
    instruction: str
    """What the episodes are labelled with."""
    paraphrases: tuple[str, ...] = ()
    moves: Annotated[tuple[Move, ...], Field(min_length=1)]
    """How the task is carried out; the first object of the first one is brought back each time."""
    count: Annotated[int, Field(ge=1)]
    """Valid episodes wanted. It may be raised when a collection goes on."""
    seed: Annotated[int, Field(ge=0)] = 0
    workers: Annotated[int, Field(ge=1, le=256)] = 1
    pattern: Pattern = Pattern.SOBOL
    yaw: float | None = None
    """rad; None varies it."""
    x: Span | None = None
    y: Span | None = None
    """m: bounds on where objects start; None for the whole reachable table."""
    reset: Reset = "robot"
    texts: Texts = "subtask"
    """What each row says is being done: the sub-task, or the single move of it."""
    sampling: Sampling = Sampling()
    threshold: Annotated[float, Field(gt=0, le=0.2)] = THRESHOLD
    """m"""
    attempts: Annotated[int, Field(ge=1, le=10)] = 2
    """At one start, each of which begins with bringing the object there."""

    def quota(self, worker: int) -> int:
        """How many valid episodes a worker collects."""
        return self.count // self.workers + (worker < self.count % self.workers)

    def save(self, folder: Path) -> None:
        """Write them down, or compare with those that are there: a folder holds one collection.

        Raises UsageError where the folder holds another one, or something else, or can't be made or written to;
        SetupError where the disk is full.
        """
        path = folder / SETTINGS
        with disk_errors_told(folder):
            folder.mkdir(parents=True, exist_ok=True)
            if path.exists():
                self._compare(type(self).load(folder), folder)
            elif any(there != draft_of(path) for there in folder.iterdir()):
                raise UsageError(f"{folder} holds something that is no collection; name another folder.")
        write_whole(path, self.model_dump_json(indent=2) + "\n")

    @classmethod
    def load(cls, folder: Path) -> Self:
        """The settings of a collection; UsageError where the folder holds none that can be read."""
        try:
            return cls.model_validate_json((folder / SETTINGS).read_bytes())
        except FileNotFoundError:
            raise UsageError(f"{folder} is no collection: it has no {SETTINGS}.") from None
        except (OSError, ValidationError) as error:
            what = describe_validation(error) if isinstance(error, ValidationError) else str(error.strerror)
            raise UsageError(
                f"{folder / SETTINGS} can't be read: {what}. Restore it from a copy, or name another folder."
            ) from error

    def _compare(self, there: Self, folder: Path) -> None:
        mine, theirs = self.model_dump(), there.model_dump()
        other = [name for name in mine if name != "count" and mine[name] != theirs[name]]
        if other:
            said = ", ".join(f"{name} {theirs[name]!r}, not {mine[name]!r}" for name in other if name != "moves")
            raise UsageError(
                f"{folder} holds a collection with other settings ({said or 'other moves'}). Name another folder, or "
                "give the same settings; only the number of episodes may be changed."
            )


def checked_settings(
    task: str,
    do: str | None,
    cache: Path | None,
    *,
    run: Path | None = None,
    called: Mapping[str, str] | None = None,
    **said: Any,
) -> CollectSettings:
    """Settings for a task by its name or scene file, with the moves that carry it out.

    Those are what `do`, else its own instruction, takes, out of `cache` first; or what was done in the folder of a
    recorded `run`, in which objects may be `called` otherwise.

    Raises UsageError for an unknown task, one that draws its instruction anew each time, settings that make no sense,
    moves that can't be collected, and what takes a language model to carry out.
    """
    chosen = task_named(task)
    if chosen.points:
        raise UsageError(f"{task} draws the points of its instruction: say one with --do to collect for it.")
    if not chosen.success:
        raise UsageError(f"{task} says of no object where it should be; a scene to collect in needs `success`.")
    if run is not None and (do is not None or cache is not None):
        raise UsageError("--from takes the moves out of a run; leave out --do and --cache.")
    if called and run is None:
        raise UsageError("--call renames the objects of a run; it needs --from.")
    if run is not None:
        moves = learnt_moves(run, chosen.instruction, called)
    else:
        moves = _plain_moves(do or chosen.instruction, cache)
    check_moves(moves)
    try:
        return CollectSettings(task=task, instruction=chosen.instruction, moves=moves, **said)
    except ValidationError as error:
        raise UsageError(describe_validation(error)) from error


def resumed_settings(folder: Path, task: str, count: int | None = None) -> CollectSettings:
    """The settings with which the collection in a folder was begun; `count`, where given, is the new one.

    Raises UsageError where there is none, or it is one of another task.
    """
    there = CollectSettings.load(folder)
    if there.task != task:
        raise UsageError(f"{folder} is a collection of {there.task}, not of {task}.")
    return there if count is None else there.model_copy(update={"count": count})


def _plain_moves(instruction: str, cache: Path | None) -> tuple[Move, ...]:
    store = ActionCache(CacheStore(cache, must_exist=True)) if cache is not None else None
    try:
        return moves_of(instruction, store)
    except ReasoningFailure as failure:
        raise UsageError(
            f"{failure} Say with --do, in plain commands, what carries it out, or take it from a run with --from."
        ) from failure


def phrases_in(path: Path) -> tuple[str, ...]:
    """The paraphrases in a file, one a line. Raises UsageError where it can't be read, or says none."""
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except OSError as error:
        raise UsageError(f"{path} can't be read: {error.strerror}.") from error
    except UnicodeDecodeError as error:
        raise UsageError(f"{path} is no text in UTF-8.") from error
    phrases = tuple(dict.fromkeys(line.strip() for line in lines if line.strip()))
    if not phrases:
        raise UsageError(f"{path} says nothing; it should have a paraphrase a line.")
    return phrases


def read_calls(said: Sequence[str]) -> dict[str, str]:
    """From "NAME=OTHER" to what each name is to be. Raises UsageError for anything else."""
    called = {}
    for text in said:
        name, equals, other = (part.strip() for part in text.partition("="))
        if not (name and equals and other) or name in called:
            raise UsageError(f"--call takes NAME=OTHER, each name once, as in --call 'brown egg=egg'; not {text!r}.")
        called[name] = other
    return called
