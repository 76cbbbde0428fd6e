"""What a collection came to, in numbers and as a map."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Sequence

from pydantic import BaseModel, ConfigDict

from ..evaluation.statistics import Rate
from .episode import EpisodeInfo
from .sessions import Costs

PAPER_THRESHOLD = 0.15
"""m, what the paper counts as success."""


class Summary(BaseModel):
    """The figures of a collection so far."""

    model_config = ConfigDict(frozen=True)

    task: str
    wanted: int
    attempts: int
    valid: int
    failed: int
    doubtful: int
    within_paper_threshold: int
    """Attempts that ended within 15 cm."""
    interventions: int
    seconds: float
    """Wall time, all sessions together."""
    per_hour: float | None
    """Valid episodes."""
    writing_share: float | None
    """Of the workers' wall time: forcing episodes onto the disk."""
    encoding_seconds: float
    """Processor time of the process that writes the dataset, for each valid episode."""
    encoding_share: float | None
    """Of the machine's processor time while collecting: the same."""
    precision: float | None
    """Of the label "valid", against the simulator's predicate; None where nobody knows the truth."""
    recall: float | None
    reasons: dict[str, int]
    """Why attempts weren't valid."""


def summarise(task: str, wanted: int, attempts: Sequence[EpisodeInfo], costs: Costs) -> Summary:
    """The figures."""
    labels = Counter(info.label for info in attempts)
    cores = os.cpu_count() or 1
    known = [info for info in attempts if info.truly_valid is not None]
    both = sum(info.label == "valid" and bool(info.truly_valid) for info in known)
    said, true = sum(info.label == "valid" for info in known), sum(bool(info.truly_valid) for info in known)
    return Summary(
        task=task,
        wanted=wanted,
        attempts=len(attempts),
        valid=labels["valid"],
        failed=labels["failed"],
        doubtful=labels["doubtful"],
        within_paper_threshold=sum(i.distance is not None and i.distance <= PAPER_THRESHOLD for i in attempts),
        interventions=sum(info.interventions for info in attempts),
        seconds=round(costs.seconds, 1),
        per_hour=round(3600 * labels["valid"] / costs.seconds, 1) if costs.seconds > 0 else None,
        writing_share=round(costs.writing / costs.working, 4) if costs.working > 0 else None,
        encoding_seconds=round(costs.encoding / labels["valid"], 3) if labels["valid"] else 0.0,
        encoding_share=round(costs.encoding / (costs.seconds * cores), 4) if costs.seconds > 0 else None,
        precision=both / said if said else None,
        recall=both / true if true else None,
        reasons=dict(Counter(info.reason for info in attempts if info.label != "valid").most_common(20)),
    )


def rows(summary: Summary) -> list[tuple[str, str]]:
    """The same for a person: names and figures."""
    valid = Rate.of([True] * summary.valid + [False] * (summary.attempts - summary.valid))
    return [
        ("valid episodes", f"{summary.valid} of {summary.wanted} wanted"),
        (
            "attempts",
            f"{summary.attempts}: {summary.valid} valid, {summary.failed} failed, {summary.doubtful} doubtful",
        ),
        ("valid share", f"{100 * valid.value:.1f} % (95 % interval {100 * valid.low:.1f}–{100 * valid.high:.1f})"),
        ("attempts that ended within 15 cm", str(summary.within_paper_threshold)),
        ("interventions", str(summary.interventions)),
        ("wall time", f"{summary.seconds:.0f} s"),
        ("valid episodes an hour", "–" if summary.per_hour is None else f"{summary.per_hour:.0f}"),
        ("writing episodes", f"{_percent(summary.writing_share)} of the workers' time"),
        ("encoding the dataset", _encoding(summary)),
        ("precision of the label", _percent(summary.precision)),
        ("recall of the label", _percent(summary.recall)),
    ]


def _encoding(summary: Summary) -> str:
    if not summary.encoding_seconds:
        return "–"
    return f"{summary.encoding_seconds:.1f} s of a core each, {_percent(summary.encoding_share)} of the machine's"


def _percent(share: float | None) -> str:
    return "–" if share is None else f"{100 * share:.1f} %"


def to_markdown(summary: Summary) -> str:
    """The same as a file."""
    lines = [f"# Collection: {summary.task}", "", "| what | figure |", "| --- | --- |"]
    lines += [f"| {name} | {figure} |" for name, figure in rows(summary)]
    if summary.reasons:
        lines += ["", "## Why attempts weren't valid", "", "| times | reason |", "| --- | --- |"]
        lines += [f"| {count} | {' '.join(reason.split())} |" for reason, count in summary.reasons.items()]
    return "\n".join(lines) + "\n"
