"""Workers of a collection on the machines of a Ray cluster (extra `ray`)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from ..cluster import Cluster
from ..errors import ManiAgentError, SetupError, UsageError
from .crew import Died, Hand
from .episode import EpisodeInfo
from .keeper import Keeper, Kept
from .ledger import read_attempts
from .settings import CollectSettings
from .share import Asked, Said, Share, Tried
from .table import Table


class RayCluster:
    """A Place: the nodes of a cluster, a CPU for each worker.

    Recordings come back through Ray and are written where the collection was called, so that nodes need no common file
    system.
    """

    def __init__(self, settings: CollectSettings, folder: Path, address: str) -> None:
        """Connect; `address` as for Cluster. Raises SetupError where none answers, UsageError where it is too small."""
        self._settings, self._folder = settings, folder
        self._cluster = Cluster(address)
        cpus = int(self._cluster.ray.cluster_resources().get("CPU", 0))
        if cpus < settings.workers:
            self._cluster.close()
            raise UsageError(f"The cluster has {cpus} CPUs, too few for {settings.workers} workers: say --workers.")

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._cluster.close()

    def start(self, worker: int) -> Hand:
        """See Place."""
        remote = self._cluster.ray.remote(num_cpus=1, max_restarts=0)(_Worker)
        known = read_attempts(self._folder)
        actor = remote.remote(self._settings, worker, known, Table.load(self._folder, worker))
        return _Actor(self._cluster, actor, Keeper(self._folder, worker))

    def wait(self, hands: Sequence[Hand], seconds: float) -> Sequence[Hand]:
        """See Place."""
        pending = {hand.pending: hand for hand in hands if isinstance(hand, _Actor)}
        ready, _ = self._cluster.ray.wait(list(pending), num_returns=len(pending), timeout=0)
        if not ready:
            ready, _ = self._cluster.ray.wait(list(pending), num_returns=1, timeout=seconds)
        return [pending[reference] for reference in ready]

    def log(self, worker: int) -> str:
        """See Place."""
        return "its node's Ray log"


class _Worker:
    """What runs on a node: a Share that is asked for one thing after another."""

    def __init__(
        self, settings: CollectSettings, worker: int, before: Sequence[EpisodeInfo], table: Table | None
    ) -> None:
        self._said = Share(settings, worker, before, table).work()

    def take(self) -> Said | None:
        """What comes of it next; None at the end."""
        try:
            return next(self._said, None)
        except ManiAgentError as error:
            raise SetupError(str(error)) from None  # made anew: a subclass may not survive pickling


class _Actor:
    """A Hand."""

    def __init__(self, cluster: Cluster, actor: Any, keeper: Keeper) -> None:
        self._cluster, self._actor, self._keeper = cluster, actor, keeper
        self.pending = actor.take.remote()

    def take(self) -> Kept | Asked | Table | None:
        exceptions = self._cluster.ray.exceptions
        try:
            said: Said | None = self._cluster.ray.get(self.pending)
        except exceptions.RayTaskError as error:
            raise self._cluster.cause(error) from None
        except exceptions.RayError as error:
            raise Died(f"{type(error).__name__}: {' '.join(str(error).split())[:200]}") from None
        return self._keeper.keep(said) if isinstance(said, Tried) else said

    def go_on(self) -> None:
        self.pending = self._actor.take.remote()

    def kill(self) -> None:
        self._cluster.ray.kill(self._actor)
