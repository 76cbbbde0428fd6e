"""What a run tells the outside while it happens; recording and display subscribe here.

Kinds of events and their data:

| kind | data |
|---|---|
| run_started | instruction, task (or None), seed, agents (their name) |
| begun | instruction, budget, rig: what the loop was given |
| observed | turn, observation |
| described | turn, scene |
| reasoned | turn, subtask |
| located | turn, objects, detections |
| asked | turn, role, model, tokens_in, tokens_out, seconds, repairs, error: an exchange with a language model |
| cache | turn, found ("text", "form" or ""), sequence (the one that was served, or None) |
| checked | turn, keypoints, reason (why the robot refused them, or empty) |
| planned | turn, sequence, keypoints |
| move | turn, description, seconds (robot time the move will take) |
| homed | turn, report (of the way home) |
| executed | turn, report |
| failed | turn, stage, reason |
| frame | rgb, robot_time: the main view while the arm moves, for the video; only in runs that are recorded |
| run_finished | result, achieved (by the task's predicate; None where nobody knows) |
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any, Protocol

from ..types import Event


class Observer(Protocol):
    """Anything that wants to know what happens in a run."""

    def on_event(self, event: Event) -> None:
        """Take note of one event; must return quickly and must not change its data."""
        ...


class EventLog:
    """Stamps events with the time since its creation and hands them to every observer."""

    def __init__(self, observers: Sequence[Observer] = (), clock: Callable[[], float] = time.monotonic) -> None:
        self._observers = tuple(observers)
        self._clock = clock
        self._start = clock()
        self._turn = 0

    @property
    def turn(self) -> int:
        """The turn that was told of last, for those who tell of it without counting turns; 0 before the first."""
        return self._turn

    def emit(self, kind: str, **data: Any) -> None:
        """Tell every observer, in the order they were given."""
        self._turn = data.get("turn", self._turn)
        event = Event(kind, self._clock() - self._start, data)
        for observer in self._observers:
            observer.on_event(event)
