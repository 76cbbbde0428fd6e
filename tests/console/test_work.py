"""The display of long work: what a person reads on a terminal, and what a log file gets."""

from __future__ import annotations

import io

import pytest
from rich.console import Console

from maniagent.console.work import WorkDisplay


class Chores(WorkDisplay):
    things = "chores"

    def begin(self, total: int, done: int) -> None:
        self._begin("chores", total, done)

    def do(self, name: str, why: str = "") -> None:
        self._done += 1
        self._show("✓" if not why else "✗", "green", name, why, 1.5, always=bool(why))


def shown(*, terminal: bool) -> Console:
    return Console(file=io.StringIO(), force_terminal=terminal, width=100, no_color=True, legacy_windows=False)


def text_of(console: Console) -> str:
    return console.file.getvalue()  # type: ignore[attr-defined, no-any-return]


def test_a_log_gets_a_line_for_everything_and_a_terminal_for_what_needs_a_look() -> None:
    for terminal, lines in ((False, ["✓ 3/9 sweep  1.5 s", "✗ 4/9 dishes  one broke  1.5 s"]), (True, ["one broke"])):
        console = shown(terminal=terminal)
        with Chores(console) as chores:
            chores.begin(9, 2)
            chores.do("sweep")
            chores.do("dishes", "one\nbroke")
        for line in ["Going on: 2 of 9 chores are there.", *lines]:
            assert line in text_of(console)
        assert ("sweep" in text_of(console)) is not terminal


def test_the_time_left_follows_from_what_this_call_has_done() -> None:
    now = [0.0]
    with Chores(shown(terminal=False), clock=lambda: now[0]) as chores:
        chores.begin(10, 4)
        assert chores.told == ""
        now[0] = 30.0
        chores.do("sweep")
        chores.do("dishes")
        assert chores.told == "4 a minute · 0:01:00 left"


def test_what_is_cut_off_says_what_is_kept_and_a_pause_hands_out_the_console() -> None:
    console = shown(terminal=False)
    with pytest.raises(KeyboardInterrupt), Chores(console) as chores:  # noqa: PT012
        chores.begin(3, 0)
        chores.do("sweep")
        with chores.paused() as talk:
            assert talk is console
        raise KeyboardInterrupt
    assert "1 of 3 chores are kept; the same command goes on from there." in text_of(console)
