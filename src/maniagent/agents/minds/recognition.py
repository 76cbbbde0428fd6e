"""What was found before needn't be asked for again: by its looks and its place it is known to be the same thing."""

from __future__ import annotations

from collections.abc import Sequence

from ...perception.identity import find_again
from ...perception.segments import Segment
from ...types import ObjectInfo, Subtask, SubtaskRecord, Verdict
from ..locating import UNMOVED, find_tried, last_tried
from ..memory import Memory
from .telling import plain


def attempts_at(subtask: Subtask, memory: Memory) -> tuple[SubtaskRecord, ...]:
    """The unbroken run of latest attempts with the same objects: a model may word the same thing in another way."""
    tail: list[SubtaskRecord] = []
    for record in reversed(memory.records):
        if record.queries != subtask.objects or record.verdict is Verdict.SUCCESS:
            break
        tail.append(record)
    return tuple(reversed(tail))


def recognise(subtask: Subtask, memory: Memory, segments: Sequence[Segment]) -> dict[int, int]:
    """By index of the query: the index of the segment that is known to be meant.

    That is what an attempt that broke off on the way was after, wherever it went, and what served as the target of a
    sub-task that was achieved, where it still is. After an attempt that never began to move, or made every movement
    and failed all the same, the wrong thing may have been meant: nothing of it is taken for granted.
    """
    attempts = attempts_at(subtask, memory)
    if attempts and attempts[-1].outcome.completed:
        return {}
    broke_off = attempts if attempts and attempts[-1].outcome.reached > 0 else ()
    known = {}
    for i, query in enumerate(subtask.objects):
        tried = last_tried(broke_off, i)
        k = _unmoved(query, memory, segments) if tried is None else find_tried(tried, i, segments)
        if k is not None:
            known[i] = k
    return known if len(set(known.values())) == len(known) else {}


def _unmoved(query: str, memory: Memory, segments: Sequence[Segment]) -> int | None:
    """The segment that was called `query` when something was brought to it."""
    before = _target(query, memory)
    now = [segment.to_object(k, query) for k, segment in enumerate(segments)]
    again = None if before is None else find_again(before, now, UNMOVED)
    return None if again is None else again.index


def _target(query: str, memory: Memory) -> ObjectInfo | None:
    """What was called `query` at last, if it was the target of a sub-task that was achieved."""
    for record in reversed(memory.records):
        for thing in record.objects:
            if plain(thing.name) == plain(query):
                return thing if thing.index > 0 and record.verdict is Verdict.SUCCESS else None
    return None
