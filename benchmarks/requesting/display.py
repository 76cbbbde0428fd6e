"""How far it is, on stderr: a bar on a terminal, and a line for each question."""

from __future__ import annotations

from typing import TYPE_CHECKING

from maniagent.console.work import WorkDisplay

if TYPE_CHECKING:
    from .results import Line


class Display(WorkDisplay):
    """Shows lines as they come."""

    things = "questions"

    def __init__(self, total: int, done: int) -> None:
        """`done` of `total` questions were answered before."""
        super().__init__()
        self._begin("questions", total, done)

    def add(self, line: Line) -> None:
        """Show one more."""
        self._done += 1
        good = line.fits if line.role == "reasoning" else line.passes
        said = f"{line.next} {line.subtask!r}" if line.role == "reasoning" else f"{line.source}: {line.asked!r}"
        cost = f"{line.unfit} unfit, {line.tokens_in} + {line.tokens_out} tokens: {said}"
        why = f"{line.stage}: {line.reason[:160]}" if line.stage else ""
        mark, colour = ("✓", "green") if good else ("✗", "red")
        name = f"{line.role} {line.request} {line.task}, {cost}"
        self._show(mark, colour, name, why, line.model_seconds, always=True)
