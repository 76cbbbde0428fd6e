"""Long work on stderr: a bar on a terminal, elsewhere a line for each thing that is done; what is kept when it ends."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import timedelta
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn
from rich.text import Text


class WorkDisplay:
    """What the displays of resumable work share; a context manager."""

    things = "episodes"
    """What is counted."""

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
        self._total = self._before = self._done = 0
        self._start = clock()

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()
        if kind is not None and self._done < self._total:
            kept = f"{self._done} of {self._total} {self.things} are kept; the same command goes on from there."
            self._console.print(Text(kept, style="yellow"), soft_wrap=True)

    @contextmanager
    def paused(self) -> Iterator[Console]:
        """The console without the bar, for a talk with a person."""
        self._bar.stop()
        yield self._console
        self._bar.start()

    @property
    def told(self) -> str:
        """What stands beside the bar."""
        return " · ".join(self._pace(60, "a minute"))

    def _begin(self, name: str, total: int, done: int) -> None:
        """Show the bar: `total` to do, of which earlier calls have `done`."""
        self._total, self._before, self._done = total, done, done
        self._start = self._clock()
        self._id = self._bar.add_task(name, total=total, completed=done, told="starting")
        if done:
            self._console.print(Text(f"Going on: {done} of {total} {self.things} are there.", style="dim"))

    def _pace(self, seconds: float, word: str) -> list[str]:
        """How many are done in so many seconds, and how long the rest will take, by what this call has done."""
        elapsed, new = self._clock() - self._start, self._done - self._before
        if not new or elapsed <= 0:
            return []
        left = timedelta(seconds=round((self._total - self._done) * elapsed / new))
        return [f"{seconds * new / elapsed:.3g} {word}", f"{left} left"]

    def _show(self, mark: str, colour: str, name: str, why: str, seconds: float, *, always: bool) -> None:
        """Move the bar, and write a line: on a terminal only if that is to be seen `always`."""
        if self._id is not None:
            self._bar.update(self._id, completed=self._done, told=self.told)
        if not always and self._console.is_terminal:
            return
        line = Text.assemble((f"{mark} ", colour), (f"{self._done}/{self._total} ", "dim"), f"{name}  ")
        if why:
            line.append(f"{' '.join(why.split())}  ", style=colour)
        self._console.print(line.append(f"{seconds:.1f} s", style="dim"), soft_wrap=True)
