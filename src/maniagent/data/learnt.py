"""Moves out of a recorded run: what a model once reasoned and wrote is carried out again without asking it.

Only what was shown to work is taken: sub-tasks that were judged achieved, in their order, each with the sequence that
did it. A number that was read off that run's table fits no other, so a sequence that holds one is refused.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from pydantic import BaseModel, ValidationError

from ..agents.cache.portable import is_portable
from ..console.folder import EVENTS
from ..console.journal import read_lines
from ..errors import UsageError
from ..types import ActionSequence, RunVerdict, Verdict
from .moves import Move


class _Outcome(BaseModel):
    completed: bool
    reason: str = ""


class _Attempt(BaseModel):
    """Of a SubtaskRecord in the log, what is needed here."""

    text: str
    queries: tuple[str, ...]
    verdict: Verdict
    outcome: _Outcome
    sequence: ActionSequence | None

    @property
    def achieved(self) -> bool:
        """Whether the robot moved, and did what it was to do."""
        return self.verdict is Verdict.SUCCESS and self.sequence is not None


class _Result(BaseModel):
    """Of a RunResult."""

    instruction: str
    verdict: RunVerdict
    reason: str
    subtasks: tuple[_Attempt, ...]


class _Finished(BaseModel):
    """The last event of a run."""

    result: _Result
    achieved: bool | None = None
    """By the task's own condition, where there was one."""


def learnt_moves(folder: Path, instruction: str, called: Mapping[str, str] | None = None) -> tuple[Move, ...]:
    """The moves by which the run in `folder` carried out `instruction`; `called` gives objects other names.

    Raises UsageError for what is no whole run, for a run of another instruction or one that didn't achieve it, and for
    a sequence that fits that run's table only.
    """
    result = _achieved(folder, instruction)
    attempts = [attempt for attempt in result.subtasks if attempt.achieved]
    if not attempts:
        raise UsageError(f"Nothing can be learnt from {folder}: there was nothing left to do when it began.")
    names = {query for attempt in attempts for query in attempt.queries}
    if unknown := sorted(set(called or {}) - names):
        raise UsageError(
            f"{folder} speaks of no {', no '.join(unknown)}; its objects are {', '.join(map(repr, sorted(names)))}."
        )
    return tuple(_to_move(attempt, folder, instruction, called or {}) for attempt in attempts)


def _to_move(attempt: _Attempt, folder: Path, instruction: str, called: Mapping[str, str]) -> Move:
    sequence = attempt.sequence
    if sequence is None or not attempt.outcome.completed:
        raise UsageError(
            f"In {folder} {attempt.text!r} was achieved although the arm was cut short ({attempt.outcome.reason}), so "
            "that its sequence isn't known to work. Record another run."
        )
    # Said by the sub-task alone isn't enough: a model says there what it has read off the table.
    if not is_portable(sequence, instruction):
        raise UsageError(
            f"In {folder} {attempt.text!r} goes to a point or an angle that the instruction doesn't say: it fits the "
            "table of that run, and no other. Record another run, or say what is to be done with --do."
        )
    objects = tuple(called.get(query, query) for query in attempt.queries)
    return Move(text=attempt.text, objects=objects, sequence=sequence)


def _achieved(folder: Path, instruction: str) -> _Result:
    """How the run ended, if it ended well."""
    finished = _finished(folder)
    result = finished.result
    if result.instruction.strip() != instruction.strip():
        raise UsageError(
            f"{folder} is a run of {result.instruction!r}; the task says {instruction!r}. Name a run of this task."
        )
    if result.verdict is not RunVerdict.ACHIEVED:
        raise UsageError(f"{folder} achieved nothing to learn from; it ended as {result.verdict}: {result.reason}")
    if finished.achieved is False:
        raise UsageError(
            f"{folder} did not achieve its task: its agents thought so, but the task's own condition didn't hold."
        )
    return result


def _finished(folder: Path) -> _Finished:
    path = folder / EVENTS
    if not path.is_file():
        raise UsageError(f"{folder} is no run folder: {EVENTS} is missing.")
    try:
        last = next((line for line in reversed(read_lines(path)) if line.get("kind") == "run_finished"), None)
        if last is None:
            raise UsageError(f"The run in {folder} was cut short; only one that ended can be learnt from.")
        return _Finished.model_validate(last)
    except OSError as error:
        raise UsageError(f"{path} can't be read: {error.strerror}.") from error
    except ValueError as error:  # a ValidationError is one, too
        raise UsageError(f"The log {path} is damaged: {_first_line(error)}") from error


def _first_line(error: ValueError) -> str:
    if isinstance(error, ValidationError):
        fault = error.errors(include_url=False)[0]
        return f"{'.'.join(map(str, fault['loc']))}: {fault['msg']}."
    return str(error)
