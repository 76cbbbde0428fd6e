"""Reading what a model calls a thing: kind, colours and side, by the lexicon's words; whatever else it says is ignored.

Unlike `perception.referring`, which obeys a person and must understand every word, this reader is asked only what a
name is about.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

from ...perception.phrases import POSITIONS, RELATIONS, PhraseTable, Pick, Where, spelt
from ...perception.vocabulary import ANYTHING, Vocabulary

_WORD = re.compile(r"[^\W\d_]+")
_SIDES: Mapping[str, Pick] = {
    **spelt("left | leftmost", Pick.LEFT),
    **spelt("right | rightmost", Pick.RIGHT),
    **spelt("middle | centre | center | central", Pick.MIDDLE),
    **spelt("nearest | front | closest", Pick.NEAR),
    **spelt("far | farthest | furthest | back | rear", Pick.FAR),
}
_PLACES: PhraseTable[Where | Pick] = PhraseTable({**RELATIONS, **POSITIONS, **_SIDES})
_OTHERS = frozenset({"with", "holding", "containing", "under", "and", "between"})
"""Words after which something else is spoken of, as after "on" and its like."""


@dataclass(frozen=True)
class Said:
    """What a name says of a thing."""

    noun: str | None
    """A noun of the lexicon's vocabulary; None where no word of the name is one."""
    colours: frozenset[str] = frozenset()
    """Colour words of the vocabulary."""
    sides: frozenset[Pick] = frozenset()
    """Where among its alikes it is, in the viewer's eyes."""


@cache
def _tables() -> tuple[PhraseTable[str], PhraseTable[str], frozenset[str]]:
    vocabulary = Vocabulary.load()
    nouns = {spelling: noun for spelling, noun in vocabulary.noun_spellings().items() if noun != ANYTHING}
    return PhraseTable(nouns), PhraseTable(vocabulary.colour_spellings()), frozenset(nouns)


def read_name(name: str) -> Said:
    """What `name` is about: "left red chili on the plate" is a red pepper, on the left.

    The kind is the last noun before a word such as "on", "with" or "next to" that leads to another thing, so that
    "banana-yellow toy" is a toy, and "strawberry on the dish" a strawberry. A plural is read as one thing.
    """
    nouns, colours, spellings = _tables()
    words = [_singular(word, spellings) for word in _WORD.findall(name.casefold())]
    noun, hues, sides = None, set[str](), set[Pick]()
    start = 0
    while start < len(words):
        count = 1
        if place := _PLACES.match(words, start):
            meaning, count = place
            if isinstance(meaning, Pick):
                sides.add(meaning)
            elif noun is not None:
                break
            elif words[start] == "near":  # with no thing named before it: "the near cup"
                sides.add(Pick.NEAR)
        elif kind := nouns.match(words, start):
            noun, count = kind
        elif colour := colours.match(words, start):
            hue, count = colour
            hues.add(hue)
        elif words[start] in _OTHERS and noun is not None:
            break
        start += count
    return Said(noun, frozenset(hues), frozenset(sides))


def _singular(word: str, spellings: frozenset[str]) -> str:
    return word[:-1] if word.endswith("s") and word[:-1] in spellings else word
