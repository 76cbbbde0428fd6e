"""What a detector is: words to segments. Third parties implement this and register a factory (see `registry`)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, Self

import numpy as np

from ...types import BoolArray, Detection, Observation
from ..segmentation import TableView
from ..segments import Segment

Box = tuple[float, float, float, float]
"""x_min, y_min, x_max, y_max in pixels; the pixel of a corner belongs to the box."""


@dataclass(frozen=True)
class Match:
    """One thing that a query may mean: where it is in a picture, and in 3-D."""

    detection: Detection
    segment: Segment

    @classmethod
    def of(cls, query: str, segment: Segment, score: float, observation: Observation) -> Self:
        """A segment that fits with a score in [0, 1], in the main view or, hidden there, where it is seen best.

        Raises ValueError for a segment that none of the observation's views shows.
        """
        sizes = {name: np.count_nonzero(segment.masks[name]) for name in observation.frames if name in segment.masks}
        frame = observation.main if sizes.get(observation.main) else max(sizes, key=sizes.__getitem__, default="")
        if not sizes.get(frame):
            raise ValueError("the segment isn't seen in any view of this observation")
        mask = segment.masks[frame]
        return cls(Detection(query, box_of(mask), score, frame, mask), segment)


class Detector(Protocol):
    """Finds the things that queries mean."""

    @property
    def name(self) -> str:
        """As the user named it, e.g. "marks" or "florence2:./weights"."""
        ...

    def detect(
        self, queries: Sequence[str], view: TableView, observation: Observation
    ) -> tuple[tuple[Match, ...], ...]:
        """For each query, in their order, all that it may mean, best first; empty where nothing does.

        `view` is what segmentation made of `observation`. A match's segment is one of the view's, or a new one where
        the detector sees a thing that segmentation missed or joined with another.

        Raises
        ------
        DetectionFailure
            Where the detector doesn't understand a query.
        ModelFailure, FormatFailure
            Where the chat model that names things fails.

        """
        ...


def box_of(mask: BoolArray) -> Box:
    """The smallest box around a mask (H, W) with at least one True."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    return float(columns[0]), float(rows[0]), float(columns[-1]), float(rows[-1])
