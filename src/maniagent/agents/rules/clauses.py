"""An instruction is cut into clauses, one verb each, before anything is understood."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from .tokens import Kind, Token
from .vocabulary import CLOSINGS, COURTESIES, SEPARATORS, VERBS


def clauses(tokens: Sequence[Token]) -> Iterator[list[Token]]:
    """Cut at full stops, at "then", and at commas and "and" that a verb follows; courtesies are left out."""
    words = [token.text for token in tokens]
    clause: list[Token] = []
    at = 0
    while at < len(tokens):
        separator = SEPARATORS.match(words, at)
        if separator or tokens[at].kind is Kind.STOP or (joins(tokens[at]) and _verb_at(tokens, words, at + 1)):
            yield from _stripped(clause)
            clause = []
            at += separator[1] if separator else 1
        elif not clause and (verb := VERBS.match(words, at)):
            clause.extend(tokens[at : at + verb[1]])  # whole, because "pick and place" has an "and"
            at += verb[1]
        else:
            if clause or not joins(tokens[at]):
                clause.append(tokens[at])
            at += 1
    yield from _stripped(clause)


def joins(token: Token) -> bool:
    """Whether a token is a comma or "and"."""
    return token.kind is Kind.COMMA or token.text == "and"


def _verb_at(tokens: Sequence[Token], words: Sequence[str], at: int) -> bool:
    return VERBS.match(words, _after_courtesies(tokens, words, at)) is not None


def _after_courtesies(tokens: Sequence[Token], words: Sequence[str], at: int) -> int:
    while at < len(tokens):
        courtesy = COURTESIES.match(words, at)
        if not courtesy and tokens[at].kind is not Kind.COMMA:
            break
        at += courtesy[1] if courtesy else 1
    return at


def _stripped(clause: Sequence[Token]) -> Iterator[list[Token]]:
    """The clause without the courtesies at its ends, if anything is left."""
    words = [token.text for token in clause]
    start, end = _after_courtesies(clause, words, 0), len(clause)
    while (closing := CLOSINGS.match_end(words[start:end])) or (start < end and joins(clause[end - 1])):
        end -= closing[1] if closing else 1
    if start < end:
        yield list(clause[start:end])
