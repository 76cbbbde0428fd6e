"""Imperative English to commands, by rules alone.

An instruction is cut into clauses (full stops, "then", "and" before a verb), a clause into its verb and parts
("the carrot and the egg on the plate"), a part into an object and a goal. Where English leaves two readings open,
or something is missing, the parser says so and how to say it; it never guesses, and it knows nothing of the world.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from ...perception.phrases import POSITIONS, PhraseTable, Where, scan
from .clauses import clauses, joins
from .commands import Action, Command, Direction, Relation
from .nouns import DETERMINERS, GOALS, PHRASES, PRONOUNS, Mark, noun_phrase
from .refusals import NeedsLanguageModel, UnclearInstruction, quote, refuse_what_needs_judgement
from .tokens import Kind, Token, tokenize
from .vocabulary import BEFORE_POINT, DIRECTIONS, SENSES, TABLE, VERBS

__all__ = ["Command", "NeedsLanguageModel", "UnclearInstruction", "parse_instruction"]

MAX_COMMANDS = 20
_POSITIONS = PhraseTable(POSITIONS)


@dataclass(frozen=True)
class _Goal:
    """What is to become of an object: the fields of a Command without its verb and object."""

    relation: Relation | None = None
    target: str | None = None
    point: tuple[float, float] | None = None
    angle: float | None = None
    direction: Direction | None = None
    distance: float | None = None


def parse_instruction(text: str) -> tuple[Command, ...]:
    """The commands that `text` gives, in order; at least one, at most `MAX_COMMANDS`.

    Coordinates are in the base frame, metres unless a unit is said; directions are the viewer's; angles without
    a sense are counter-clockwise seen from above. "It" is the object of the clause before.

    Raises NeedsLanguageModel where the text is no imperative the rules know or asks for common sense, and
    UnclearInstruction where a command is understood in part only.
    """
    commands: list[Command] = []
    latest: list[Command] = []
    for clause in clauses(tokenize(text)):
        following = _parse_clause(clause, latest)
        carried_on = {command.object for command in following if command.action is not Action.PICK_UP}
        commands = [*commands[: len(commands) - len(latest)], *_not_merely_picked(latest, carried_on), *following]
        latest = following
        if len(commands) > MAX_COMMANDS:
            raise UnclearInstruction(f"The instruction has more than {MAX_COMMANDS} commands; give them in portions.")
    if not commands:
        raise NeedsLanguageModel(f"{quote([text.strip()])} is no command.")
    for command in commands[:-1]:
        if command.action is Action.PICK_UP:
            raise UnclearInstruction(f"Where should the {command.object} be put down before the next step?")
    return tuple(commands)


def _not_merely_picked(commands: Sequence[Command], carried_on: set[str]) -> list[Command]:
    """Drop "pick up X" where "put it on Y" follows: the second says it all."""
    return [c for c in commands if c.action is not Action.PICK_UP or c.object not in carried_on]


# From clause to commands ----------------------------------------------------------------------------------------


def _parse_clause(clause: Sequence[Token], latest: Sequence[Command]) -> list[Command]:
    words = [token.text for token in clause]
    refuse_what_needs_judgement(words)
    verb = VERBS.match(words)
    if verb is None:
        raise NeedsLanguageModel(f"{quote(words)} doesn't begin with a verb that the rules know.")
    action, count = verb
    commands: list[Command] = []
    waiting: list[str] = []
    for part in _parts(clause[count:]):
        said, goal = _read_part(part, action)
        if said or not waiting:
            waiting += _objects(said, latest, action)
        if goal is None and action is not Action.PICK_UP:
            continue
        done = Action.PLACE if goal and action is Action.PICK_UP else action
        commands += [_command(done, name, goal or _Goal()) for name in waiting]
        waiting = []
    if waiting:
        raise _missing_goal(action, waiting[-1])
    if not commands:
        raise _missing_object(action)
    return commands


def _parts(tokens: Sequence[Token]) -> Iterator[list[Token]]:
    part: list[Token] = []
    for token in tokens:
        if not joins(token):
            part.append(token)
        elif part:
            yield part
            part = []
    if part:
        yield part


def _command(action: Action, name: str, goal: _Goal) -> Command:
    if action is Action.STACK and goal.relation is not Relation.ON:
        raise UnclearInstruction(f"On what should the {name} be stacked? Say 'stack the {name} on the ...'.")
    return Command(action=action, object=name, **vars(goal))


def _objects(said: Sequence[str], latest: Sequence[Command], action: Action) -> list[str]:
    """The noun phrases that `said` stands for; pronouns stand for the objects of the clause before."""
    words = list(said)
    while words and words[-1] in ("up", "down", "over"):
        words.pop()
    before = list(dict.fromkeys(command.object for command in latest))
    if not words and latest and all(command.action is Action.PICK_UP for command in latest):
        return before  # "grab the carrot and put on the plate"
    if not words:
        raise _missing_object(action)
    if len(words) == 1 and words[0] in PRONOUNS:
        if len(before) == 1 or (before and words[0] in ("them", "these", "those")):
            return before
        raise UnclearInstruction(f"It isn't clear what '{words[0]}' stands for: name the object.")
    name = noun_phrase(words)
    if name in TABLE:
        raise NeedsLanguageModel(f"The {name} itself can't be moved, so {quote(words)} must mean something else.")
    return [name]


def _missing_object(action: Action) -> UnclearInstruction:
    return UnclearInstruction(f"It isn't said what to {action}. Say for example '{action} the carrot ...'.")


def _missing_goal(action: Action, name: str) -> UnclearInstruction:
    ways = {
        Action.ROTATE: (f"By how much should the {name} be turned", "by 90 degrees clockwise"),
        Action.STACK: (f"On what should the {name} be stacked", "on the blue block"),
        Action.PUSH: (f"Where should the {name} be pushed", "left by 10 cm"),
        Action.DRAG: (f"Where should the {name} be dragged", "to (0.30, 0.10)"),
        Action.PLACE: (f"Where should the {name} be put", "on the plate"),
    }
    question, example = ways[action]
    return UnclearInstruction(f"{question}? Say for example '{action} the {name} {example}'.")


# From part to object and goal -----------------------------------------------------------------------------------


def _read_part(part: Sequence[Token], action: Action) -> tuple[list[str], _Goal | None]:
    """The words for the object, and the goal where the part has one."""
    kinds = [token.kind for token in part]
    if action is Action.ROTATE:
        return _read_rotation(part)
    if Kind.ANGLE in kinds:
        raise UnclearInstruction(f"{quote([_said(part)])}: an angle goes with 'rotate'.")
    if Kind.POINT in kinds:
        return _read_point(part, kinds.index(Kind.POINT))
    if Kind.LENGTH in kinds:
        return _read_shift(part, kinds.index(Kind.LENGTH))
    return _read_relation([token.text for token in part], action)


def _said(tokens: Sequence[Token]) -> str:
    return " ".join(token.text for token in tokens)


def _read_rotation(part: Sequence[Token]) -> tuple[list[str], _Goal | None]:
    angles = [token.value[0] for token in part if token.kind is Kind.ANGLE]
    senses = [SENSES[token.text] for token in part if token.text in SENSES]
    others = [t for t in part if t.kind is not Kind.ANGLE and t.text not in SENSES]
    if any(token.kind is not Kind.WORD for token in others) or len(angles) > 1 or len(senses) > 1:
        raise UnclearInstruction(f"{quote([_said(part)])}: a turn has one angle and at most one sense.")
    said = [token.text for token in others]
    if angles and not 0 < abs(angles[0]) <= 2 * math.pi:
        raise UnclearInstruction(f"{quote([_said(part)])}: an angle is more than 0 and at most 360 degrees.")
    while said and said[-1] in ("by", "about", "around", "through"):
        said.pop()
    if not angles:
        return said, None
    return said, _Goal(angle=angles[0] * (senses[0] if senses else 1.0))


def _read_point(part: Sequence[Token], at: int) -> tuple[list[str], _Goal]:
    said = [token.text for token in part[:at]]
    if len(part) > at + 1 or any(token.kind is not Kind.WORD for token in part[:at]):
        raise UnclearInstruction(f"{quote([_said(part)])}: say coordinates once, and last.")
    while said and said[-1] in BEFORE_POINT:
        said.pop()
    x, y = part[at].value
    return said, _Goal(Relation.AT, point=(x, y))


def _read_shift(part: Sequence[Token], at: int) -> tuple[list[str], _Goal]:
    """Read "the plate 10 cm to the left" and "the plate left by 10 cm"."""
    before, after = [t.text for t in part[:at]], [t.text for t in part[at + 1 :]]
    if before[-1:] == ["by"]:
        before.pop()
    found = DIRECTIONS.match_end(after or before)
    if found is None or (after and found[1] < len(after)) or not part[at].value[0] > 0:
        raise UnclearInstruction(
            f"{quote([_said(part)])}: a length goes with one direction, as in 'push the plate left by 10 cm'."
        )
    said = before if after else before[: -found[1]]
    return said, _Goal(Relation.TOWARDS, direction=found[0], distance=part[at].value[0])


def _read_relation(words: list[str], action: Action) -> tuple[list[str], _Goal | None]:
    goal = _find_goal(words, action)
    if goal is None:
        _refuse_bare_direction(words, action)
        return words, None
    start, count, relation = goal
    target_words = words[start + count :]
    if not set(target_words) - DETERMINERS - PRONOUNS:
        raise UnclearInstruction(f"{quote(words)} doesn't say which object is meant after '{words[start]}': name it.")
    target = noun_phrase(target_words)
    if target in TABLE:
        raise UnclearInstruction(f"Where on the {target}? Say for example 'at (0.30, 0.10)' or 'next to the plate'.")
    if {"coordinates", "coordinate", "position", "point"} & set(target_words):
        raise UnclearInstruction(f"{quote(target_words)} are not known. Say them: 'to (0.30, 0.10)', in metres.")
    return words[:start], _Goal(relation, target)


def _refuse_bare_direction(words: Sequence[str], action: Action) -> None:
    """Raise for "push the plate to the left", but not for "push the plate on the left"."""
    direction = DIRECTIONS.match_end(words)
    position = _POSITIONS.match_end(words)
    describes = position is not None and words[-position[1]] != "to"
    if direction and not describes and action is not Action.PICK_UP:
        raise UnclearInstruction(f"{quote(words)}: how far? Say for example '{direction[0]} by 10 cm'.")


def _find_goal(words: Sequence[str], action: Action) -> tuple[int, int, Relation] | None:
    """Start, word count and relation of the phrase that says where to: the others describe the object or target."""
    goals: list[tuple[int, int, Relation]] = []
    places: list[tuple[int, int, Relation]] = []
    start, described = 0, False
    for phrase, meaning in scan(PHRASES, words):
        if meaning in GOALS:
            goals.append((start, len(phrase), _as_goal(meaning, action)))
        elif isinstance(meaning, Where) and meaning not in (Where.CLOSEST, Where.FARTHEST) and not described:
            places.append((start, len(phrase), Relation(meaning.value)))
        described = meaning is Mark.RELATIVE
        start += len(phrase)
    if action is Action.PICK_UP:
        places = []  # where it is picked up, not where to
    candidates = goals or places
    if len(candidates) > 1:
        raise UnclearInstruction(
            f"{quote(words)} can be read in several ways. Say 'that is on' (or in, next to, ...) where you describe an "
            "object by its place, and 'onto' or 'into' where it should go."
        )
    return candidates[0] if candidates else None


def _as_goal(meaning: object, action: Action) -> Relation:
    """What "onto", "into" and "to" ask for; what is dragged or pushed to a thing ends up beside it."""
    if meaning is Mark.INTO:
        return Relation.IN
    beside = meaning is Mark.TO and action in (Action.DRAG, Action.PUSH)
    return Relation.NEXT_TO if beside else Relation.ON
