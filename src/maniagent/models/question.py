"""What an agent asks a chat model, apart from how that model is reached."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel

T = TypeVar("T", bound=BaseModel)


class Unfit(Exception):
    """An answer that has the right form and can't be used; the message says why, to the model that gave it."""


@dataclass(frozen=True)
class Picture:
    """An image that goes along with a question."""

    name: str
    """What it shows, e.g. the camera's name; used in logs, not shown to the model."""
    rgb: NDArray[np.uint8]
    """(H, W, 3)."""


def _anything(_: BaseModel) -> None:
    """No further check."""


@dataclass(frozen=True)
class Question(Generic[T]):
    """One question, complete: a model is told nothing else and remembers nothing."""

    role: str
    """Which agent asks: scene, reasoning, objects or controller."""
    instructions: str
    """The system prompt."""
    parts: tuple[str | Picture, ...]
    """The user's message, in order."""
    answer: type[T]
    """The form of the answer."""
    check: Callable[[T], None] = field(default=_anything)
    """Raises Unfit for an answer that fits the form and not the situation; the reason goes back to the model."""


class ChatModel(Protocol):
    """A vision-language or language model."""

    @property
    def name(self) -> str:
        """As the user named it, e.g. "openai:gpt-5"."""
        ...

    def ask(self, question: Question[T]) -> T:
        """The checked answer.

        Raises
        ------
        ModelFailure
            Where the model can't be reached, or the budget is used up.
        FormatFailure
            Where no answer fits, after all rounds of repair.

        """
        ...
