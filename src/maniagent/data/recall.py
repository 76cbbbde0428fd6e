"""Knowing a thing again that words don't tell any more: a marker in a hand isn't seen as what it was on the table."""

from __future__ import annotations

from dataclasses import dataclass

from ..agents.locating import UNMOVED
from ..agents.memory import Memory
from ..agents.protocols import Located, ObjectAgent
from ..errors import DetectionFailure
from ..perception.identity import find_again
from ..types import ExecutionReport, ObjectInfo, Observation, Subtask, SubtaskRecord


@dataclass(frozen=True)
class _Sighting:
    thing: ObjectInfo
    others: tuple[ObjectInfo, ...]
    """Everything else that was on the table."""


class RecallingObjectAgent:
    """An `ObjectAgent` that goes by the looks a thing had when another one found it last, where that one can't."""

    def __init__(self, inner: ObjectAgent) -> None:
        self._inner = inner
        self._last: dict[str, _Sighting] = {}

    def locate(self, subtask: Subtask, observation: Observation, memory: Memory) -> Located:
        """As the inner agent, which is reminded of what it found before where it can't tell by the words."""
        try:
            located = self._inner.locate(subtask, observation, memory)
        except DetectionFailure:
            sightings = [self._last.get(name) for name in subtask.objects]
            if None in sightings:
                raise
            known = [sighting for sighting in sightings if sighting is not None]
            located = self._inner.locate(subtask, observation, _reminded(subtask, known, memory))
        for thing in located.objects:
            others = (*(other for other in located.objects if other is not thing), *located.surroundings)
            self._last[thing.name] = _Sighting(thing, others)
        return located


def _reminded(subtask: Subtask, known: list[_Sighting], memory: Memory) -> Memory:
    """The memory, as though the sub-task had been tried once when the things were seen last."""
    things = tuple(sighting.thing for sighting in known)
    others = tuple(
        other for other in known[0].others if not any(find_again(thing, [other], UNMOVED) for thing in things)
    )
    tried = SubtaskRecord(
        subtask.text,
        things,
        ExecutionReport(completed=False, reached=0),
        queries=subtask.objects,
        surroundings=others,
    )
    reminded = Memory()
    for record in (tried, *memory):
        reminded.add(record)
    return reminded
