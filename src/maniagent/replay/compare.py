"""Compares what a replayed loop tells with what the recorded one told, value by value, floats bit by bit."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..console.journal import to_line
from ..types import Event
from .record import LOOP, Json, RecordedRun
from .robot import EndOfRecord

DECISIONS = frozenset({"described", "reasoned", "located", "cache", "planned"})
_BESIDE = frozenset({"time", "video_time", "files"})
"""What a line holds besides the event."""


@dataclass(frozen=True)
class Difference:
    """The first thing that is not as it was."""

    turn: int
    kind: str
    """Of the event."""
    where: str
    """Which value of the event, as in "keypoints[2].T_base_tcp[0][3]"; empty for the event as a whole."""
    recorded: Any
    replayed: Any

    def __str__(self) -> str:
        where = f"{self.kind} {self.where}".strip()
        return f"turn {self.turn}, {where}: recorded {_short(self.recorded)}, replayed {_short(self.replayed)}"


class Different(Exception):
    """Raised at the first difference; the replay ends there."""

    def __init__(self, difference: Difference) -> None:
        self.difference = difference
        super().__init__(str(difference))


class Comparison:
    """An Observer of the replay. Raises Different at the first difference, EndOfRecord past the end of the record."""

    def __init__(self, run: RecordedRun) -> None:
        self._run = run
        self.compared = 0
        """Events that were the same."""
        self.decisions = 0
        """Of these, those that say what the agents decided."""
        self.turn = 0
        """The last turn of which something was compared."""

    def on_event(self, event: Event) -> None:
        """Compare one event with the one that was recorded in its place."""
        if event.kind not in LOOP:
            return
        replayed = _told(json.loads(to_line(event)))
        if self.compared == len(self._run.events):
            if self._run.complete:
                raise Different(Difference(replayed["turn"], event.kind, "", "nothing more", replayed))
            raise EndOfRecord
        recorded = _told(self._run.events[self.compared])
        if replayed["kind"] != recorded["kind"]:
            raise Different(Difference(recorded["turn"], recorded["kind"], "", recorded, replayed))
        if found := _first_difference("", recorded, replayed):
            raise Different(Difference(recorded["turn"], recorded["kind"], *found))
        self.compared += 1
        self.decisions += event.kind in DECISIONS
        self.turn = recorded["turn"]


def _told(line: Json) -> Json:
    return {name: value for name, value in line.items() if name not in _BESIDE}


def _first_difference(where: str, recorded: Any, replayed: Any) -> tuple[str, Any, Any] | None:
    """Where two JSON values differ first, and what stands there; None where they are the same."""
    if isinstance(recorded, Mapping) and isinstance(replayed, Mapping):
        for name in [*recorded, *(name for name in replayed if name not in recorded)]:
            there = f"{where}.{name}" if where else name
            if found := _first_difference(there, recorded.get(name), replayed.get(name)):
                return found
        return None
    if _is_list(recorded) and _is_list(replayed) and len(recorded) == len(replayed):
        for index, (a, b) in enumerate(zip(recorded, replayed, strict=True)):
            if found := _first_difference(f"{where}[{index}]", a, b):
                return found
        return None
    # As text: 0.0 is not -0.0, 1 is not 1.0 and not True, and floats are written so that every bit counts.
    return None if json.dumps(recorded) == json.dumps(replayed) else (where, recorded, replayed)


def _is_list(value: Any) -> bool:
    return isinstance(value, Sequence) and not isinstance(value, str)


def _short(value: Any) -> str:
    text = value if isinstance(value, str) and value == "nothing more" else json.dumps(value, ensure_ascii=False)
    return text if len(text) <= 200 else f"{text[:200]}..."
