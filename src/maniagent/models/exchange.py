"""One question and what came of it, complete: what is shown, counted, recorded, and replayed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from .question import Picture

Mode = Literal["schema", "tool", "prompt"]
"""How the form of an answer is enforced: by the server's JSON schema, by a tool call, or only asked for in words."""

Output = Literal["auto", "schema", "tool", "prompt"]
"""How the form of answers is enforced; auto takes what the provider is known for and falls back to "prompt" once,
where the server refuses."""

FailureKind = Literal["model", "format", "interrupted"]
"""The model can't be reached or the budget is used up; no answer fitted; stopped from outside."""


@dataclass(frozen=True, kw_only=True)
class Exchange:
    """A question to a model, all rounds of its answer, and what that took."""

    role: str
    """Which agent asked."""
    model: str
    """As the user named it."""
    instructions: str
    parts: tuple[str | Picture, ...]
    form: str
    """Name of the answer's type."""
    mode: Mode
    """In the last round."""
    answers: tuple[str, ...]
    """What the model wrote, one text for each round."""
    complaints: tuple[str, ...]
    """Why an answer didn't fit, one for each text that didn't."""
    answer: Mapping[str, Any] | None
    """The answer that fits, as JSON; None where there is none."""
    failure: FailureKind | None
    """Why there is none."""
    error: str
    """The failure's message, else empty."""
    tokens_in: int
    """Read by the model, in all rounds."""
    tokens_out: int
    """Written by the model, in all rounds, thinking included."""
    seconds: float
    """From the question to the answer, waits and repairs included."""
    attempts: int
    """Requests that were sent."""
    money: float | None
    """US dollars; None where no price is known."""

    @property
    def repairs(self) -> int:
        """Rounds after the first."""
        return max(len(self.answers) - 1, 0)


OnExchange = Callable[[Exchange], None]
"""Is told of every exchange when it is over, on the thread that asked."""
