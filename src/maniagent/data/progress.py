"""The live display of a collection on stderr: how far it is, how well it goes, how long it will take."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from datetime import timedelta
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn
from rich.text import Text

from .episode import EpisodeInfo
from .lerobot.publish import Published


class CollectProgress:
    """A Watcher for a person: a bar on a terminal, elsewhere a line for each attempt."""

    def __init__(self, console: Console | None = None, clock: Callable[[], float] = time.monotonic) -> None:
        self._console = console or Console(stderr=True)
        self._clock = clock
        self._bar = Progress(
            TextColumn("[bold]valid episodes"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("{task.fields[told]}"),
            console=self._console,
            transient=True,
            disable=not self._console.is_terminal,
        )
        self._id: TaskID | None = None
        self._labels: Counter[str] = Counter()
        self._wanted = self._new = self._interventions = self._in_dataset = 0
        self._start = clock()

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()
        if kind is not None and self._labels["valid"] < self._wanted:
            kept = f"{self._labels['valid']} of {self._wanted} episodes are kept; the same command goes on from there."
            self._console.print(Text(kept, style="yellow"), soft_wrap=True)

    @contextmanager
    def paused(self) -> Iterator[Console]:
        """The console without the bar, for a talk with a person."""
        self._bar.stop()
        yield self._console
        self._bar.start()

    def begin(self, wanted: int, before: Sequence[EpisodeInfo]) -> None:
        """See Watcher."""
        self._wanted, self._start = wanted, self._clock()
        self._labels.update(info.label for info in before)
        self._interventions = sum(info.interventions for info in before)
        valid = self._labels["valid"]
        self._id = self._bar.add_task("", total=wanted, completed=valid, told="starting")
        if before:
            self._console.print(Text(f"Going on: {valid} of {wanted} episodes are there.", style="dim"))

    def add(self, info: EpisodeInfo) -> None:
        """See Watcher."""
        self._labels[info.label] += 1
        self._new += info.label == "valid"
        self._interventions += info.interventions
        if self._id is not None:
            self._bar.update(self._id, completed=self._labels["valid"], told=self.told)
        if info.label != "valid" or not self._console.is_terminal:
            self._console.print(self._line(info), soft_wrap=True)

    def published(self, so_far: Published) -> None:
        """See Watcher."""
        self._in_dataset = so_far.total

    @property
    def told(self) -> str:
        """Valid share, rate, time left."""
        tried, valid = self._labels.total(), self._labels["valid"]
        words = [f"{100 * valid / tried:.1f} % of attempts"] if tried else []
        elapsed = self._clock() - self._start
        if self._new and elapsed > 0:
            left = timedelta(seconds=round((self._wanted - valid) * elapsed / self._new))
            words += [f"{3600 * self._new / elapsed:.0f} an hour", f"{left} left"]
        words += [f"{self._interventions} interventions"] if self._interventions else []
        words += [f"{self._in_dataset} in the dataset"] if self._in_dataset else []
        return " · ".join(words)

    def _line(self, info: EpisodeInfo) -> Text:
        mark, colour = {"valid": ("✓", "green"), "failed": ("✗", "red"), "doubtful": ("?", "yellow")}[info.label]
        line = Text.assemble((f"{mark} ", colour), (f"{self._labels['valid']}/{self._wanted} ", "dim"), f"{info.key}  ")
        if info.reason:
            line.append(f"{' '.join(info.reason.split())}  ", style=colour)
        return line.append(f"{info.seconds:.1f} s", style="dim")
