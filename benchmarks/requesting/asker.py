"""All questions in order, each asked once, whatever came of those before."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Literal

from maniagent.agents.memory import Memory
from maniagent.agents.minds import Prompts
from maniagent.errors import ModelFailure, StageFailure
from maniagent.models.question import ChatModel
from maniagent.types import Subtask, Verdict

from .cases import Request
from .questions import Tape, ask_controller, ask_reasoning
from .results import ROLES, Line, ResultsFile, Role, key_of
from .table import Table, laid

Order = Literal["roles", "requests"]
MOST_SILENCES = 3
"""Questions in a row without an answer, after which the model counts as gone."""


class Asker:
    """Puts requests to a model and keeps what became of them."""

    def __init__(
        self, llm: ChatModel, prompts: Prompts, results: ResultsFile, tape: Tape, temperature: float | None = None
    ) -> None:
        """`tape` is told of every exchange with `llm`, whose temperature is part of what a result is known by."""
        self._llm = llm
        self._temperature = temperature
        self._prompts = prompts
        self._results = results
        self._tape = tape

    def known(self, request: Request, role: Role) -> Line | None:
        """What became of that question, where it was asked before."""
        return self._results.get(self._key(request, role))

    def lines(self, requests: Sequence[Request]) -> list[Line]:
        """All that is known about these requests."""
        return [line for r in requests for role in ROLES if (line := self.known(r, role)) is not None]

    def ask(self, requests: Sequence[Request], order: Order, limit: int | None = None) -> Iterator[Line]:
        """Ask what wasn't asked before, at most `limit` questions; each line is written down before it is handed out.

        A question that the model doesn't answer at all has no line, and is asked again by the next call. Raises
        ModelFailure after `MOST_SILENCES` of them in a row.
        """
        silences = 0
        open_ones = [(r, role) for r, role in in_order(requests, order) if self.known(r, role) is None]
        for request, role in open_ones[:limit]:
            try:
                line = self._ask(request, role)
            except ModelFailure:
                silences += 1
                if silences >= MOST_SILENCES:
                    raise
                continue
            silences = 0
            self._results.add(line)
            yield line

    def _ask(self, request: Request, role: Role) -> Line:
        key = self._key(request, role)
        with laid(request, self._llm, self._prompts) as table:
            if role == "reasoning":
                return ask_reasoning(request, table, self._tape, key)
            own, why_not = self._own_subtask(request, table)
            subtask = own or table.subtasks[0]
            line = ask_controller(request, table, subtask, "model" if own else "rules", self._tape, key)
            return line.model_copy(update={"instead": why_not})

    def _own_subtask(self, request: Request, table: Table) -> tuple[Subtask | None, str]:
        """The model's own sub-task, where it named one that the controller can be asked about; else why not."""
        said = self.known(request, "reasoning")
        if said is None:
            return None, "it wasn't asked"
        if said.next != "act":
            return None, f"it says {said.next}" if said.next else "no answer fitted"
        subtask = Subtask(previous=Verdict.INITIAL, reason="", text=said.subtask, objects=said.objects)
        try:
            table.objects.locate(subtask, table.observation, Memory())
        except StageFailure as failure:
            return None, f"{failure.stage}: {failure}"
        return subtask, ""

    def _key(self, request: Request, role: Role) -> str:
        prompt = self._prompts.reasoning if role == "reasoning" else self._prompts.controller
        return key_of(request, role, self._llm.name, self._temperature, prompt)


def in_order(requests: Sequence[Request], order: Order) -> list[tuple[Request, Role]]:
    """Every request in both roles: role by role, or request by request."""
    if order == "roles":
        return [(request, role) for role in ROLES for request in requests]
    return [(request, role) for request in requests for role in ROLES]
