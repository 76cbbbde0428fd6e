"""An evaluation from end to end. What the command line and Python call."""

from __future__ import annotations

import json
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import Protocol

from .. import __version__
from ..crew import crew_of
from ..errors import UsageError
from . import report, suites, tables
from .cluster import RayExecutor
from .episode import EpisodeResult, Job
from .play import Executor, Play
from .poses import Poses
from .published import published as published_figures
from .results import ResultsFile, Settings
from .suites import Suite
from .summary import Summary, summarise
from .workers import LocalExecutor

SUMMARY, EPISODES_CSV, MARKDOWN, REPORT = "summary.json", "episodes.csv", "summary.md", "report.html"
WORKERS_LOG = "workers.log"
"""What worker processes print, with the tracebacks of crashes."""


class Watcher(Protocol):
    """Anything that wants to follow an evaluation."""

    def begin(self, name: str, total: int, done: Sequence[EpisodeResult]) -> None:
        """`total` episodes are asked for, of which `done` are there from an earlier call."""
        ...

    def add(self, result: EpisodeResult) -> None:
        """One more is finished."""
        ...


def evaluate(
    suite: str | Suite,
    *,
    out: str | Path,
    actor: str = "rules",
    episodes: int = 24,
    seeds: int = 3,
    workers: int = 1,
    time_limit: float = 300.0,
    record: bool = True,
    ray: str | None = None,
    published: bool = False,
    poses: Poses | None = None,
    watcher: Watcher | None = None,
) -> Summary:
    """Play every task of a suite `episodes` x `seeds` times and say how often it succeeds.

    Every finished episode is kept in `out` at once, and an evaluation that was interrupted, however roughly, goes on
    there when it is called again. `workers` episodes are played at a time, each in another process (on a Ray cluster
    where `ray` gives an address) and for `time_limit` seconds of wall time at most. With `record` every episode leaves
    a run folder. `poses` says how objects are placed, for suites that leave that to choose. Scripts that call this need
    `if __name__ == "__main__":`.

    Raises
    ------
    UsageError
        For an unknown name, a number that makes no sense, or a folder that holds something else.
    SetupError
        Where no episode can be played: nothing renders, or something that the suite needs is missing.

    """
    chosen = suites.get(suite) if isinstance(suite, str) else suite
    if poses is not None:
        chosen = suites.placed(chosen, poses)
    _check(chosen, episodes, seeds, workers, time_limit)
    if ray is None:
        chosen.ready()
    settings = Settings(
        suite=chosen.name,
        tasks=chosen.tasks,
        actor=crew_of(actor).name,
        episodes=episodes,
        seeds=seeds,
        time_limit=time_limit,
        version=__version__,
        poses=str(chosen.poses or ""),
    )
    folder = Path(out).resolve()  # workers elsewhere may have another working directory
    figures = published_figures() if published else ()
    jobs = [Job(task, seed, episode) for seed in range(seeds) for episode in range(episodes) for task in chosen.tasks]
    with ResultsFile(folder, settings) as results:
        finished = {result.job for result in results.done}
        if watcher is not None:
            watcher.begin(chosen.name, len(jobs), results.done)
        try:
            if pending := [job for job in jobs if job not in finished]:
                play = Play(chosen, settings.actor, folder if record else None)
                local: Executor = LocalExecutor(play, workers, time_limit, folder / WORKERS_LOG)
                executor = local if ray is None else RayExecutor(play, workers, time_limit, ray)
                _play(executor, pending, results, watcher)
        finally:
            summary = summarise(chosen, settings, Path(out), results.done, len(jobs), figures)
            _write(folder, summary, results.done)
    return summary


def _check(suite: Suite, episodes: int, seeds: int, workers: int, time_limit: float) -> None:
    for name, number in (("episodes", episodes), ("seeds", seeds), ("workers", workers)):
        if number < 1:
            raise UsageError(f"The number of {name} is {number}; it should be 1 or more.")
    if episodes > suite.episodes:
        on_grid = suite.poses is not None and suite.poses.on_grid
        more = "There are more off the grid: --poses off-grid." if on_grid else "Use more seeds."
        raise UsageError(f"The number of episodes is {episodes}; it should be {suite.episodes} or less. {more}")
    if not time_limit > 0:
        raise UsageError(f"The time limit is {time_limit} s; it should be more than 0.")


def _play(executor: Executor, jobs: Sequence[Job], results: ResultsFile, watcher: Watcher | None) -> None:
    with closing(executor.run(jobs)) as played:
        for result in played:
            results.add(result)
            if watcher is not None:
                watcher.add(result)


def _write(folder: Path, summary: Summary, results: Sequence[EpisodeResult]) -> None:
    files = {
        SUMMARY: json.dumps(summary.to_plain(), ensure_ascii=False, allow_nan=False, indent=2) + "\n",
        EPISODES_CSV: tables.episodes_csv(results),
        MARKDOWN: tables.markdown(summary),
        REPORT: report.render(summary),
    }
    for name, content in files.items():
        (folder / name).write_text(content, encoding="utf-8")
