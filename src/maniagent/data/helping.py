"""What is done where the robot can't go on by itself: help that counts as an intervention."""

from __future__ import annotations

import sys
from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import IO

from rich.console import Console
from rich.panel import Panel
from rich.text import Text

from ..errors import SetupError, UnknownNameError
from .collector import Helper

Paused = Callable[[], AbstractContextManager[Console]]
"""Holds a live display, for writing on its console."""


def helper_for(when: str, paused: Paused) -> Helper:
    """Who helps. "put": nobody, as simulation puts things back by itself; "ask": a person; "stop": the collection ends.

    Raises UsageError for anything else.
    """
    helpers: dict[str, Helper] = {"put": _let_be, "ask": AskPerson(paused, sys.stdin), "stop": _stop}
    if when not in helpers:
        raise UnknownNameError("way to go on", when, helpers)
    return helpers[when]


class AskPerson:
    """Tells a person what the robot can't do, and waits until they have done it."""

    def __init__(self, paused: Paused, answers: IO[str]) -> None:
        self._paused, self._answers = paused, answers

    def __call__(self, why: str) -> None:
        """See Helper. Raises SetupError where nobody is there to answer."""
        with self._paused() as console:
            todo = "Put what it works with back onto the table, where it can reach it. Then press Enter."
            told = Text(f"{' '.join(why.split())}\n\n{todo}\n(Ctrl-C ends the collection; what it has is kept.)")
            console.print(Panel(told, title="The robot needs a hand", style="yellow", expand=False))
            if not self._answers.readline():
                raise SetupError(f"{why} Nobody is there to help: start it in a terminal, or with --when-stuck stop.")


def _let_be(why: str) -> None:
    """In simulation the station puts things back by itself."""


def _stop(why: str) -> None:
    raise SetupError(f"{why} Put things back, and run the same command again.")
