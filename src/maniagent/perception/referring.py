"""Noun phrases to what they ask for: "second red block from the left that is on the plate".

Grammar (lower case, without hyphens):

    phrase   = ["any"] {adjective} noun [position] [["that is"] relation phrase]
    adjective = colour | size | side | ordinal | a word that says nothing visible
    position = "in the middle", "on the far left", "from the left" (after an ordinal), ...
    relation = "left of", "next to", "on", "closest to", ...

Sides are the viewer's. Words that are not in the vocabulary are complained about, never skipped.
"""

from __future__ import annotations

import enum
from collections.abc import Sequence
from dataclasses import dataclass, replace

from ..errors import DetectionFailure
from .phrases import COUNTED_FROM, POSITIONS, RELATIONS, PhraseTable, Pick, Where, scan, spelt
from .vocabulary import Vocabulary, nearest_word


class Size(enum.StrEnum):
    """Which of several alikes, by size; the value is the plainest superlative."""

    LARGEST = "largest"
    SMALLEST = "smallest"
    LONGEST = "longest"
    SHORTEST = "shortest"
    TALLEST = "tallest"
    FLATTEST = "flattest"


@dataclass(frozen=True)
class Reference:
    """What a noun phrase asks for."""

    phrase: str
    """As said, for messages."""
    noun: str
    """A noun of the vocabulary, or `vocabulary.ANYTHING`."""
    colours: tuple[str, ...] = ()
    sizes: tuple[Size, ...] = ()
    pick: Pick | None = None
    """Which of several, in the viewer's eyes; with an ordinal, where to count from."""
    ordinal: int | None = None
    """From 1."""
    where: Where | None = None
    landmark: Reference | None = None
    """What `where` is relative to; None with a `where` stands for the table itself."""
    anyone: bool = False
    """Any of several alikes will do."""


_ARTICLES = frozenset(spelt("a | an | the | this | that", True))
_TABLE = frozenset(spelt("table | tabletop | desk", True))
_RELATIVE = "relative"
_MARKERS: PhraseTable[Where | Pick | str] = PhraseTable(
    {**RELATIONS, **POSITIONS, **COUNTED_FROM, **spelt("that is | which is | lying | standing", _RELATIVE)}
)
_PICKS = {
    **spelt("left | leftmost", Pick.LEFT),
    **spelt("right | rightmost", Pick.RIGHT),
    **spelt("middle | central | centre | center", Pick.MIDDLE),
    **spelt("nearest | closest | front | near", Pick.NEAR),
    **spelt("farthest | furthest | back | rear | far", Pick.FAR),
}
_SIZES = {
    **spelt("big | bigger | biggest | large | larger | largest", Size.LARGEST),
    **spelt("small | smaller | smallest | little | tiny", Size.SMALLEST),
    **spelt("long | longer | longest", Size.LONGEST),
    **spelt("short | shorter | shortest", Size.SHORTEST),
    **spelt("tall | taller | tallest | high | highest", Size.TALLEST),
    **spelt("flat | flatter | flattest", Size.FLATTEST),
}
_ORDINALS = {word: n for n, word in enumerate(("first", "second", "third", "fourth", "fifth", "sixth"), start=1)}


def read_reference(phrase: str, vocabulary: Vocabulary) -> Reference:
    """What `phrase` asks for.

    Raises DetectionFailure where a word is not in the vocabulary (and names the nearest one that is), where several
    things are meant, or where no noun is said.
    """
    words = phrase.lower().replace("-", " ").split()
    return _Reader(vocabulary).read(words)


class _Reader:
    """Reads phrases against one vocabulary."""

    def __init__(self, vocabulary: Vocabulary) -> None:
        self._nouns = vocabulary.noun_spellings()
        self._colours = vocabulary.colour_spellings()
        self._unseen = frozenset(vocabulary.unseen)
        self._known = {**self._nouns, **self._colours, **_PICKS, **_SIZES, **_ORDINALS}

    def read(self, words: Sequence[str]) -> Reference:
        """One phrase; landmarks are read in turn."""
        while words and words[0] in _ARTICLES:
            words = words[1:]
        head: list[str] = []
        pick: Pick | None = None
        at = 0
        for said, meaning in scan(_MARKERS, words):
            at += len(said)
            if isinstance(meaning, Where):
                reference = self._relate(self._head(head, words), meaning, words[at:])
                return replace(reference, pick=pick or reference.pick)
            if isinstance(meaning, Pick):
                pick = meaning
            elif meaning is None:
                head += said
        reference = self._head(head, words)
        return replace(reference, pick=pick or reference.pick)

    def _relate(self, reference: Reference, where: Where, rest: Sequence[str]) -> Reference:
        landmark_words = [word for word in rest if word not in _ARTICLES]
        if where is Where.ON and len(landmark_words) == 1 and landmark_words[0] in _TABLE:
            return replace(reference, where=where)
        return replace(reference, where=where, landmark=self.read(rest))

    def _head(self, head: Sequence[str], words: Sequence[str]) -> Reference:
        """Adjectives and noun: the longest known noun that ends the head."""
        anyone = bool(head) and head[0] == "any"
        phrase = " ".join(words[anyone:])
        said = [word for word in head[anyone:] if word not in _ARTICLES]
        for start in range(len(said)):
            noun = self._noun(" ".join(said[start:]), anyone)
            if noun is not None:
                return self._adjectives(said[:start], Reference(phrase, noun, anyone=anyone))
        if not said or said[-1] in self._known:
            raise DetectionFailure(f"'{phrase}' names no object: add a noun, as in 'red block' or 'left one'.")
        raise DetectionFailure(f"The lexicon has no word '{said[-1]}'.{nearest_word(said[-1], self._nouns)}")

    def _noun(self, said: str, anyone: bool) -> str | None:
        if said in self._nouns:
            return self._nouns[said]
        for plural, singular in (("ies", "y"), ("ves", "fe"), ("es", ""), ("s", "")):
            one = said.removesuffix(plural) + singular
            if said.endswith(plural) and one in self._nouns:
                if anyone:
                    return self._nouns[one]
                raise DetectionFailure(f"'{said}' are several; say which {one}, one at a time.")
        return None

    def _adjectives(self, words: Sequence[str], reference: Reference) -> Reference:
        colours: list[str] = []
        sizes: list[Size] = []
        for word in words:
            if word in self._colours:
                colours.append(self._colours[word])
            elif word in _SIZES:
                sizes.append(_SIZES[word])
            elif word in _PICKS:
                reference = replace(reference, pick=_PICKS[word])
            elif word in _ORDINALS:
                reference = replace(reference, ordinal=_ORDINALS[word])
            elif word == "last":
                reference = replace(reference, pick=Pick.RIGHT)
            elif word not in self._unseen:
                raise DetectionFailure(f"The lexicon has no word '{word}'.{nearest_word(word, self._known)}")
        return replace(reference, colours=tuple(colours), sizes=tuple(sizes))
