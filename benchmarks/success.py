"""How often the `rules` agents carry out the tasks that need no model, judged on true state.

    python benchmarks/success.py                            # tasks 1 to 4 and Bridge's four, 25 seeds each
    python benchmarks/success.py --tasks drag-plate --seeds 100 --workers 2 --out figures.json

Every failure can be seen again: `maniagent run --task NAME --seed N --out DIR` repeats it exactly.
"""

from __future__ import annotations

import json
import os
import statistics
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

from maniagent import tasks


@dataclass(frozen=True)
class Episode:
    """One run of one task."""

    task: str
    seed: int
    achieved: bool
    verdict: str
    reason: str
    attempts: int
    wall_seconds: float


def run_episode(task: str, seed: int) -> Episode:
    """One episode in this process, without a recording."""
    from maniagent.app import run

    start = time.perf_counter()
    outcome = run(task=task, seed=seed)
    took = time.perf_counter() - start
    result = outcome.result
    return Episode(
        task, seed, bool(outcome.achieved), str(result.verdict), result.reason, len(result.subtasks), round(took, 2)
    )


def episodes(names: list[str], seeds: int, workers: int) -> Iterator[Episode]:
    """All episodes, as they finish."""
    os.environ.setdefault("OMP_NUM_THREADS", "1")  # one core a worker, or the workers fight for all of them
    with ProcessPoolExecutor(workers) as pool:
        pending = [pool.submit(run_episode, name, seed) for seed in range(seeds) for name in names]
        for future in as_completed(pending):
            yield future.result()


def show(console: Console, found: list[Episode], names: list[str]) -> None:
    """The table, and what the failures were."""
    table = Table("task", "achieved", "agents right about it", "attempts", "median s", "max s")
    for name in names:
        mine = [e for e in found if e.task == name]
        if not mine:
            continue
        good = sum(e.achieved for e in mine)
        right = sum(e.achieved == (e.verdict == "achieved") for e in mine)
        walls = [e.wall_seconds for e in mine]
        table.add_row(
            name,
            f"{good}/{len(mine)} ({good / len(mine):.1%})",
            f"{right}/{len(mine)}",
            f"{statistics.mean(e.attempts for e in mine):.2f}",
            f"{statistics.median(walls):.1f}",
            f"{max(walls):.1f}",
        )
    console.print(table)
    for e in sorted(found, key=lambda e: (e.task, e.seed)):
        if not e.achieved:
            console.print(f"{e.task} seed {e.seed}: {e.verdict}: {e.reason}", highlight=False)


def main(
    names: Annotated[
        list[str] | None, typer.Option("--tasks", help="Task name; give it several times for more.")
    ] = None,
    seeds: Annotated[int, typer.Option(help="Episodes per task, seeds 0 to N - 1.")] = 25,
    workers: Annotated[int, typer.Option(help="Processes.")] = 2,
    out: Annotated[Path | None, typer.Option(help="Save every episode to this JSON file.")] = None,
) -> None:
    """Run the episodes and print the table."""
    chosen = names or [name for name in tasks.names() if not tasks.get(name).needs_model]
    console = Console()
    found: list[Episode] = []
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, TimeRemainingColumn(), console=Console(stderr=True)) as progress:
        bar = progress.add_task("episodes", total=len(chosen) * seeds)
        for episode in episodes(chosen, seeds, workers):
            found.append(episode)
            failed = sum(not e.achieved for e in found)
            progress.update(bar, advance=1, description=f"episodes ({failed} not achieved)")
    show(console, found, chosen)
    if out is not None:
        out.write_text(json.dumps([asdict(e) for e in found], indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    typer.run(main)
