"""The live display of a run on stderr: what goes on now, and one line for every turn that is over."""

from __future__ import annotations

import time
from collections.abc import Callable
from types import TracebackType
from typing import Self

from rich.console import Console, RenderableType
from rich.live import Live
from rich.spinner import Spinner
from rich.table import Table
from rich.text import Text

from ..types import Event, Subtask

_NOW = {
    "run_started": "looking at the table",
    "observed": "describing the scene",
    "described": "deciding what to do next",
    "located": "writing the action sequence",
    "planned": "planning the motion",
    "executed": "looking again",
    "failed": "looking again",
}
"""What begins when an event has come."""


class Progress:
    """An Observer that shows a run to a person; on a terminal with a spinner, elsewhere as plain lines."""

    def __init__(self, console: Console | None = None, clock: Callable[[], float] = time.monotonic) -> None:
        self._console = console or Console(stderr=True)
        self._clock = clock
        self._start = clock()
        self._turn_start = self._last = 0.0
        self._turn = 0
        self._subtask = ""
        self._now = "starting"
        self._spinner = Spinner("dots", style="cyan")
        self._live = Live(
            self, console=self._console, refresh_per_second=8, transient=True, auto_refresh=self._console.is_terminal
        )

    def __enter__(self) -> Self:
        self._start = self._clock()
        if self._console.is_terminal:
            self._live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._live.stop()

    def __rich__(self) -> RenderableType:
        """The line at the bottom: spinner, turn, sub-task, what goes on, seconds so far."""
        line = Table.grid(padding=(0, 1))
        words = Text.assemble((f"turn {self._turn}  ", "dim"), (self._subtask, "bold"), "  " if self._subtask else "")
        words.append(self._now)
        line.add_row(self._spinner, words, Text(f"{self._clock() - self._start:.0f} s", style="dim"))
        return line

    def on_event(self, event: Event) -> None:
        """Show one event."""
        if event.kind == "frame":
            return
        self._now = _NOW.get(event.kind, self._now)
        self._show(event)
        self._last = event.time

    def _show(self, event: Event) -> None:
        match event.kind:
            case "run_started":
                self._tell(Text.assemble(("› ", "cyan"), (event.data["instruction"], "bold")))
            case "observed":
                if event.data["turn"] != self._turn:
                    self._turn, self._turn_start, self._subtask = event.data["turn"], self._last, ""
            case "reasoned":
                self._reasoned(event.data["subtask"])
            case "move":
                self._now = event.data["description"]
            case "executed" if event.data["report"].completed:
                self._turn_line("✓", "green", "carried out", event.time)
            case "failed":
                self._turn_line("✗", "red", f"{event.data['stage']}: {event.data['reason']}", event.time)

    def _reasoned(self, subtask: Subtask) -> None:
        if not (subtask.done or subtask.cannot):
            self._subtask = subtask.text
            self._now = f"finding {', '.join(subtask.objects)}"

    def _turn_line(self, mark: str, colour: str, outcome: str, time: float) -> None:
        line = Text.assemble((f"{mark} ", colour), (f"turn {self._turn}  ", "dim"))
        if self._subtask:
            line.append(f"{self._subtask}  ")
        line.append(outcome, style=colour)
        line.append(f"  {time - self._turn_start:.1f} s", style="dim")
        self._tell(line)

    def _tell(self, line: Text) -> None:
        self._console.print(line, soft_wrap=True)
