"""The lines in one page of Markdown."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence

import numpy as np

from maniagent.evaluation.statistics import Rate
from maniagent.evaluation.tables import Table, markdown_table

from .results import Line

Column = Callable[[Sequence[Line]], str]


def share(of: Callable[[Line], bool]) -> Column:
    """A column: how many of the lines, in percent, with the Wilson 95 % interval."""

    def cell(lines: Sequence[Line]) -> str:
        rate = Rate.of([of(line) for line in lines])
        return f"{100 * rate.value:.0f} % ({100 * rate.low:.0f}–{100 * rate.high:.0f})" if lines else "–"

    return cell


def spread(of: Callable[[Line], float]) -> Column:
    """A column: median and 95th percentile."""

    def cell(lines: Sequence[Line]) -> str:
        if not lines:
            return "–"
        median, p95 = np.percentile([of(line) for line in lines], [50, 95])
        return f"{median:.0f} / {p95:.0f}"

    return cell


def total(of: Callable[[Line], int]) -> Column:
    """A column: the sum."""
    return lambda lines: str(sum(map(of, lines)))


REASONING: dict[str, Column] = {
    "questions": lambda lines: str(len(lines)),
    "first answer fits": share(lambda line: line.fits_first),
    "fits after repair": share(lambda line: line.fits),
    "names a sub-task": share(lambda line: line.next == "act"),
    "of the objects meant": share(lambda line: line.right),
}
CONTROLLER: dict[str, Column] = {
    "questions": lambda lines: str(len(lines)),
    "first answer fits": share(lambda line: line.fits_first),
    "fits after repair": share(lambda line: line.fits),
    "first sequence passes the gate": share(lambda line: line.passes_first),
    "one of three passes": share(lambda line: line.passes),
    "the rules' own passes": share(lambda line: line.rules_pass),
    "carried out to the end": share(lambda line: line.completed),
    "unfit answers refused": total(lambda line: line.unfit),
    "reached the robot": total(lambda line: line.executed),
    "malformed reached the robot": total(lambda line: bool(line.malformed)),
}
EFFORT: dict[str, Column] = {
    "questions": lambda lines: str(len(lines)),
    "calls": spread(lambda line: line.calls),
    "seconds of the model": spread(lambda line: line.model_seconds),
    "tokens read": spread(lambda line: line.tokens_in),
    "tokens written": spread(lambda line: line.tokens_out),
}


def markdown(model: str, lines: Sequence[Line], wanted: int) -> str:
    """The page."""
    reasoning = [line for line in lines if line.role == "reasoning"]
    controller = [line for line in lines if line.role == "controller" and line.calls]
    unasked = sum(line.role == "controller" and not line.calls for line in lines)
    own = [line for line in controller if line.source == "model"]
    given = [line for line in controller if line.source == "rules"]
    note = f" {unasked} were never asked: what was to be moved wasn't found or offers no grasp." if unasked else ""
    parts = [
        f"# Sub-task requests, {model}",
        f"{len(reasoning)} of {wanted} reasoning questions and {len(controller)} of {wanted} controller questions. "
        "Shares of questions with Wilson 95 % intervals; effort as median / 95th percentile of a question, its "
        "repairs included. Malformed is what the checks beside the gate object to: the accepted sequence's JSON, the "
        "key points at the robot's door, every command to its servos.",
        "## Reasoning",
        _table({"all": reasoning} | _by_kind(reasoning), REASONING),
        "## Controller",
        f"Asked about the model's own sub-task where it names one, else about the rule-made one.{note}",
        _table(
            {"all": controller, "on its own sub-tasks": own, "on rule-made ones": given} | _by_kind(controller),
            CONTROLLER,
        ),
        "### Why it wasn't its own",
        _counts("reason", [_gist(line.instead) for line in controller if line.instead]),
        "## Effort",
        _table({"reasoning": reasoning, "controller": controller}, EFFORT),
        "## Why the first answer didn't fit",
        _counts("reason", [f"{line.role}: {_gist(line.complaint)}" for line in lines if line.complaint]),
        "## What ended a request",
        _counts(
            "stage and reason", [f"{line.role}, {line.stage}: {_gist(line.reason)}" for line in lines if line.stage]
        ),
    ]
    if malformed := [f"{line.request}: {'; '.join(line.malformed)}" for line in controller if line.malformed]:
        parts += ["## Malformed at the robot", "\n".join(f"- {text}" for text in malformed)]
    return "\n\n".join(parts) + "\n"


def _by_kind(lines: Sequence[Line]) -> dict[str, list[Line]]:
    return {kind: [line for line in lines if line.kind == kind] for kind in dict.fromkeys(line.kind for line in lines)}


def _table(rows: dict[str, list[Line]], columns: dict[str, Column]) -> str:
    cells = tuple((name, *(cell(lines) for cell in columns.values())) for name, lines in rows.items())
    return markdown_table(Table(("", *columns), cells))


def _counts(head: str, texts: Sequence[str], most: int = 12) -> str:
    rows = tuple((text, str(count)) for text, count in Counter(texts).most_common(most))
    return markdown_table(Table((head, "questions"), rows)) if rows else "None."


def _gist(reason: str) -> str:
    """A reason without the numbers in which one differs from the next."""
    words = ["N" if any(c.isdigit() for c in word) else word for word in reason.split()]
    return " ".join(words)[:110]
