"""Going round in circles: seen in the memory, named to the model, refused when it goes on."""

from __future__ import annotations

from collections.abc import Sequence

from ...errors import FailureStage
from ...models.question import Unfit
from ...types import SubtaskRecord, Verdict
from .telling import one_line, plain

MOST_ATTEMPTS = 3
"""Failures in a row of one and the same sub-task, after which another way must be found."""
MOST_FAILURES = 6
"""Failures in a row whatever was tried, after which the arm can't do it."""


def notice(records: Sequence[SubtaskRecord]) -> str:
    """What to say of repetitions so far; empty where there are none worth a word."""
    records = _meant(records)
    if not records:
        return ""
    failures = _failures(records)
    if failures >= MOST_FAILURES:
        return f"Notice: {failures} attempts in a row have failed. If nothing new is left to try, answer cannot."
    times = _tried(records, records[-1].text)
    if times >= 2:
        again = "try another way" if times >= MOST_ATTEMPTS else "if it failed again, think of another way"
        return f'Notice: "{one_line(records[-1].text)}" was tried {times} times in a row; {again}.'
    return ""


def refuse_loop(text: str, records: Sequence[SubtaskRecord]) -> None:
    """Raise Unfit where sub-task `text` would be one attempt too many, or close a circle."""
    records = _meant(records)
    if _failures(records) > MOST_FAILURES:
        raise Unfit(f"More than {MOST_FAILURES} attempts in a row have failed: answer cannot and say why.")
    times = _tried(records, text)
    if times >= MOST_ATTEMPTS:
        raise Unfit(f"This sub-task has failed {times} times in a row. Find another way, or answer cannot.")
    done = [plain(record.text) for record in records[-3:]] + [plain(text)]
    if len(done) == 4 and done[0] == done[2] != done[1] == done[3]:
        raise Unfit(
            f'You go round in circles: "{one_line(records[-2].text)}" and "{one_line(records[-1].text)}" by turns. '
            "Find another way, or answer cannot."
        )


def _meant(records: Sequence[SubtaskRecord]) -> list[SubtaskRecord]:
    """The attempts that say something of the sub-task: that a model can't be reached is not its fault."""
    return [record for record in records if record.outcome.stage != FailureStage.MODEL]


def _tried(records: Sequence[SubtaskRecord], text: str) -> int:
    """How often the sub-task was tried at the end of the memory, without success."""
    count = 0
    for record in reversed(records):
        if plain(record.text) != plain(text) or record.verdict is Verdict.SUCCESS:
            break
        count += 1
    return count


def _failures(records: Sequence[SubtaskRecord]) -> int:
    count = 0
    for record in reversed(records):
        if record.verdict is Verdict.SUCCESS or (record.verdict is Verdict.INITIAL and record.outcome.completed):
            break
        count += 1
    return count
