"""The live display of an evaluation on stderr: how far it is, how it goes, how long it will take."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from datetime import timedelta
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn
from rich.text import Text

from .episode import EpisodeResult


class EvaluationProgress:
    """Shows an evaluation to a person: a bar and the failures on a terminal, elsewhere a line for each episode."""

    def __init__(self, console: Console | None = None, clock: Callable[[], float] = time.monotonic) -> None:
        self._console = console or Console(stderr=True)
        self._clock = clock
        self._bar = Progress(
            TextColumn("[bold]{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("{task.fields[told]}"),
            console=self._console,
            transient=True,
            disable=not self._console.is_terminal,
        )
        self._id: TaskID | None = None
        self._total = self._before = self._finished = self._successes = 0
        self._start = clock()

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()
        if self._finished < self._total and kind is not None:
            kept = f"{self._finished} of {self._total} episodes are kept; the same command goes on from there."
            self._console.print(Text(kept, style="yellow"), soft_wrap=True)

    def begin(self, name: str, total: int, done: Sequence[EpisodeResult]) -> None:
        """Say how many episodes there are, and which of them an earlier call has finished."""
        self._total, self._before = total, len(done)
        self._finished, self._successes = len(done), sum(result.success for result in done)
        self._start = self._clock()
        self._id = self._bar.add_task(name, total=total, completed=len(done), told="starting")
        if done:
            self._console.print(Text(f"Going on: {len(done)} of {total} episodes are there.", style="dim"))

    def add(self, result: EpisodeResult) -> None:
        """Show one more finished episode."""
        self._finished += 1
        self._successes += result.success
        if self._id is not None:
            self._bar.update(self._id, completed=self._finished, told=self.told)
        if not result.success or not self._console.is_terminal:
            self._console.print(self._line(result), soft_wrap=True)

    @property
    def told(self) -> str:
        """Success so far, rate, time left."""
        elapsed, played = self._clock() - self._start, self._finished - self._before
        words = [f"{100 * self._successes / self._finished:.1f} % success"] if self._finished else []
        if played and elapsed > 0:
            left = timedelta(seconds=round((self._total - self._finished) * elapsed / played))
            words += [f"{60 * played / elapsed:.1f} a minute", f"{left} left"]
        return " · ".join(words)

    def _line(self, result: EpisodeResult) -> Text:
        mark, colour = ("✓", "green") if result.success else ("✗", "red")
        line = Text.assemble((f"{mark} ", colour), (f"{self._finished}/{self._total} ", "dim"), f"{result.job.name}  ")
        if not result.success:
            line.append(f"{result.stage}: {' '.join(result.reason.split())}  ", style=colour)
        return line.append(f"{result.wall_seconds:.1f} s", style="dim")
