"""How long a model is waited for, and how often it is asked again."""

from __future__ import annotations

import random

from pydantic import BaseModel, ConfigDict, Field, NonNegativeFloat, NonNegativeInt, PositiveFloat


class Patience(BaseModel):
    """The bounds of one question; times in seconds."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    timeout: PositiveFloat = 120.0
    """For one whole answer: everything from the first attempt to the last byte, waits included. A repair round has
    the same time anew."""
    repairs: NonNegativeInt = 2
    """How often an answer that doesn't fit goes back to the model with the reason."""
    retries: NonNegativeInt = 4
    """How often a request is sent again after a rate limit, a server's error or a broken connection."""
    first_wait: PositiveFloat = 0.5
    """Before the first retry; doubled each time, and varied by a quarter so that clients don't march in step."""
    longest_wait: NonNegativeFloat = 30.0
    """The longest wait; a server that asks for more (Retry-After) is given up at once."""
    max_tokens: int = Field(default=8192, ge=1)
    """Of an answer, thinking included."""

    def wait(self, attempt: int, asked: float | None) -> float | None:
        """Seconds to wait after failed attempt number `attempt` (from 1); None to give up.

        `asked` is what the server asked for, in seconds.
        """
        if attempt > self.retries or (asked is not None and not asked <= self.longest_wait):  # nan, too, is too long
            return None
        backoff = min(self.first_wait * 2 ** min(attempt - 1, 30), self.longest_wait)
        return max(asked or 0.0, backoff * random.uniform(0.75, 1.25))  # noqa: S311 - not for secrets
