"""The workers of a collection: each works off its share; one that dies is replaced and goes on."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import TracebackType
from typing import Protocol, Self

from ..errors import ManiAgentError, SetupError
from .keeper import Kept
from .share import Asked
from .table import Table

SILENCE = 600.0
"""s without an attempt told after which a worker counts as hanging."""
MOST_DEATHS = 3
"""Of one worker without an attempt between them, before the collection gives up."""


class Died(ManiAgentError):
    """A worker's process is gone."""


class Hand(Protocol):
    """A worker's process, wherever it runs. It waits after everything that it says."""

    def take(self) -> Kept | Asked | Table | None:
        """What it says; None once its share is done.

        Raises Died, and what the worker can't go on for: a full disk, a robot that is stuck.
        """
        ...

    def go_on(self) -> None:
        """Let it go on."""
        ...

    def kill(self) -> None:
        """End the process, whatever it does."""
        ...


class Place(Protocol):
    """Where workers run; a context manager."""

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...

    def start(self, worker: int) -> Hand:
        """Let a worker begin, or go on from what is on the disk."""
        ...

    def wait(self, hands: Sequence[Hand], seconds: float) -> Sequence[Hand]:
        """Those that say something; none after `seconds`."""
        ...

    def log(self, worker: int) -> str:
        """Where to read what became of one that died."""
        ...


class Crew:
    """All workers of one collection; a context manager that ends them, whatever they do."""

    def __init__(self, place: Place, workers: int, folder: Path) -> None:
        self._place, self._folder = place, folder
        self._posts = [_Post(place, worker) for worker in range(workers)]

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *ending: object) -> None:
        for post in self._posts:
            post.hand.kill()

    @property
    def busy(self) -> bool:
        """Whether any worker still collects."""
        return any(not post.done for post in self._posts)

    def hear(self, seconds: float) -> Iterator[Kept | Asked]:
        """What is said within `seconds`. Those who said it wait, until `go_on`.

        Raises what a worker can't go on for, SetupError for one that dies again and again.
        """
        awaited = [post for post in self._posts if not (post.done or post.held)]
        if not awaited:
            time.sleep(seconds)
            return
        ready = self._place.wait([post.hand for post in awaited], seconds)
        for post in awaited:
            if post.hand not in ready:
                post.check_time()
            elif isinstance(said := post.take(), Table):
                said.save(self._folder, post.worker)
                post.go_on()
            elif said is not None:
                yield said

    def go_on(self) -> None:
        """Let those go on who have said something."""
        for post in self._posts:
            if post.held:
                post.go_on()


class _Post:
    """A worker's place in the crew, filled anew when it dies."""

    def __init__(self, place: Place, worker: int) -> None:
        self._place, self.worker = place, worker
        self._deaths = 0
        self.done = self.held = False
        self.hand = place.start(worker)
        self._heard = time.monotonic()

    def take(self) -> Kept | Asked | Table | None:
        try:
            said = self.hand.take()
        except Died as death:
            self._replace(str(death))
            return None
        self.done, self.held = said is None, said is not None
        if isinstance(said, Kept):
            self._deaths = 0
        return said

    def go_on(self) -> None:
        self.held, self._heard = False, time.monotonic()
        self.hand.go_on()

    def check_time(self) -> None:
        """Replace a worker that has been silent for too long."""
        if time.monotonic() - self._heard > SILENCE:
            self._replace(f"silent for {SILENCE:.0f} s")

    def _replace(self, how: str) -> None:
        self.hand.kill()
        self._deaths += 1
        if self._deaths >= MOST_DEATHS:
            log = self._place.log(self.worker)
            raise SetupError(f"Worker {self.worker} died {MOST_DEATHS} times running ({how}); {log} may say why.")
        self.hand, self._heard = self._place.start(self.worker), time.monotonic()
