"""A chat model that is really asked: retries, repair rounds, budget, and word of every exchange to who listens."""

from __future__ import annotations

import contextlib
import math
import time
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

from pydantic import BaseModel

from ..errors import FormatFailure, ModelFailure, StageFailure
from .answers import fit
from .background import wait_for
from .budget import Allowance, Budget, Spent
from .dialogue import Prompt, Reply, Turn
from .endpoint import Endpoint
from .exchange import Exchange, FailureKind, Mode, OnExchange, Output
from .faults import Fault
from .patience import Patience
from .prices import Cost
from .question import Picture, Question, Unfit

T = TypeVar("T", bound=BaseModel)

_CHARACTERS_PER_TOKEN = 3
_PIXELS_PER_TOKEN = 400
"""Both on the safe side of what providers count."""


@dataclass
class _Notes:
    """What is noted while a question is asked."""

    started: float
    replies: list[Reply] = field(default_factory=list)
    complaints: list[str] = field(default_factory=list)
    attempts: int = 0
    tokens_in: int = 0
    tokens_out: int = 0


class LiveModel:
    """A ChatModel behind an endpoint."""

    def __init__(
        self,
        endpoint: Endpoint,
        *,
        output: Output = "auto",
        patience: Patience | None = None,
        budget: Budget | None = None,
        cost: Cost | None = None,
        temperature: float | None = None,
        on_exchange: OnExchange | None = None,
    ) -> None:
        """`budget` may be shared with other models; `cost` prices answers; None where no price is known."""
        self._endpoint = endpoint
        self._patience = patience or Patience()
        self._budget = budget or Budget()
        self._cost = cost
        self._temperature = temperature
        self._on_exchange = on_exchange
        self._may_fall_back = output == "auto"
        self._mode: Mode = ("schema" if endpoint.schemas else "tool") if output == "auto" else output

    def __repr__(self) -> str:
        return f"LiveModel({self.name!r})"

    @property
    def name(self) -> str:
        """As the user named it."""
        return self._endpoint.address.name

    @property
    def mode(self) -> Mode:
        """How answers are enforced now."""
        return self._mode

    def close(self) -> None:
        """Close the connections."""
        wait_for(self._endpoint.close())

    def ask(self, question: Question[T]) -> T:
        """The checked answer; see `ChatModel.ask`. Each round takes at most `Patience.timeout` seconds."""
        notes = _Notes(time.monotonic())
        answer: T | None = None
        failure: StageFailure | None = None
        try:
            answer = self._rounds(question, notes)
        except (ModelFailure, FormatFailure) as error:
            failure = error
            raise
        finally:
            if self._on_exchange is not None:
                self._on_exchange(self._exchange(question, notes, answer, failure))
        return answer

    def _rounds(self, question: Question[T], notes: _Notes) -> T:
        turns: tuple[Turn, ...] = ()
        for _ in range(1 + self._patience.repairs):
            prompt = Prompt(question.instructions, question.parts, question.answer, turns)
            reply = self._reply(prompt, notes)
            notes.replies.append(reply)
            try:
                return fit(reply.text, question)
            except Unfit as unfit:
                complaint = str(unfit)
            if reply.cut_off:
                complaint += f"\nIt was cut off after {reply.tokens_out or self._patience.max_tokens} tokens: be brief."
            notes.complaints.append(complaint)
            turns = (*turns, Turn(reply, complaint))
        rounds = len(turns)
        raise FormatFailure(f"{self.name} gave no fitting answer in {rounds} round{'s' * (rounds > 1)}: {complaint}")

    def _reply(self, prompt: Prompt, notes: _Notes) -> Reply:
        """One round: the answer, in the other mode where the server refuses the first."""
        deadline = time.monotonic() + self._patience.timeout
        try:
            return self._persist(prompt, self._mode, deadline, notes)
        except Fault as fault:
            refusal = fault
        if refusal.kind == "refused" and self._may_fall_back and self._mode != "prompt":
            with contextlib.suppress(Fault):  # then the way of asking wasn't the reason: the first fault says more
                reply = self._persist(prompt, "prompt", deadline, notes)
                self._mode = "prompt"
                return reply
        raise ModelFailure(self._told(refusal))

    def _persist(self, prompt: Prompt, mode: Mode, deadline: float, notes: _Notes) -> Reply:
        """Send, and send again after faults that pass, until the time is up; raises Fault."""
        for attempt in range(1, self._patience.retries + 2):
            try:
                return self._attempt(prompt, mode, deadline - time.monotonic(), notes)
            except Fault as fault:
                wait = self._patience.wait(attempt, fault.retry_after) if fault.kind == "passing" else None
                if wait is None or time.monotonic() + wait >= deadline:
                    raise
            self._budget.wait(wait)
            time.sleep(wait)
        raise AssertionError("Patience.wait ends the retries")

    def _attempt(self, prompt: Prompt, mode: Mode, seconds: float, notes: _Notes) -> Reply:
        tokens_in = _estimate(prompt)
        allowance = self._budget.reserve(tokens_in, self._patience.max_tokens, seconds, self._cost)
        started = time.monotonic()
        notes.attempts += 1
        spent = allowance.reserved  # until it is known: an answer that was cut off by Ctrl-C may be paid for
        try:
            reply = wait_for(
                self._endpoint.send(
                    prompt,
                    mode,
                    max_tokens=allowance.max_tokens,
                    timeout=allowance.seconds,
                    temperature=self._temperature,
                )
            )
            spent = self._spent(reply, allowance)
            notes.tokens_in += reply.tokens_in or 0
            notes.tokens_out += reply.tokens_out or 0
        except Fault as fault:
            if not fault.sent:
                spent = Spent(calls=1)
            raise
        finally:
            self._budget.settle(allowance, replace(spent, seconds=time.monotonic() - started))
        return reply

    def _spent(self, reply: Reply, allowance: Allowance) -> Spent:
        if reply.tokens_in is None or reply.tokens_out is None:
            return allowance.reserved
        money = self._cost(reply.tokens_in, reply.tokens_out) if self._cost else 0.0
        return Spent(1, reply.tokens_in + reply.tokens_out, 0.0, money)

    def _told(self, fault: Fault) -> str:
        """A fault for people."""
        address = self._endpoint.address
        if fault.kind == "key":
            return f"{self.name} refuses the key in {address.provider.keys[0]}: {fault}"
        where = f" at {address.base_url}" if address.base_url else ""
        asks = f" (it asks to wait {fault.retry_after:g} s)" if fault.retry_after else ""
        return f"{self.name}{where} gives no answer: {fault}{asks}"

    def _exchange(
        self, question: Question[Any], notes: _Notes, answer: BaseModel | None, failure: StageFailure | None
    ) -> Exchange:
        return Exchange(
            role=question.role,
            model=self.name,
            instructions=question.instructions,
            parts=question.parts,
            form=question.answer.__name__,
            mode=self._mode,
            answers=tuple(reply.text for reply in notes.replies),
            complaints=tuple(notes.complaints),
            answer=None if answer is None else answer.model_dump(mode="json"),
            failure=None if answer is not None else _kind(failure),
            error=str(failure or ""),
            tokens_in=notes.tokens_in,
            tokens_out=notes.tokens_out,
            seconds=time.monotonic() - notes.started,
            attempts=notes.attempts,
            money=self._cost(notes.tokens_in, notes.tokens_out) if self._cost else None,
        )


def _kind(failure: StageFailure | None) -> FailureKind:
    match failure:
        case ModelFailure():
            return "model"
        case FormatFailure():
            return "format"
        case _:
            return "interrupted"


def _estimate(prompt: Prompt) -> int:
    """Tokens of the question, rather too many."""
    said = [prompt.instructions, *(part for part in prompt.parts if isinstance(part, str))]
    said += [text for turn in prompt.turns for text in (turn.reply.text, turn.complaint)]
    pixels = sum(part.rgb.shape[0] * part.rgb.shape[1] for part in prompt.parts if isinstance(part, Picture))
    schema = len(str(prompt.form.model_json_schema()))
    return math.ceil((sum(map(len, said)) + schema) / _CHARACTERS_PER_TOKEN + pixels / _PIXELS_PER_TOKEN)
