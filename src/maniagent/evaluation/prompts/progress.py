"""The live display of a comparison on stderr."""

from __future__ import annotations

from ...console.work import WorkDisplay
from .scores import Result


class ScoringProgress(WorkDisplay):
    """Shows a comparison to a person: a bar and the misses on a terminal, elsewhere a line for each answer."""

    things = "answers"

    def begin(self, total: int) -> None:
        """Say how many answers are needed."""
        self._begin("prompts", total, 0)

    def add(self, result: Result, before: bool) -> None:
        """Show one more answer; those that were there `before` count."""
        self._done += 1
        self._before += before
        if before:
            return
        missed = ", ".join(thing.name for thing in result.matching.missed)
        mark, colour = ("✗", "red") if missed else ("✓", "green")
        why = result.answer.failure or (f"missed {missed}" if missed else "")
        name = f"{result.answer.scene}  {result.answer.variant}"
        self._show(mark, colour, name, why, result.answer.seconds, always=bool(missed))
