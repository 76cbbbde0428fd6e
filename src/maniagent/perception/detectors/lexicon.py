"""The `lexicon` detector: colour, size and shape words on segments, without any model."""

from __future__ import annotations

from collections.abc import Sequence

from ...errors import DetectionFailure
from ...types import Observation
from ..lexicon import FLOOR, Lexicon
from ..segmentation import TableView
from ..segments import Segment
from ..viewpoint import Viewpoint
from .protocol import Match


class LexiconDetector:
    """Where the words single one thing out, that one alone; else all that fit."""

    def __init__(self, lexicon: Lexicon) -> None:
        self._lexicon = lexicon

    @property
    def name(self) -> str:
        """As it is registered."""
        return "lexicon"

    def detect(
        self, queries: Sequence[str], view: TableView, observation: Observation
    ) -> tuple[tuple[Match, ...], ...]:
        """See `Detector`; raises DetectionFailure for words that the lexicon doesn't know, with the nearest it does."""
        viewpoint = Viewpoint.of(observation)
        return tuple(
            tuple(Match.of(query, segment, score, observation) for segment, score in found)
            for query in queries
            for found in [self._find(query, view.segments, viewpoint)]
        )

    def _find(self, query: str, segments: Sequence[Segment], viewpoint: Viewpoint) -> list[tuple[Segment, float]]:
        """What fits, with how well, best first."""
        scores = [self._lexicon.score(query, segment) for segment in segments]
        try:
            single = self._lexicon.ground(query, segments, viewpoint)
        except DetectionFailure:  # none fits, or several do; unknown words have been complained about above
            fitting = [(segment, score) for segment, score in zip(segments, scores, strict=True) if score >= FLOOR]
            return sorted(fitting, key=lambda item: -item[1])
        return [(segments[single], scores[single])]
