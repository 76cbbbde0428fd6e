"""The live display of an evaluation on stderr: how far it is, how it goes, how long it will take."""

from __future__ import annotations

from collections.abc import Sequence

from ..console.work import WorkDisplay
from .episode import EpisodeResult


class EvaluationProgress(WorkDisplay):
    """Shows an evaluation to a person: a bar and the failures on a terminal, elsewhere a line for each episode."""

    _successes = 0

    def begin(self, name: str, total: int, done: Sequence[EpisodeResult]) -> None:
        """Say how many episodes there are, and which of them an earlier call has finished."""
        self._successes = sum(result.success for result in done)
        self._begin(name, total, len(done))

    def add(self, result: EpisodeResult) -> None:
        """Show one more finished episode."""
        self._done += 1
        self._successes += result.success
        mark, colour = ("✓", "green") if result.success else ("✗", "red")
        why = "" if result.success else f"{result.stage}: {result.reason}"
        self._show(mark, colour, result.job.name, why, result.wall_seconds, always=not result.success)

    @property
    def told(self) -> str:
        """Success so far, rate, time left."""
        words = [f"{100 * self._successes / self._done:.1f} % success"] if self._done else []
        return " · ".join(words + self._pace(60, "a minute"))
