"""What an evaluation comes to: the object behind summary.json, the tables and the report."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from .episode import EpisodeResult, scene_seed
from .published import Published
from .results import Settings
from .statistics import Row, StageCount, average, rows, stage_counts
from .suites import Suite


@dataclass(frozen=True)
class Failed:
    """A failed episode, and how to see it fail again."""

    result: EpisodeResult
    repeat: str
    """A command."""


@dataclass(frozen=True)
class Summary:
    """All there is to say about an evaluation; it may have been interrupted."""

    settings: Settings
    out: Path
    total: int
    """Episodes asked for."""
    finished: int
    rows: tuple[Row, ...]
    average: Row | None
    stages: tuple[StageCount, ...]
    failed: tuple[Failed, ...]
    published: tuple[Published, ...] = ()

    @property
    def everything(self) -> tuple[Row, ...]:
        """The rows of the tasks and, where there are several, the average below them."""
        return (*self.rows, self.average) if self.average is not None and len(self.rows) > 1 else self.rows

    def to_plain(self) -> dict[str, Any]:
        """It as plain JSON data."""
        return {
            **self.settings.model_dump(mode="json"),
            "out": str(self.out),
            "complete": self.finished == self.total,
            "total": self.total,
            "finished": self.finished,
            "results": [_plain_row(row) for row in self.rows],
            "average": _plain_row(self.average) if self.average is not None else None,
            "failures_by_stage": {
                count.stage: {"episodes": count.episodes, "turns": count.turns} for count in self.stages
            },
            "failed": [_plain_failed(failed) for failed in self.failed],
            "published": [figure.model_dump(mode="json") for figure in self.published],
        }


def summarise(
    suite: Suite,
    settings: Settings,
    out: Path,
    results: Sequence[EpisodeResult],
    total: int,
    published: tuple[Published, ...] = (),
) -> Summary:
    """Put the finished episodes together."""
    results = sorted(results, key=lambda result: (suite.tasks.index(result.task), result.seed, result.episode))
    per_task = rows(results, suite.tasks, suite.seeds_draw_scenes)
    return Summary(
        settings=settings,
        out=out,
        total=total,
        finished=len(results),
        rows=per_task,
        average=average(per_task, results),
        stages=stage_counts(results),
        failed=tuple(
            Failed(result, suite.repeat(result.job, settings.actor)) for result in results if not result.success
        ),
        published=published,
    )


def _plain_row(row: Row) -> dict[str, Any]:
    plain = asdict(row)
    return {"task": plain.pop("task"), "episodes": row.success.episodes, **plain}


def _plain_failed(failed: Failed) -> dict[str, Any]:
    result = failed.result
    return {
        "task": result.task,
        "seed": result.seed,
        "episode": result.episode,
        "scene_seed": scene_seed(result.seed, result.episode),
        "stage": result.stage,
        "reason": result.reason,
        "repeat": failed.repeat,
        "folder": result.folder,
    }
