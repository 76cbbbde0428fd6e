"""Ray: the same episodes on the machines of a cluster (extra `ray`)."""

from __future__ import annotations

from collections import deque
from collections.abc import Generator, Sequence
from typing import Any

from ..cluster import Cluster
from .episode import CRASH, EpisodeResult, Job, lost
from .play import Play
from .workers import LocalExecutor


class RayExecutor:
    """Plays jobs on a Ray cluster, `workers` at a time, one CPU each.

    On its node every episode has a process of its own, so that crashes and time-outs are told apart there as they are
    on one machine. Run folders are written where the episode is played: the evaluation's folder should lie on a
    file system that all nodes share.
    """

    def __init__(self, play: Play, workers: int, time_limit: float, address: str) -> None:
        """Connect; `address` as for Cluster. Raises SetupError where none answers."""
        self._play, self._workers, self._time_limit = play, workers, time_limit
        self._cluster = Cluster(address)

    def run(self, jobs: Sequence[Job]) -> Generator[EpisodeResult, None, None]:
        """See Executor."""
        ray, waiting = self._cluster.ray, deque(jobs)
        remote = ray.remote(num_cpus=1, max_retries=0)(_play_on_node)
        running: dict[Any, Job] = {}
        try:
            while waiting or running:
                while waiting and len(running) < self._workers:
                    job = waiting.popleft()
                    running[remote.remote(self._play, job, self._time_limit)] = job
                ready, _ = ray.wait(list(running), num_returns=1)
                for reference in ready:
                    yield self._result(reference, running.pop(reference))
        finally:
            for reference in running:
                ray.cancel(reference, force=True)
            self._cluster.close()

    def _result(self, reference: Any, job: Job) -> EpisodeResult:
        """What came of a job; raises on what the episode raised on purpose."""
        ray = self._cluster.ray
        try:
            result: EpisodeResult = ray.get(reference)
        except ray.exceptions.RayTaskError as error:
            raise self._cluster.cause(error) from error
        except ray.exceptions.RayError as error:
            return lost(job, CRASH, f"Ray lost the episode: {type(error).__name__}: {error}")
        return result


def _play_on_node(play: Play, job: Job, time_limit: float) -> EpisodeResult:
    (result,) = LocalExecutor(play, 1, time_limit).run([job])
    return result
