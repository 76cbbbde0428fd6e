"""How one job of an evaluation is played, wherever that happens: in a worker process, or on a node of a cluster."""

from __future__ import annotations

import time
from collections.abc import Generator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from .episode import EpisodeResult, Job
from .suites import Suite

EPISODES = "episodes"
"""Folder of the run folders, within the evaluation's."""


@dataclass(frozen=True)
class Play:
    """Plays jobs. Goes to other processes by pickling, so that it holds names and functions of modules only."""

    suite: Suite
    actor: str
    out: Path | None
    """The evaluation's folder, where episodes are to be recorded."""

    def __call__(self, job: Job) -> EpisodeResult:
        """Play one episode and take its time; raises what the suite raises."""
        relative = f"{EPISODES}/{job.name}" if self.out else ""
        folder = self.out / relative if self.out else None
        start = time.monotonic()
        result = self.suite.run_episode(job.task, job.seed, job.episode, self.actor, folder)
        wall = time.monotonic() - start
        parts = dict(result.seconds)
        if parts:
            parts["other"] = wall - sum(parts.values())
        seconds = {name: round(spent, 3) for name, spent in parts.items()}
        return result.model_copy(update={"wall_seconds": round(wall, 2), "seconds": seconds, "folder": relative})


class Executor(Protocol):
    """Plays many jobs at once."""

    def run(self, jobs: Sequence[Job]) -> Generator[EpisodeResult, None, None]:
        """The results in the order in which they come. A job that crashes, dies or takes too long is a failed one.

        Raises UsageError or SetupError where an episode says that no episode can be played like this. Closing the
        iterator stops everything that is under way.
        """
        ...
