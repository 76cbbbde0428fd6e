"""The log of a recorded run as a replay needs it: what the loop was given, what it told, how it ended."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from ..agents.loop import Budget
from ..console.folder import EVENTS
from ..console.journal import read_lines
from ..errors import UsageError
from ..perception.rig import Rig
from ..types import RunVerdict
from .rigs import rig_from_plain

Json = dict[str, Any]

LOOP: dict[str, tuple[str, ...]] = {
    "observed": (),
    "described": (),
    "reasoned": (),
    "located": (),
    "cache": ("found", "sequence"),
    "checked": ("reason",),
    "planned": (),
    "move": ("description", "seconds"),
    "homed": ("report",),
    "executed": ("report",),
    "failed": ("stage", "reason"),
}
"""Kinds of events that the loop tells, each the same in a replay, and what of their data a replay answers with."""


@dataclass(frozen=True)
class RecordedRun:
    """A run folder's log."""

    folder: Path
    agents: str
    """Name of the agents."""
    instruction: str
    budget: Budget
    rig: Rig
    events: tuple[Json, ...]
    """What the loop told, in order; all kinds are in LOOP and all have a turn."""
    verdict: RunVerdict | None
    """None where the run was cut short."""
    reason: str

    @property
    def complete(self) -> bool:
        """Whether the loop came to its own end."""
        return self.verdict not in (None, RunVerdict.ABORTED)


def read_run(folder: Path) -> RecordedRun:
    """Read a run folder, also of a run that was cut short.

    Raises UsageError where it is no run folder, its log is damaged, or nothing in it says what the run began with.
    """
    path = folder / EVENTS
    if not path.is_file():
        raise UsageError(f"{folder} is no run folder: {EVENTS} is missing.")
    try:
        lines = read_lines(path)
        started, begun, finished = (_first(lines, kind) for kind in ("run_started", "begun", "run_finished"))
        if started is None or begun is None:
            raise UsageError(
                f"{folder} can't be replayed: its log doesn't say what the run began with. The run was cut short "
                "before that, or recorded by a maniagent that didn't write it."
            )
        result = (finished or {}).get("result", {})
        return RecordedRun(
            folder=folder,
            agents=str(started["agents"]),
            instruction=str(begun["instruction"]),
            budget=TypeAdapter(Budget).validate_python(begun["budget"]),
            rig=rig_from_plain(begun["rig"]),
            events=tuple(_told_by_loop(lines)),
            verdict=RunVerdict(result["verdict"]) if finished else None,
            reason=str(result.get("reason", "")),
        )
    except OSError as error:
        raise UsageError(f"{path} can't be read: {error.strerror}.") from error
    except (ValueError, KeyError, TypeError, AttributeError, ValidationError) as error:
        raise UsageError(f"The log {path} is damaged: {error!r}") from error


def _first(lines: list[Json], kind: str) -> Json | None:
    return next((line for line in lines if line["kind"] == kind), None)


def _told_by_loop(lines: list[Json]) -> list[Json]:
    events = [line for line in lines if line["kind"] in LOOP]
    for event in events:
        missing = [name for name in LOOP[event["kind"]] if name not in event]
        if missing or not isinstance(event["turn"], int):
            raise ValueError(f"{event['kind']} of turn {event['turn']!r} without {', '.join(missing) or 'a number'}")
    return events
