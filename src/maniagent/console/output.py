"""What the command line prints when it is done: JSON for programs, tables and a verdict for people."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from ..doctor import Check
from ..types import RunResult, RunVerdict


def print_json(value: Any) -> None:
    """One JSON value on stdout."""
    sys.stdout.write(json.dumps(value, ensure_ascii=True, allow_nan=False, indent=2) + "\n")


def print_error(message: str) -> None:
    """One red line on stderr."""
    Console(stderr=True).print(Text.assemble(("error: ", "bold red"), (message, "red")), soft_wrap=True)


def print_table(head: Sequence[str], rows: Iterable[Sequence[str | Text]]) -> None:
    """A plain table on stdout; the cells are shown as they are, never read as markup."""
    table = Table(box=None, pad_edge=False, header_style="dim", padding=(0, 2, 0, 0))
    for index, name in enumerate(head):
        table.add_column(name, no_wrap=index == 0)
    for row in rows:
        table.add_row(*(cell if isinstance(cell, Text) else Text(cell) for cell in row))
    Console().print(table)


def print_verdict(result: RunResult, achieved: bool | None, report: Path | None) -> None:
    """The end of a run in a few lines on stdout."""
    believed = result.verdict is RunVerdict.ACHIEVED
    console = Console()
    mark, colour = ("✓", "green") if believed else ("✗", "red")
    verdict = result.verdict.value.replace("_", " ")
    console.print(Text.assemble((f"{mark} {verdict}", f"bold {colour}"), f"  {result.reason}"), soft_wrap=True)
    if achieved is not None:
        agrees = achieved == believed
        truth = "achieved" if achieved else "not achieved"
        note = "" if agrees else "  (the agents believe otherwise)"
        console.print(Text(f"  in truth {truth}{note}", style="dim" if agrees else "bold yellow"))
    if report is not None:
        console.print(Text(f"  {report}", style="cyan"), soft_wrap=True)


def print_checks(checks: Iterable[Check]) -> None:
    """The doctor's findings on stdout, and below them one line for each thing that can be mended."""
    checks = tuple(checks)
    good, bad, optional = Text("✓", style="green"), Text("✗", style="bold red"), Text("–", style="yellow")
    rows = [(check.name, good if check.ok else bad if check.needed else optional, check.detail) for check in checks]
    print_table(("check", "", ""), rows)
    console = Console()
    for check in checks:
        if not check.ok and check.fix:
            word, style = ("needed", "bold red") if check.needed else ("optional", "yellow")
            console.print(Text.assemble((f"{word}: ", style), f"{check.name}: {check.fix}"), soft_wrap=True)
