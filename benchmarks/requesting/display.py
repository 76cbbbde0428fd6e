"""How far it is, on stderr: a bar on a terminal, and a line for each question."""

from __future__ import annotations

from types import TracebackType
from typing import TYPE_CHECKING, Self

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.text import Text

if TYPE_CHECKING:
    from .results import Line


class Display:
    """Shows lines as they come."""

    def __init__(self, total: int, done: int) -> None:
        """`done` of `total` questions were answered before."""
        self._console = Console(stderr=True)
        columns = (TextColumn("questions"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
        self._bar = Progress(
            *columns,
            TimeRemainingColumn(),
            console=self._console,
            transient=True,
            disable=not self._console.is_terminal,
        )
        self._total, self._done = total, done
        self._task = self._bar.add_task("questions", total=total, completed=done)

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()

    def add(self, line: Line) -> None:
        """Show one more."""
        self._done += 1
        self._bar.update(self._task, completed=self._done)
        good = line.fits if line.role == "reasoning" else line.passes
        said = f"{line.next} {line.subtask!r}" if line.role == "reasoning" else f"{line.source}: {line.asked!r}"
        mark = Text("✓ " if good else "✗ ", style="green" if good else "red")
        told = f"{self._done}/{self._total} {line.role} {line.request} {line.task}, {line.unfit} unfit, "
        cost = f"{line.model_seconds:.0f} s, {line.tokens_in} + {line.tokens_out} tokens: "
        why = f" | {line.stage}: {line.reason[:160]}" if line.stage else ""
        self._console.print(mark + told + cost + said + why, soft_wrap=True)
