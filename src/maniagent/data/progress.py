"""The live display of a collection on stderr: how far it is, how well it goes, how long it will take."""

from __future__ import annotations

from collections.abc import Sequence

from ..console.work import WorkDisplay
from .episode import EpisodeInfo
from .lerobot.publish import Published

_MARKS = {"valid": ("✓", "green"), "failed": ("✗", "red"), "doubtful": ("?", "yellow")}


class CollectProgress(WorkDisplay):
    """A Watcher for a person: a bar on a terminal, elsewhere a line for each attempt."""

    _tried = _interventions = _in_dataset = 0

    def begin(self, wanted: int, before: Sequence[EpisodeInfo]) -> None:
        """See Watcher."""
        self._tried = len(before)
        self._interventions = sum(info.interventions for info in before)
        self._begin("valid episodes", wanted, sum(info.label == "valid" for info in before))

    def add(self, info: EpisodeInfo) -> None:
        """See Watcher."""
        self._tried += 1
        self._done += info.label == "valid"
        self._interventions += info.interventions
        self._show(*_MARKS[info.label], info.key, info.reason, info.seconds, always=info.label != "valid")

    def published(self, so_far: Published) -> None:
        """See Watcher."""
        self._in_dataset = so_far.total

    @property
    def told(self) -> str:
        """Valid share, rate, time left."""
        words = [f"{100 * self._done / self._tried:.1f} % of attempts"] if self._tried else []
        words += self._pace(3600, "an hour")
        words += [f"{self._interventions} interventions"] if self._interventions else []
        words += [f"{self._in_dataset} in the dataset"] if self._in_dataset else []
        return " · ".join(words)
