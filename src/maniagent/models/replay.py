"""A recording that stands in for the models that gave its answers: no network, the same answers, nothing made up."""

from __future__ import annotations

import json
import threading
from collections import defaultdict, deque
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel, ValidationError

from ..errors import FormatFailure, ModelFailure
from .question import Question, Unfit
from .record import Recorded, as_recorded, read_exchanges

T = TypeVar("T", bound=BaseModel)

_SHOWN = 60
"""Characters on either side of where two texts part."""


class ReplayModel:
    """A ChatModel that answers from a recording, whichever models gave the answers.

    A question is answered only where the very same was recorded: role, instructions, texts and pictures. Asked again,
    it gets the answers that were recorded for it, one after the other. What failed then fails now.
    """

    def __init__(self, folder: Path, *, pictures: bool = True) -> None:
        """`pictures` false takes pictures for the same whatever is on them, as renderers differ by a shade.

        Raises UsageError where the folder holds no recording.
        """
        self._folder = folder
        self._pictures = pictures
        self._lock = threading.Lock()
        self._recorded = read_exchanges(folder)
        self._open: dict[str, deque[Recorded]] = defaultdict(deque)
        for recorded in self._recorded:
            if recorded.failure != "interrupted":
                self._open[recorded.key(pictures=pictures)].append(recorded)

    @property
    def name(self) -> str:
        """Says which models are stood in for."""
        models = dict.fromkeys(recorded.model for recorded in self._recorded)
        return f"replay of {', '.join(models) or 'nothing'}"

    @property
    def left(self) -> int:
        """How many recorded answers weren't asked for yet."""
        return sum(map(len, self._open.values()))

    def ask(self, question: Question[T]) -> T:
        """The recorded answer. Raises ModelFailure, saying what differs, where the question wasn't recorded."""
        asked = as_recorded(question.role, question.instructions, question.parts, question.answer.__name__)
        key = asked.key(pictures=self._pictures)
        with self._lock:
            known = key in self._open
            recorded = self._open[key].popleft() if known and self._open[key] else None
        if recorded is None:
            why = "it is asked more often than it was then." if known else self._difference(asked)
            raise ModelFailure(f"The recording in {self._folder} has no answer to this question of {asked.role}: {why}")
        if recorded.answer is None:
            raise {"format": FormatFailure}.get(recorded.failure or "", ModelFailure)(recorded.error)
        return _checked(recorded, question)

    def _difference(self, asked: Recorded) -> str:
        """What is different from the recorded question that is nearest to it."""
        others = [recorded for queue in self._open.values() for recorded in queue if recorded.role == asked.role]
        if not others:
            return "nothing is left of that role."
        return min((_differences(asked, other, self._pictures) for other in others), key=len)[0]


def _checked(recorded: Recorded, question: Question[T]) -> T:
    try:
        answer = question.answer.model_validate_json(json.dumps(recorded.answer))
        question.check(answer)
    except (ValidationError, Unfit) as error:
        raise FormatFailure(f"The recorded answer of {recorded.model} doesn't fit any more: {error}") from error
    return answer


def _differences(asked: Recorded, other: Recorded, pictures: bool) -> list[str]:
    found = []
    if asked.form != other.form:
        found.append(f"the form of the answer is {asked.form}, not {other.form}.")
    if len(asked.parts) != len(other.parts):
        found.append(f"it has {len(asked.parts)} parts, not {len(other.parts)}.")
    if asked.instructions != other.instructions:
        found.append(f"the instructions differ: {_parting(asked.instructions, other.instructions)}")
    for number, (mine, theirs) in enumerate(zip(asked.parts, other.parts, strict=False), 1):
        if isinstance(mine, str) and isinstance(theirs, str):
            if mine != theirs:
                found.append(f"part {number} differs: {_parting(mine, theirs)}")
        elif isinstance(mine, str) or isinstance(theirs, str):
            found.append(f"part {number} is a text in one and a picture in the other.")
        elif pictures and mine[1] != theirs[1]:
            found.append(f"part {number}, the picture {mine[0]!r}, shows something else than {theirs[1]}.")
    return found


def _parting(mine: str, theirs: str) -> str:
    """Where two texts part, and how they go on."""
    same = next((i for i, (a, b) in enumerate(zip(mine, theirs, strict=False)) if a != b), min(len(mine), len(theirs)))
    start = max(same - _SHOWN, 0)
    return f"{mine[start : same + _SHOWN]!r} is asked, {theirs[start : same + _SHOWN]!r} was recorded."
