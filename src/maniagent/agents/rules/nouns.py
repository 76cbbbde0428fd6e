"""Noun phrases: from words as said to the one spelling that commands carry.

"the red block which is lying to the left of the plate" becomes "red block that is left of the plate". What a
phrase means on the table is the lexicon's to say; here it is only made sure that it names one object.
"""

from __future__ import annotations

import enum
from collections.abc import Sequence
from itertools import product

from ...perception.phrases import COUNTED_FROM, POSITIONS, RELATIONS, PhraseTable, Pick, Where, scan, spelt
from .refusals import NeedsLanguageModel, UnclearInstruction, quote, refuse_what_names_no_object


class Mark(enum.Enum):
    """What a phrase does, where it is not simply a place (Where, Pick)."""

    RELATIVE = enum.auto()
    """What follows describes the noun before it: "that is"."""
    ONTO = enum.auto()
    """On, as a goal only."""
    INTO = enum.auto()
    """In, as a goal only."""
    TO = enum.auto()
    """Some goal: the verb decides."""
    OFF = enum.auto()
    """Where the object is taken from: on ... now."""
    OUT_OF = enum.auto()
    """Where the object is taken from: in ... now."""
    UNKNOWN = enum.auto()
    """A place the rules can't work out."""


GOALS = (Mark.ONTO, Mark.INTO, Mark.TO)
Meaning = Where | Pick | Mark

_RELATIVES = [
    f"{who} {how}".strip()
    for who, how in product(
        ("that is", "which is", ""), ("", "currently", "lying", "sitting", "standing", "resting", "placed", "located")
    )
    if who or how not in ("", "currently")
]
PHRASES: PhraseTable[Meaning] = PhraseTable(
    {
        **RELATIONS,
        **POSITIONS,
        **COUNTED_FROM,
        **dict.fromkeys(_RELATIVES, Mark.RELATIVE),
        **spelt("at | by", Where.NEXT_TO),
        **{f"{lead} the {middle} of": Mark.ONTO for lead in ("in", "on") for middle in ("middle", "centre", "center")},
        **spelt("onto | on to | on top of", Mark.ONTO),
        **spelt("into | in to", Mark.INTO),
        **{f"{lead} {on}": Mark.ONTO for lead in ("back", "down") for on in ("on", "onto", "on to", "on top of")},
        **{f"{lead} {into}": Mark.INTO for lead in ("back", "down") for into in ("in", "into", "in to", "inside")},
        **spelt("to | towards | toward | over to | back to | up to", Mark.TO),
        **spelt("off | off of | from | from on", Mark.OFF),
        **spelt("out of | from inside | from within", Mark.OUT_OF),
        **spelt("between | under | below | beneath | underneath | above | over | around | across", Mark.UNKNOWN),
        **spelt("against | opposite | along | through | closer to | nearer to | away from | far from", Mark.UNKNOWN),
        **{f"{lead} the {part} of": Mark.UNKNOWN for lead in ("on", "at", "in") for part in ("corner", "edge", "rim")},
    }
)
DETERMINERS = frozenset(spelt("a | an | the | this | that | these | those | any", True))
PRONOUNS = frozenset(spelt("it | them | this | that | these | those", True))
_LONGEST = 160
"""Characters of a noun phrase."""
_SAID_AS: dict[Meaning, str] = {Mark.ONTO: "on", Mark.INTO: "in", Mark.OFF: "on", Mark.OUT_OF: "in"}


def noun_phrase(words: Sequence[str]) -> str:
    """The canonical spelling of a noun phrase, without its article.

    Raises UnclearInstruction for a phrase without a noun, of several objects, or with a place the rules don't know,
    and NeedsLanguageModel for one that is no description by looks and places.
    """
    refuse_what_names_no_object(words)
    anyone = list(words[:1]) == ["any"] or list(words[:3]) == ["one", "of", "the"]
    phrase = " ".join([*(["any"] if anyone else []), *_spelling(words)])
    if len(phrase) > _LONGEST:
        raise UnclearInstruction(f"{quote(words)} is too long for one object: describe it in {_LONGEST} characters.")
    return phrase


def _spelling(words: Sequence[str]) -> list[str]:
    said: list[str] = []
    named = False  # a noun may have been said; relations and positions need one before them
    relative = False  # "that is" has just been said
    for phrase, meaning in scan(PHRASES, _without_article(words)):
        if meaning is None and relative:
            raise NeedsLanguageModel(f"{quote(words)} describes an object by more than its looks and place.")
        if meaning is None and phrase[0] in DETERMINERS:
            if named:
                raise NeedsLanguageModel(f"{quote(words)} is no name of one object.")
        elif meaning is None:
            said += phrase
            named = True
        elif not named or (relative and meaning is Mark.RELATIVE):
            raise _missing_noun(words)
        elif isinstance(meaning, Pick):
            said += phrase
        elif meaning is not Mark.RELATIVE:
            said += _relation(meaning, words)
            named = False
        relative = meaning is Mark.RELATIVE
    if not named or relative:
        raise _missing_noun(words)
    return said


def _missing_noun(words: Sequence[str]) -> UnclearInstruction:
    return UnclearInstruction(f"{quote(words)} doesn't say which object: a noun is missing.")


def _without_article(words: Sequence[str]) -> list[str]:
    start = 3 if list(words[:3]) == ["one", "of", "the"] else 0
    while start < len(words) and words[start] in DETERMINERS:
        start += 1
    return list(words[start:])


def _relation(meaning: Meaning, words: Sequence[str]) -> list[str]:
    """How a relation to the landmark that follows is spelt within a noun phrase."""
    if meaning in (Where.CLOSEST, Where.FARTHEST):
        return [str(meaning.value), "the"]
    if isinstance(meaning, Where):
        return ["that is", meaning.value, "the"]
    if meaning in _SAID_AS:
        return ["that is", _SAID_AS[meaning], "the"]
    raise UnclearInstruction(
        f"{quote(words)} describes a place the rules can't work out. They know: "
        f"{', '.join(where.value for where in Where)}, and '(0.30, 0.10)'."
    )
