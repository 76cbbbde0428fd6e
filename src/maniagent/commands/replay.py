"""`maniagent replay`: would the agents decide the same again?"""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .cache import printable
from .common import Json, errors_told

if TYPE_CHECKING:
    from ..replay.play import ReplayResult

SAME, DIFFERENT = 0, 1
"""Exit statuses."""


def replay(folder: Annotated[Path, typer.Argument(help="A run folder.")], as_json: Json = False) -> None:
    """Let the agents decide again about what a recorded run saw, and compare every decision, bit by bit.

    Needs neither robot nor simulator nor network. A run that was cut short is replayed as far as it is recorded.

    Exit status: 0 all decisions are the same, 1 one is different, 2 the folder can't be replayed.
    """
    with errors_told(as_json):
        from ..console.output import print_json
        from ..replay.play import replay as play

        result = play(folder)
        if as_json:
            print_json({**dataclasses.asdict(result), "folder": str(folder), "same": result.same})
        else:
            typer.echo("\n".join(_lines(result)))
        raise typer.Exit(SAME if result.same else DIFFERENT)


def _lines(result: ReplayResult) -> list[str]:
    seen = f"{_counted(result.decisions, 'decision')} on {_counted(result.turns, 'turn')}"
    lines = [f"The same: {seen}." if result.same else f"Different after {seen}: {printable(str(result.difference))}"]
    if not result.complete:
        lines.append("The recorded run was cut short; this is as far as it goes.")
    return lines


def _counted(count: int, thing: str) -> str:
    return f"{count} {thing}" if count == 1 else f"{count} {thing}s"
