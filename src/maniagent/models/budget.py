"""What a run may spend on models: one budget for all of them, kept before each request and not after it."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass

from pydantic import BaseModel, ConfigDict, NonNegativeFloat, NonNegativeInt

from ..errors import ModelFailure
from .prices import Cost

_LEAST_ANSWER = 64
"""Tokens; with fewer left no answer is begun."""


class Limits(BaseModel):
    """The most a run may spend; None is without a limit."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    calls: NonNegativeInt | None = None
    """Requests that are sent; retries and repair rounds count."""
    tokens: NonNegativeInt | None = None
    """Read and written together."""
    seconds: NonNegativeFloat | None = None
    """Spent waiting for models."""
    money: NonNegativeFloat | None = None
    """US dollars."""


@dataclass(frozen=True)
class Spent:
    """What was spent; see `Limits`."""

    calls: int = 0
    tokens: int = 0
    seconds: float = 0.0
    money: float = 0.0

    def __add__(self, other: Spent) -> Spent:
        return self._combined(other, 1)

    def __sub__(self, other: Spent) -> Spent:
        return self._combined(other, -1)

    def _combined(self, other: Spent, sign: int) -> Spent:
        return Spent(
            self.calls + sign * other.calls,
            self.tokens + sign * other.tokens,
            self.seconds + sign * other.seconds,
            self.money + sign * other.money,
        )


@dataclass(frozen=True)
class Allowance:
    """What one request may take, set aside for it."""

    reserved: Spent
    max_tokens: int
    """That the answer may have."""
    seconds: float
    """That it may take."""


class Budget:
    """Sets aside what a request may take at most, before it is sent; safe with several threads.

    The tokens of a question are known only after it was answered. They are estimated, rather too high, so a limit on
    tokens or money holds as exactly as that estimate.
    """

    def __init__(self, limits: Limits | None = None) -> None:
        self.limits = limits or Limits()
        self._spent = Spent()
        self._lock = threading.Lock()

    @property
    def spent(self) -> Spent:
        """So far, what is set aside included."""
        with self._lock:
            return self._spent

    def reserve(self, tokens_in: int, max_tokens: int, seconds: float, cost: Cost | None) -> Allowance:
        """Set aside what a request of about `tokens_in` tokens may take.

        Where less is left than asked for, the answer may be shorter than `max_tokens` or take less than `seconds`.
        Raises ModelFailure, naming the limit, where an answer is out of reach.
        """
        with self._lock:
            left = self._left()
            if left.calls < 1:
                raise self._used_up("calls", self.limits.calls)
            if left.seconds <= 0:
                raise self._used_up("seconds", self.limits.seconds)
            tokens_out = _affordable(max_tokens, lambda tokens: tokens_in + tokens <= left.tokens)
            if tokens_out is None:
                raise self._used_up("tokens", self.limits.tokens)
            tokens_out = _affordable(tokens_out, lambda tokens: cost is None or cost(tokens_in, tokens) <= left.money)
            if tokens_out is None:
                raise self._used_up("US dollars", self.limits.money)
            seconds = min(seconds, left.seconds)
            money = cost(tokens_in, tokens_out) if cost else 0.0
            reserved = Spent(1, tokens_in + tokens_out, seconds, money)
            self._spent += reserved
            return Allowance(reserved, tokens_out, seconds)

    def settle(self, allowance: Allowance, spent: Spent) -> None:
        """Book what a request really took in place of what was set aside for it."""
        with self._lock:
            self._spent = self._spent - allowance.reserved + spent

    def wait(self, seconds: float) -> None:
        """Book a wait between two attempts; raises ModelFailure where less time is left."""
        with self._lock:
            if seconds > self._left().seconds:
                raise self._used_up("seconds", self.limits.seconds)
            self._spent += Spent(seconds=seconds)

    def _left(self) -> _Left:
        limits, spent = self.limits, self._spent
        return _Left(
            *(
                float("inf") if most is None else most - used
                for most, used in (
                    (limits.calls, spent.calls),
                    (limits.tokens, spent.tokens),
                    (limits.seconds, spent.seconds),
                    (limits.money, spent.money),
                )
            )
        )

    def _used_up(self, what: str, most: float | None) -> ModelFailure:
        return ModelFailure(f"The run's budget of {most:g} {what} for models is used up.")


@dataclass(frozen=True)
class _Left:
    calls: float
    tokens: float
    seconds: float
    money: float


def _affordable(most: int, fits: Callable[[int], bool]) -> int | None:
    """The longest answer that fits, by halving from `most`; None where only a useless one does."""
    tokens = most
    while not fits(tokens):
        tokens //= 2
        if tokens < min(_LEAST_ANSWER, most):
            return None
    return tokens
