"""The live display of a comparison on stderr."""

from __future__ import annotations

from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn, TimeRemainingColumn
from rich.text import Text

from .scores import Result


class ScoringProgress:
    """Shows a comparison to a person: a bar and the misses on a terminal, elsewhere a line for each answer."""

    def __init__(self, console: Console | None = None) -> None:
        self._console = console or Console(stderr=True)
        self._bar = Progress(
            TextColumn("[bold]{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeRemainingColumn(),
            console=self._console,
            transient=True,
            disable=not self._console.is_terminal,
        )
        self._id: TaskID | None = None
        self._total = self._finished = 0

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()
        if self._finished < self._total and kind is not None:
            kept = f"{self._finished} of {self._total} answers are kept; the same command goes on from there."
            self._console.print(Text(kept, style="yellow"), soft_wrap=True)

    def begin(self, total: int) -> None:
        """Say how many answers are needed."""
        self._total = total
        self._id = self._bar.add_task("prompts", total=total)

    def add(self, result: Result, before: bool) -> None:
        """Show one more answer."""
        self._finished += 1
        if self._id is not None:
            self._bar.update(self._id, completed=self._finished)
        if not before and (result.matching.missed or not self._console.is_terminal):
            self._console.print(self._line(result), soft_wrap=True)

    def _line(self, result: Result) -> Text:
        missed = ", ".join(thing.name for thing in result.matching.missed)
        mark, colour = ("✗", "red") if missed else ("✓", "green")
        line = Text.assemble(
            (f"{mark} ", colour),
            (f"{self._finished}/{self._total} ", "dim"),
            f"{result.answer.scene}  {result.answer.variant}  ",
        )
        why = result.answer.failure or (f"missed {missed}" if missed else "")
        return line.append(f"{' '.join(why.split())}  " if why else "", colour).append(
            f"{result.answer.seconds:.1f} s", style="dim"
        )
