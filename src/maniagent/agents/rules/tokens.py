"""Instruction text to tokens: words, full stops, commas, and quantities with their units resolved.

One regular expression reads from left to right; every alternative is bounded, so the time is linear in the text.
"""

from __future__ import annotations

import enum
import math
import re
import unicodedata
from collections.abc import Iterator
from dataclasses import dataclass

from .refusals import UnclearInstruction, quote

MAX_LENGTH = 1000
"""Characters; a longer instruction is refused."""
_FARTHEST = 2.0
"""m; a coordinate or distance beyond it was meant in another unit, or not meant."""


class Kind(enum.Enum):
    """What a token is."""

    WORD = enum.auto()
    COMMA = enum.auto()
    STOP = enum.auto()
    POINT = enum.auto()
    """`value` is (x, y) m."""
    LENGTH = enum.auto()
    """`value` is (metres,)."""
    ANGLE = enum.auto()
    """`value` is (radians,), not signed by a sense of rotation."""


@dataclass(frozen=True)
class Token:
    """A piece of the instruction."""

    kind: Kind
    text: str
    value: tuple[float, ...] = ()


_METRES = {"m": 1.0, "me": 1.0, "cm": 0.01, "ce": 0.01, "mm": 0.001, "mi": 0.001, "in": 0.0254}
"""Metres per unit, by the first two letters of its name."""
_UNIT = r"(?:mm|millimet(?:er|re)s?|cm|centimet(?:er|re)s?|inch(?:es)?|m|met(?:er|re)s?)\b"
_NUMBER = r"[-+]?(?:\d+(?:\.\d+)?|\.\d+)"
_UNITS = ("one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")
_TENS = ("ten", "twenty", "thirty", "forty", "fifty", "sixty", "seventy", "eighty", "ninety")
_SPOKEN = {word: str(n) for n, word in enumerate(_UNITS, start=1)} | {
    word: str(10 * n) for n, word in enumerate(_TENS, start=1)
}
_AMOUNT = rf"(?:{_NUMBER}|\b(?:{'|'.join(_SPOKEN)})\b)"
_TURNS = {"three quarter": 1.5 * math.pi, "quarter": 0.5 * math.pi, "half": math.pi, "full": 2 * math.pi}
_TOKEN = re.compile(
    rf"""
    (?P<point> [(\[]?\ ?(?:\bx\ ?[=:]?\ ?)?(?P<x>{_NUMBER})\ ?(?P<x_unit>{_UNIT})?\ ?
        (?: [,;]\ ?(?:y\ ?[=:]?\ ?)? | (?:and\ )?y\ ?[=:]?\ ? )(?P<y>{_NUMBER})\ ?(?P<y_unit>{_UNIT})?
        (?P<third>\ ?[,;]\ ?(?:z\ ?[=:]?\ ?)?{_NUMBER})?\ ?[)\]]?(?:\ ?(?P<both_unit>{_UNIT}))? )
  | (?P<length> (?P<metres>{_AMOUNT})\ ?(?P<unit>{_UNIT}) )
  | (?P<angle> (?P<turned>{_AMOUNT})\ ?(?P<angle_unit>°|deg\b|degrees?\b|rad\b|radians?\b) )
  | (?P<turn> \b(?:an?\ )?(?P<part>three\ quarter|quarter|half|full)s?(?:\ of)?(?:\ an?)?\ turn\b )
  | (?P<number> {_NUMBER} )
  | (?P<sense> \b(?:counter|anti)\ ?clockwise\b )
  | (?P<word> [^\W\d_]+ )
  | (?P<comma> [,:] )
  | (?P<stop> [.;!?] )
    """,
    re.VERBOSE,
)
_CONTRACTIONS = {"’": "'", "−": "-", "n't": " not", "'s": " is", "'d": " would", "'m": " am", "'ll": " will"}
_ORDINALS = {"1st": "first", "2nd": "second", "3rd": "third"}


def tokenize(text: str) -> tuple[Token, ...]:
    """The tokens of an instruction, in lower case.

    Raises UnclearInstruction where the text is empty, too long, or has a number without a unit, three coordinates,
    or a length beyond two metres. Coordinates without a unit are metres.
    """
    if len(text) > MAX_LENGTH:
        raise UnclearInstruction(f"The instruction has {len(text)} characters; at most {MAX_LENGTH} are read.")
    tokens = tuple(_tokens(_normalise(text)))
    if not any(token.kind is Kind.WORD for token in tokens):
        raise UnclearInstruction("The instruction has no words. Say for example 'put the carrot on the plate'.")
    return tokens


def _normalise(text: str) -> str:
    """Lower case, plain apostrophes and minus signs, no hyphens between letters, lines ended, single spaces."""
    text = unicodedata.normalize("NFKC", text).lower()
    for spelling, plain in (_CONTRACTIONS | _ORDINALS).items():
        text = text.replace(spelling, plain)
    text = re.sub(r"(?<=[^\W\d_])-(?=[^\W\d_])|(?<=\d)-(?=[^\W\d_])", " ", text)
    text = re.sub(r"[\n\r]+", " . ", re.sub(r"[–—]", " , ", text))
    return " ".join(text.split())


def _tokens(text: str) -> Iterator[Token]:
    for match in _TOKEN.finditer(text):
        said = match[0].strip()
        match match.lastgroup:
            case "point":
                yield Token(Kind.POINT, said, _point(match))
            case "length":
                yield Token(Kind.LENGTH, said, (_metres(match["metres"], match["unit"], said),))
            case "angle":
                degrees = not match["angle_unit"].startswith("rad")
                amount = _amount(match["turned"])
                yield Token(Kind.ANGLE, said, (math.radians(round(amount, 6)) if degrees else amount,))
            case "turn":
                yield Token(Kind.ANGLE, said, (_TURNS[match["part"]],))
            case "number":
                raise UnclearInstruction(f"The number {quote([said])} has no unit: say for example '10 cm'.")
            case "sense":
                yield Token(Kind.WORD, "counterclockwise")
            case "word":
                yield Token(Kind.WORD, said)
            case "comma":
                yield Token(Kind.COMMA, said)
            case _:
                yield Token(Kind.STOP, said)


def _amount(said: str) -> float:
    return float(_SPOKEN.get(said, said))


def _metres(number: str, unit: str | None, said: str) -> float:
    """A length in metres, to the micrometre; metres where no unit is said."""
    metres = round(_amount(number) * _METRES[(unit or "m")[:2]], 6)
    if not abs(metres) <= _FARTHEST:
        raise UnclearInstruction(
            f"{quote([said])} is farther than {_FARTHEST:g} m; coordinates without a unit are metres."
        )
    return metres


def _point(match: re.Match[str]) -> tuple[float, float]:
    """(x, y) in metres; a unit said once holds for both."""
    said = match[0].strip()
    if match["third"]:
        raise UnclearInstruction(
            f"{quote([said])} has three coordinates; a place on the table has two: '(0.30, 0.10)'."
        )
    last = match["both_unit"] or match["y_unit"] or match["x_unit"]
    return _metres(match["x"], match["x_unit"] or last, said), _metres(match["y"], match["y_unit"] or last, said)
