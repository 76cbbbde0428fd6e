"""Words for where things are: what "left of", "in the middle" and their many spellings mean.

Shared by the two readers of English: the parser of instructions and the reader of noun phrases. Everything here is
in lower case without hyphens; sides are the viewer's (see `viewpoint`).
"""

from __future__ import annotations

import enum
from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from typing import Generic, TypeVar

T = TypeVar("T")


class Where(enum.StrEnum):
    """How one thing lies relative to another; the value is the plainest way to say it."""

    ON = "on"
    IN = "in"
    NEXT_TO = "next to"
    LEFT_OF = "left of"
    RIGHT_OF = "right of"
    IN_FRONT_OF = "in front of"
    BEHIND = "behind"
    CLOSEST = "closest to"
    FARTHEST = "farthest from"


class Pick(enum.StrEnum):
    """Which of several alikes, by where they lie in the viewer's eyes."""

    LEFT = "left"
    RIGHT = "right"
    MIDDLE = "middle"
    NEAR = "nearest"
    FAR = "farthest"


class PhraseTable(Generic[T]):
    """Phrases of one or more words and what they mean; the longest that fits wins."""

    def __init__(self, meanings: Mapping[str, T]) -> None:
        self._meanings = {tuple(phrase.split()): meaning for phrase, meaning in meanings.items()}
        self._longest = max(map(len, self._meanings))

    def match(self, words: Sequence[str], start: int = 0) -> tuple[T, int] | None:
        """The meaning and the word count of the longest phrase that begins at `start`, or None."""
        for count in range(min(self._longest, len(words) - start), 0, -1):
            phrase = tuple(words[start : start + count])
            if phrase in self._meanings:
                return self._meanings[phrase], count
        return None

    def match_end(self, words: Sequence[str]) -> tuple[T, int] | None:
        """The meaning and the word count of the longest phrase that ends `words`, or None."""
        for count in range(min(self._longest, len(words)), 0, -1):
            phrase = tuple(words[len(words) - count :])
            if phrase in self._meanings:
                return self._meanings[phrase], count
        return None


def scan(table: PhraseTable[T], words: Sequence[str]) -> Iterator[tuple[tuple[str, ...], T | None]]:
    """`words` cut into known phrases with their meaning, and single other words with None.

    "On the left" is a position at the end of a noun phrase; in "on the left plate" it is "on", and a plate.
    """
    start = 0
    while start < len(words):
        meaning, count = table.match(words, start) or (None, 1)
        noun_follows = start + count < len(words) and not table.match(words, start + count)
        if isinstance(meaning, Pick) and noun_follows:
            meaning, count = table.match(words[: start + 1], start) or (None, 1)
        yield tuple(words[start : start + count]), meaning
        start += count


def spelt(text: str, meaning: T) -> dict[str, T]:
    """One meaning for each of the phrases in `text`, which "|" separates."""
    return dict.fromkeys((" ".join(phrase.split()) for phrase in text.split("|")), meaning)


def _with_sides(where: Where, side: str) -> dict[str, Where]:
    """Say "left of", "to the left of", "on the left hand side of" and their like."""
    leads, tails = ("", "to the ", "on the ", "at the "), ("", " side", " hand side")
    return {f"{lead}{side}{tail} of": where for lead, tail in product(leads, tails)}


RELATIONS: Mapping[str, Where] = {
    **spelt("on | onto | on to | on top of | upon | atop", Where.ON),
    **spelt("in | into | in to | inside | inside of | within", Where.IN),
    **spelt("next to | beside | near | near to | close to | alongside | adjacent to", Where.NEXT_TO),
    **_with_sides(Where.LEFT_OF, "left"),
    **_with_sides(Where.RIGHT_OF, "right"),
    **spelt("in front of | at the front of", Where.IN_FRONT_OF),
    **spelt("behind | in back of | at the back of", Where.BEHIND),
    **spelt("closest to | nearest to", Where.CLOSEST),
    **spelt("farthest from | furthest from", Where.FARTHEST),
}
"""Phrases that are followed by a landmark."""

_PLACES: Mapping[str, Pick] = {
    **spelt("left | leftmost | left side | left hand side", Pick.LEFT),
    **spelt("right | rightmost | right side | right hand side", Pick.RIGHT),
    **spelt("middle | centre | center", Pick.MIDDLE),
    **spelt("front", Pick.NEAR),
    **spelt("back | rear", Pick.FAR),
}

POSITIONS: Mapping[str, Pick] = {
    f"{lead} the {degree}{place}": pick
    for lead, degree, (place, pick) in product(("in", "on", "at", "to"), ("", "far ", "very "), _PLACES.items())
}
"""Phrases that follow a noun and pick one of several: "in the middle", "on the far left"."""

COUNTED_FROM: Mapping[str, Pick] = {
    f"from the {place}": pick for place, pick in _PLACES.items() if pick is not Pick.MIDDLE
}
"""Where an ordinal counts from: "second from the left"."""
