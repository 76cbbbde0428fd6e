"""The worker processes of a collection: each works off its share; one that dies is replaced and goes on."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import time
import traceback
from collections.abc import Iterator
from multiprocessing.connection import Connection, wait
from pathlib import Path

from ..errors import ManiAgentError, SetupError
from ..processes import become_worker
from .episode import EpisodeInfo
from .settings import CollectSettings
from .share import Share

SILENCE = 600.0
"""s without an attempt told after which a worker counts as hanging."""
MOST_DEATHS = 3
"""Of one worker without an attempt between them, before the collection gives up."""
_DONE = "done"


class Crew:
    """All workers of one collection; a context manager that ends them, whatever they do."""

    def __init__(self, settings: CollectSettings, folder: Path) -> None:
        self._settings, self._folder = settings, folder
        self._workers = [_Worker(settings, number, folder) for number in range(settings.workers)]

    def __enter__(self) -> Crew:
        return self

    def __exit__(self, *ending: object) -> None:
        for worker in self._workers:
            worker.kill()

    @property
    def busy(self) -> bool:
        """Whether any worker still collects."""
        return any(not worker.done for worker in self._workers)

    def hear(self, seconds: float) -> Iterator[EpisodeInfo]:
        """The attempts that are told within `seconds`.

        Raises what a worker can't go on for: a full disk, a robot that is stuck, a worker that dies again and again.
        """
        open_ends = [worker.connection for worker in self._workers if not worker.done]
        ready = wait(open_ends, timeout=seconds)
        for worker in self._workers:
            if not worker.done and worker.connection in ready:
                if (info := worker.hear()) is not None:
                    yield info
            else:
                worker.check_time()


class _Worker:
    """One process, seen from the parent."""

    def __init__(self, settings: CollectSettings, number: int, folder: Path) -> None:
        self._settings, self._number, self._folder = settings, number, folder
        self._deaths = 0
        self.done = False
        self._start()

    def _start(self) -> None:
        context = multiprocessing.get_context("spawn")  # rendering contexts and threads don't survive a fork
        self.connection, theirs = context.Pipe()
        arguments = (theirs, self._settings, self._number, self._folder)
        self._process = context.Process(target=_work, args=arguments, daemon=True)
        self._process.start()
        theirs.close()  # so that its death shows as the end of the connection
        self._heard = time.monotonic()

    def hear(self) -> EpisodeInfo | None:
        """What it says, if it is an attempt."""
        try:
            said = self.connection.recv()
        except (EOFError, ConnectionResetError):
            self._process.join()
            code = self._process.exitcode or 0
            self._replace(f"killed by {signal.Signals(-code).name}" if code < 0 else f"exit status {code}")
            return None
        self._heard = time.monotonic()
        if isinstance(said, EpisodeInfo):
            self._deaths = 0
            return said
        if said != _DONE:
            raise said
        self.done = True
        return None

    def check_time(self) -> None:
        """Replace the process where it has been silent for too long."""
        if not self.done and time.monotonic() - self._heard > SILENCE:
            self._replace(f"silent for {SILENCE:.0f} s")

    def kill(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.join()
        self.connection.close()

    def _replace(self, how: str) -> None:
        self.kill()
        self._deaths += 1
        if self._deaths >= MOST_DEATHS:
            log = self._folder / f"worker-{self._number:02d}.log"
            raise SetupError(f"Worker {self._number} died {MOST_DEATHS} times running ({how}); {log} may say why.")
        self._start()


def _work(connection: Connection, settings: CollectSettings, number: int, folder: Path) -> None:
    """What a worker process does."""
    become_worker(folder / f"worker-{number:02d}.log")
    os.environ.setdefault("LP_NUM_THREADS", "0")  # software rendering: workers share the cores already
    try:
        Share(settings, number, folder, connection.send).collect()
    except ManiAgentError as error:
        # Made anew: a subclass may not survive pickling.
        with contextlib.suppress(BrokenPipeError):
            connection.send(SetupError(str(error)))
    except Exception:
        traceback.print_exc()
        raise
    else:
        connection.send(_DONE)
