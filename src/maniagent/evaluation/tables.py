"""An evaluation as tables of text: for the terminal, for Markdown, for a spreadsheet."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from .episode import EpisodeResult, scene_seed
from .statistics import Rate, Row
from .summary import Summary


@dataclass(frozen=True)
class Table:
    """Headings and rows of text."""

    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]

    def columns(self, count: int) -> Table:
        """Its first columns alone, for where there is little room."""
        return Table(self.head[:count], tuple(row[:count] for row in self.rows))


Columns = dict[str, Callable[[Row], str]]


def outcome_table(summary: Summary) -> Table:
    """How often each task succeeds, and the average."""
    return _by_row(summary, _outcome_columns(summary))


def result_table(summary: Summary) -> Table:
    """The same, and what it took. Columns that nobody filled are left out."""
    return _by_row(summary, {**_outcome_columns(summary), **_EFFORT})


def _outcome_columns(summary: Summary) -> Columns:
    criteria = dict.fromkeys(name for row in summary.rows for name in row.criteria)
    return {
        "task": lambda row: row.task,
        "episodes": lambda row: str(row.success.episodes),
        "success %": lambda row: _rate(row.success),
        "95 % interval": lambda row: interval(row.success),
        **{f"{name} %": _by_criterion(name) for name in criteria},
        "verdict right %": lambda row: _rate(row.agreement),
        "same each time %": lambda row: _percent(row.repeats_agree),
    }


_EFFORT: Columns = {
    "turns": lambda row: _number(row.turns),
    "steps": lambda row: _number(row.steps),
    "robot s": lambda row: _number(row.robot_seconds),
    "model calls": lambda row: f"{row.model_calls or ''}",
    "tokens": lambda row: f"{row.tokens or ''}",
    "wall s": lambda row: _number(row.wall_seconds_median),
    "longest s": lambda row: _number(row.wall_seconds_max),
}


def _by_row(summary: Summary, columns: Columns) -> Table:
    cells = {name: [text(row) for row in summary.everything] for name, text in columns.items()}
    filled = {name: texts for name, texts in cells.items() if any(texts)}
    return Table(tuple(filled), tuple(zip(*filled.values(), strict=True)))


def time_table(summary: Summary) -> Table:
    """What the wall time goes into; no rows where nobody took the time."""
    kinds = dict.fromkeys(name for row in summary.rows for name in row.shares)
    shares: Columns = {f"{name} %": _by_share(name) for name in kinds}
    task: Columns = {"task": lambda row: row.task}
    pace: Columns = {"episodes/min, 1 worker": lambda row: _number(row.per_minute)}
    return _by_row(summary, {**task, **pace, **shares}) if kinds else Table((), ())


def stage_table(summary: Summary) -> Table:
    """What went wrong, by stage."""
    rows = ((count.stage, str(count.episodes), str(count.turns)) for count in summary.stages)
    return Table(("stage", "failed episodes", "failed turns"), tuple(rows))


def published_table(summary: Summary) -> Table:
    """Our average, and the published figures under it; no rows where none are shown."""
    ours = summary.average
    first = (
        f"maniagent, {summary.settings.actor}",
        f"{summary.settings.suite}, average of {len(summary.rows)}",
        percent(ours.success.value) if ours else "",
        "this evaluation",
        f"95 % interval {interval(ours.success)}" if ours else "",
    )
    rows = [(f.method, f.benchmark, f"{f.success:.1f} %", f.source or "–", f.caveat) for f in summary.published]
    head = ("method", "benchmark", "success", "source", "not comparable")
    return Table(head, (first, *rows) if rows else ())


def markdown(summary: Summary) -> str:
    """summary.md."""
    settings = summary.settings
    parts = [
        f"# {settings.suite}, {settings.actor}",
        f"{summary.finished} of {summary.total} episodes: {settings.episodes} for each task and seed, seeds 0 to "
        f"{settings.seeds - 1}{f'; poses: {settings.poses}' if settings.poses else ''}. maniagent {settings.version}. "
        f"Medians of turns, steps and seconds; {interval_note(summary)}; the average weighs every task the same.",
        markdown_table(result_table(summary)),
    ]
    if (times := time_table(summary)).rows:
        parts += ["## Wall time", markdown_table(times)]
    if summary.stages:
        parts += ["## Failures by stage", markdown_table(stage_table(summary))]
    if summary.failed:
        rows = tuple(
            (failed.result.job.name, failed.result.stage, failed.result.reason, f"`{failed.repeat}`")
            for failed in summary.failed
        )
        parts += ["## Failed episodes", markdown_table(Table(("episode", "stage", "reason", "again"), rows))]
    if summary.published:
        parts += ["## Published figures", markdown_table(published_table(summary))]
    return "\n\n".join(parts) + "\n"


def episodes_csv(results: Iterable[EpisodeResult]) -> str:
    """episodes.csv: one line an episode, in order."""
    plain = [
        {**result.model_dump(mode="json"), "scene_seed": scene_seed(result.seed, result.episode)}
        for result in sorted(results, key=lambda result: result.job)
    ]
    text = io.StringIO()
    writer = csv.DictWriter(text, [*EpisodeResult.model_fields, "scene_seed"], lineterminator="\n")
    writer.writeheader()
    for row in plain:
        writer.writerow({name: json.dumps(v) if isinstance(v, dict) else v for name, v in row.items()})
    return text.getvalue()


def interval_note(summary: Summary) -> str:
    """What the intervals are."""
    repeated = summary.average is not None and summary.average.success.scenes < summary.average.success.episodes
    return "Wilson 95 % intervals" + (", which count a scene once however often it was played" if repeated else "")


def percent(share: float) -> str:
    """A share as percent with one decimal."""
    return f"{100 * share:.1f} %"


def interval(rate: Rate) -> str:
    """The interval of a rate, in percent."""
    return f"{100 * rate.low:.1f}–{100 * rate.high:.1f}"


def _by_share(name: str) -> Callable[[Row], str]:
    return lambda row: _percent(row.shares.get(name, 0.0))


def _by_criterion(name: str) -> Callable[[Row], str]:
    return lambda row: _rate(row.criteria.get(name))


def _rate(rate: Rate | None) -> str:
    return "" if rate is None else f"{100 * rate.value:.1f}"


def _percent(share: float | None) -> str:
    return "" if share is None else f"{100 * share:.1f}"


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.1f}".removesuffix(".0")


def markdown_table(table: Table) -> str:
    """The table in Markdown; what would break it in a cell is escaped."""
    lines = [table.head, ("---",) * len(table.head), *table.rows]
    return "\n".join(f"| {' | '.join(map(_markdown_cell, line))} |" for line in lines)


def _markdown_cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|").replace("<", "&lt;")
