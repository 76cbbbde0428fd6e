"""Recall and relevance, scene by scene, and which prompt wins."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .answers import Answer
from .matching import Matching, Thing, match
from .scenes import mattering
from .variants import PACKAGED


@dataclass(frozen=True)
class Result:
    """One prompt on one scene. Where no answer fitted, nothing is named and every share is 0."""

    answer: Answer
    things: tuple[Thing, ...]
    """Truly there."""
    matching: Matching

    @classmethod
    def of(cls, answer: Answer, things: tuple[Thing, ...]) -> Result:
        """Judge an answer by what is true."""
        return cls(answer, things, match(answer.names, things))

    @property
    def recall(self) -> float:
        """Things that matter and are named / things that matter."""
        return _share(self._relevant, len(mattering(self.things)))

    @property
    def relevance(self) -> float:
        """Names of things that matter / names."""
        return _share(self._relevant, len(self.answer.names))

    @property
    def real(self) -> float:
        """Names of things that are there, whether they matter or not / names."""
        return _share(len(self.matching.meant), len(self.answer.names))

    @property
    def coverage(self) -> float:
        """Things that are named / things on the table."""
        return _share(len(self.matching.meant), len(self.things))

    @property
    def rank(self) -> tuple[float, float]:
        """By which results compare: recall first."""
        return self.recall, self.relevance

    @property
    def _relevant(self) -> int:
        return sum(thing.matters for _, thing in self.matching.meant)


def _share(part: int, whole: int) -> float:
    return part / whole if whole else 0.0


@dataclass(frozen=True)
class VariantScore:
    """One prompt on all scenes that every prompt was tried on; shares are means over these scenes."""

    name: str
    scenes: int
    recall: float
    relevance: float
    real: float
    coverage: float
    complete: int
    """Scenes of which nothing that matters was missed."""
    failed: int
    """Scenes that no fitting answer came to."""
    better: int
    """Scenes on which it did better than the packaged prompt, by recall and then relevance."""
    worse: int


@dataclass(frozen=True)
class Scoring:
    """All there is to say about a comparison; it may have been interrupted."""

    model: str
    out: Path
    scenes: int
    """Asked for."""
    scores: tuple[VariantScore, ...]
    """By variant, the packaged one first."""
    results: tuple[Result, ...]

    @property
    def complete(self) -> bool:
        """Whether every prompt was tried on every scene."""
        return all(score.scenes == self.scenes for score in self.scores)

    @property
    def winner(self) -> str | None:
        """The variant with the highest recall, then relevance; of equals the first; None where nothing is compared."""
        if len(self.scores) < 2 or not self.scores[0].scenes:
            return None
        return max(self.scores, key=lambda score: (round(score.recall, 9), round(score.relevance, 9))).name


def summarise(model: str, out: Path, variants: Sequence[str], scenes: int, results: Sequence[Result]) -> Scoring:
    """Put the results together, on those scenes alone for which every variant has one."""
    by_scene: dict[str, dict[str, Result]] = {}
    for result in results:
        by_scene.setdefault(result.answer.scene, {})[result.answer.variant] = result
    shared = [given for given in by_scene.values() if set(given) == set(variants)]
    scores = tuple(_score(name, [(given[name], given[PACKAGED]) for given in shared]) for name in variants)
    return Scoring(model, out, scenes, scores, tuple(results))


def _score(name: str, pairs: Sequence[tuple[Result, Result]]) -> VariantScore:
    def mean(share: Callable[[Result], float]) -> float:
        return float(np.mean([share(result) for result, _ in pairs])) if pairs else 0.0

    return VariantScore(
        name=name,
        scenes=len(pairs),
        recall=mean(lambda result: result.recall),
        relevance=mean(lambda result: result.relevance),
        real=mean(lambda result: result.real),
        coverage=mean(lambda result: result.coverage),
        complete=sum(not result.matching.missed for result, _ in pairs),
        failed=sum(bool(result.answer.failure) for result, _ in pairs),
        better=sum(result.rank > packaged.rank for result, packaged in pairs),
        worse=sum(result.rank < packaged.rank for result, packaged in pairs),
    )
