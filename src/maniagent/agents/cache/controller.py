"""A controller that remembers: what worked before is served again, and nobody is asked (ManiAgent, section III-D)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

from ...types import ActionSequence, ObjectInfo, Subtask, SubtaskRecord, Verdict
from ..events import EventLog
from ..protocols import Agents, ControllerAgent
from .entry import Kind, as_kept, as_served, keys_of, may_keep
from .store import CacheStore


@dataclass(frozen=True)
class Hit:
    """A sequence out of the cache."""

    kind: Kind
    """By what it was found."""
    sequence: ActionSequence


class Cache(Protocol):
    """Sequences that carried out sub-tasks before."""

    def find(self, subtask: Subtask) -> Hit | None:
        """The sequence for a sub-task, or None."""
        ...

    def learn(self, record: SubtaskRecord, refused: ActionSequence | None) -> None:
        """Take note of how a sequence was judged; `refused` is the one out of the cache that it took the place of."""
        ...


class ActionCache:
    """The cache in a file. An entry is written when its sub-task was judged achieved, and goes when it fails twice."""

    def __init__(self, store: CacheStore) -> None:
        self._store = store

    def find(self, subtask: Subtask) -> Hit | None:
        """By the sub-task's text, else by its normal form."""
        for key in keys_of(subtask.text, subtask.objects):
            entry = self._store.get(key)
            if entry is not None:
                return Hit(key.kind, as_served(entry, subtask.objects))
        return None

    def learn(self, record: SubtaskRecord, refused: ActionSequence | None) -> None:
        """Count a success or a failure under every key of the sub-task that its sequence is or may be kept under.

        A sub-task that was achieved although its sequence was cut short says nothing about the sequence.
        """
        if record.sequence is None:
            return
        for key in keys_of(record.text, record.queries):
            kept = as_kept(key, record.sequence, record.queries)
            if record.verdict is Verdict.FAILURE:
                self._store.blame(key, kept)
            elif record.verdict is Verdict.SUCCESS and record.outcome.completed and may_keep(key, kept):
                self._store.confirm(key, kept, refused)


def silent(hit: Hit | None) -> None:
    """Tell nobody."""


class CachingController:
    """A `ControllerAgent` that asks another one only for what isn't in the cache, or is refused today."""

    def __init__(self, inner: ControllerAgent, cache: Cache, tell: Callable[[Hit | None], None] = silent) -> None:
        """`tell` hears of every look into the cache."""
        self._inner, self._cache, self._tell = inner, cache, tell
        self._served: ActionSequence | None = None
        self._refused: ActionSequence | None = None
        self.calls_saved = 0
        """How often the inner controller didn't have to be asked."""

    def write(self, subtask: Subtask, objects: Sequence[ObjectInfo], feedback: str = "") -> ActionSequence:
        """What is cached for the sub-task; where that was refused or is missing, what the inner controller writes."""
        if feedback:
            if self._served is not None:
                self._served, self._refused = None, self._served
                self.calls_saved -= 1
            return self._inner.write(subtask, objects, feedback)
        hit = self._cache.find(subtask)
        self._tell(hit)
        self._served, self._refused = (hit.sequence if hit else None), None
        if hit is None:
            return self._inner.write(subtask, objects)
        self.calls_saved += 1
        return hit.sequence

    def learn(self, record: SubtaskRecord) -> None:
        """Into the cache; the inner controller hears it too."""
        self._cache.learn(record, self._refused)
        self._inner.learn(record)


def with_cache(agents: Agents, cache: Cache, log: EventLog) -> Agents:
    """The agents with a cache before their controller; every look into it is an event `cache`."""

    def tell(hit: Hit | None) -> None:
        found, sequence = ("", None) if hit is None else (hit.kind.value, hit.sequence)
        log.emit("cache", turn=log.turn, found=found, sequence=sequence)

    return replace(agents, controller=CachingController(agents.controller, cache, tell))
