"""Worker processes on this machine: an episode may crash, hang or take its process down, and costs itself alone."""

from __future__ import annotations

import contextlib
import multiprocessing
import signal
import time
import traceback
from collections import deque
from collections.abc import Generator, Iterator, Sequence
from multiprocessing.connection import Connection, wait
from pathlib import Path

from ..errors import SetupError, UsageError
from ..processes import become_worker, starting_workers
from .episode import CRASH, TIME_LIMIT, EpisodeResult, Job, lost
from .play import Play

_START_LIMIT = 180.0
"""Seconds that a worker may take to start, imports included."""


class LocalExecutor:
    """Plays jobs in `workers` processes of this machine, each episode for `time_limit` seconds at most.

    The processes are spawned, as rendering contexts and threads don't survive a fork: a script that gets here keeps
    its own doings under `if __name__ == "__main__":`. What they and their libraries print goes to the end of `log`, as
    do the tracebacks of crashes; without it, to stderr.
    """

    def __init__(self, play: Play, workers: int, time_limit: float, log: Path | None = None) -> None:
        self._play, self._workers, self._time_limit, self._log = play, workers, time_limit, log

    def run(self, jobs: Sequence[Job]) -> Generator[EpisodeResult, None, None]:
        """See Executor."""
        waiting = deque(jobs)
        crew: list[_Worker] = []
        try:
            while waiting or any(worker.job for worker in crew):
                crew = [worker for worker in crew if worker.alive]
                while len(crew) < min(self._workers, len(waiting) + sum(worker.job is not None for worker in crew)):
                    crew.append(_Worker(self._play, self._log))
                for worker in crew:
                    if waiting and worker.idle:
                        worker.start(waiting.popleft(), self._time_limit)
                yield from _finished(crew)
        finally:
            for worker in crew:
                worker.kill()


def _finished(crew: Sequence[_Worker]) -> Iterator[EpisodeResult]:
    """Wait until a worker has something to say or has run out of time; the results that come of it."""
    soonest = min(worker.deadline for worker in crew)
    ready = wait([worker.connection for worker in crew], timeout=max(0.0, soonest - time.monotonic()))
    for worker in crew:
        result = worker.hear() if worker.connection in ready else worker.check_time()
        if result is not None:
            yield result


class _Worker:
    """One process, seen from the parent."""

    def __init__(self, play: Play, log: Path | None) -> None:
        context = multiprocessing.get_context("spawn")
        self.connection, theirs = context.Pipe()
        self._most = play.suite.episodes_per_process
        self._process = context.Process(target=_serve, args=(theirs, play, log), daemon=True)
        with starting_workers():
            self._process.start()
        theirs.close()  # so that its death shows as the end of the connection
        self.alive, self._ready = True, False
        self.job: Job | None = None
        self._played = 0
        self._began = time.monotonic()
        self._limit = _START_LIMIT

    @property
    def idle(self) -> bool:
        """Whether it waits for a job."""
        return self.alive and self._ready and self.job is None

    @property
    def deadline(self) -> float:
        """Monotonic time by which it has to answer; infinitely far while nothing is asked of it."""
        return float("inf") if self.idle else self._began + self._limit

    def start(self, job: Job, limit: float) -> None:
        """Hand it a job."""
        self.job, self._began, self._limit = job, time.monotonic(), limit
        with contextlib.suppress(BrokenPipeError):  # it died while it waited; the end of the connection tells so
            self.connection.send(job)

    def hear(self) -> EpisodeResult | None:
        """What it says: a result, or None where it only says that it is ready.

        Raises the error for which no episode can be played, or SetupError where the process can't even start.
        """
        try:
            answer = self.connection.recv()
        except (EOFError, ConnectionResetError):
            return self._died()
        if answer is None:
            self._ready = True
            return None
        self.job = None
        if not isinstance(answer, EpisodeResult):
            raise answer
        self._played += 1
        if self._played >= self._most:
            self.kill()
        return answer

    def check_time(self) -> EpisodeResult | None:
        """End the process where it is late; the result of the job that this costs."""
        seconds = time.monotonic() - self._began
        if self.idle or seconds < self._limit:
            return None
        self.kill()
        if self.job is None:
            raise SetupError(f"A worker process did not start within {_START_LIMIT:.0f} s.")
        return self._lose(TIME_LIMIT, f"Stopped because it took longer than {self._limit:g} s.")

    def kill(self) -> None:
        """End the process, whatever it does."""
        self.alive = False
        self._process.kill()
        self._process.join()
        self.connection.close()

    def _died(self) -> EpisodeResult | None:
        self._process.join()
        code = self._process.exitcode or 0
        how = f"killed by {signal.Signals(-code).name}" if code < 0 else f"exit status {code}"
        self.kill()
        if not self._ready:
            raise SetupError(
                f"A worker process did not start ({how}). A script that evaluates needs "
                'if __name__ == "__main__": around what it does.'
            )
        return self._lose(CRASH, f"The worker process died: {how}.") if self.job is not None else None

    def _lose(self, stage: str, reason: str) -> EpisodeResult:
        assert self.job is not None  # noqa: S101 - both callers have looked
        job, self.job = self.job, None
        return lost(job, stage, reason, round(time.monotonic() - self._began, 2))


def _serve(connection: Connection[object, Job], play: Play, log: Path | None) -> None:
    """What a worker process does: play one job after another until the connection ends."""
    become_worker(log)
    connection.send(None)
    while True:
        try:
            job = connection.recv()
        except EOFError:
            return
        connection.send(_answer(play, job))


def _answer(play: Play, job: Job) -> EpisodeResult | UsageError | SetupError:
    start = time.monotonic()
    try:
        return play(job)
    except UsageError as error:
        return UsageError(str(error))  # made anew: a subclass may not survive pickling
    except SetupError as error:
        return SetupError(str(error))
    except Exception as error:  # noqa: BLE001 - the edge of the process: one crash must not end the evaluation
        traceback.print_exc()
        return lost(job, CRASH, f"{type(error).__name__}: {error}", round(time.monotonic() - start, 2))
