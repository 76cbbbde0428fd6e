"""What the cache keeps: a wording, the sequence that it was carried out with, and how that went."""

from __future__ import annotations

import enum
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from ...types import ActionSequence, ActionStep
from .portable import has_fixed_point, is_portable
from .wording import normal_form, places, with_names, without_names

_LONGEST_DESCRIPTION = 500
"""Characters, by the schema of a step."""


class Kind(enum.StrEnum):
    """By what an entry is found."""

    TEXT = "text"
    """The sub-task's very text about the same objects, as in the paper."""
    FORM = "form"
    """Its normal form, whatever the objects are called."""


@dataclass(frozen=True)
class Key:
    """What a sub-task has to say, to be served an entry."""

    kind: Kind
    wording: str
    """Text or normal form."""
    objects: tuple[str, ...]
    """Names of the objects in the order of their indices; in a normal form, what stands for them."""


@dataclass(frozen=True)
class Entry:
    """One line of the cache."""

    id: int
    key: Key
    sequence: ActionSequence
    """With places instead of names in its descriptions where the key is a normal form."""
    successes: int
    failures: int
    failed_running: int
    """Failures since the last success."""
    created: str
    """ISO 8601, UTC."""
    judged: str
    """When it was last judged, likewise."""


def keys_of(text: str, queries: Sequence[str]) -> Iterator[Key]:
    """The keys by which a sub-task is looked up, the most exact first."""
    yield Key(Kind.TEXT, text, tuple(queries))
    form = normal_form(text, queries)
    if form is not None:
        yield Key(Kind.FORM, form, places(len(queries)))


def may_keep(key: Key, sequence: ActionSequence) -> bool:
    """Whether a sequence may be kept under a key: it holds no number of today's scene, and no unknown object."""
    if key.kind is Kind.FORM and has_fixed_point(sequence):
        return False
    return is_portable(sequence, key.wording) and all(index < len(key.objects) for index in _indices(sequence))


def as_kept(key: Key, sequence: ActionSequence, queries: Sequence[str]) -> ActionSequence:
    """A sequence as an entry under `key` keeps it."""
    return sequence if key.kind is Kind.TEXT else _described(sequence, lambda text: without_names(text, queries))


def as_served(entry: Entry, queries: Sequence[str]) -> ActionSequence:
    """An entry's sequence for the objects `queries`."""
    if entry.key.kind is Kind.TEXT:
        return entry.sequence
    return _described(entry.sequence, lambda text: with_names(text, queries))


def motion_of(sequence: ActionSequence) -> str:
    """What a sequence does, as text; two that differ in their descriptions only do the same."""
    return _described(sequence, lambda text: "-").model_dump_json()


def _described(sequence: ActionSequence, change: Callable[[str], str]) -> ActionSequence:
    def changed(step: ActionStep) -> ActionStep:
        return step.model_copy(update={"description": change(step.description)[:_LONGEST_DESCRIPTION]})

    return sequence.model_copy(update={"steps": tuple(map(changed, sequence.steps))})


def _indices(sequence: ActionSequence) -> Iterator[int]:
    for step in sequence.steps:
        for index in (getattr(step.anchor, "index", None), step.carrying, step.orientation.index):
            if index is not None:
                yield index
