"""The one object a run comes down to: what `--json` prints and summary.json holds."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ..types import RunResult, SubtaskRecord
from .journal import to_plain


def summarise(
    result: RunResult, *, task: str | None, seed: int, achieved: bool | None, out: Path | None
) -> dict[str, Any]:
    """A run as plain JSON data.

    `verdict` is what the agents believe, `achieved` the task's own predicate on the true state, None where nobody
    knows; `seconds` are wall seconds by stage.
    """
    return {
        "task": task,
        "seed": seed,
        "instruction": to_plain(result.instruction),
        "verdict": result.verdict.value,
        "achieved": achieved,
        "reason": to_plain(result.reason),
        "subtasks": [_subtask(record) for record in result.subtasks],
        "seconds": {stage: round(seconds, 3) for stage, seconds in result.seconds.items()},
        "out": None if out is None else str(out),
    }


def _subtask(record: SubtaskRecord) -> dict[str, Any]:
    return {
        "text": to_plain(record.text),
        "objects": to_plain(record.queries),
        "verdict": record.verdict.value,
        "evidence": to_plain(record.evidence),
        "completed": record.outcome.completed,
        "stage": record.outcome.stage,
        "reason": to_plain(record.outcome.reason),
    }
