"""Ray: the same episodes on the machines of a cluster (extra `ray`)."""

from __future__ import annotations

from collections import deque
from collections.abc import Generator, Sequence
from typing import Any

from ..errors import ManiAgentError, SetupError
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
        """Connect; `address` is as Ray's: "auto", "ray://host:port", "host:port", or "local" for a cluster of its own.

        Raises SetupError where Ray isn't installed or doesn't answer.
        """
        self._play, self._workers, self._time_limit = play, workers, time_limit
        self._ray = _import_ray()
        self._connected = not self._ray.is_initialized()  # else the caller's connection is used, and left alone
        try:
            self._ray.init(address=address, log_to_driver=False, logging_level="error", ignore_reinit_error=True)
        except (ConnectionError, ValueError, RuntimeError) as error:
            raise SetupError(f"No Ray cluster answers at {address!r}: {error}") from error

    def run(self, jobs: Sequence[Job]) -> Generator[EpisodeResult, None, None]:
        """See Executor."""
        ray, waiting = self._ray, deque(jobs)
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
            if self._connected:
                ray.shutdown()

    def _result(self, reference: Any, job: Job) -> EpisodeResult:
        """What came of a job; raises on what the episode raised on purpose."""
        try:
            result: EpisodeResult = self._ray.get(reference)
        except self._ray.exceptions.RayTaskError as error:
            if isinstance(error.cause, ManiAgentError):
                raise error.cause from None
            raise SetupError(f"A node can't play episodes (is the same maniagent installed there?): {error}") from error
        except self._ray.exceptions.RayError as error:
            return lost(job, CRASH, f"Ray lost the episode: {type(error).__name__}: {error}")
        return result


def _play_on_node(play: Play, job: Job, time_limit: float) -> EpisodeResult:
    (result,) = LocalExecutor(play, 1, time_limit).run([job])
    return result


def _import_ray() -> Any:
    try:
        import ray
    except ImportError:
        raise SetupError("Evaluating on a cluster takes Ray: pip install 'maniagent[ray]'") from None
    return ray
