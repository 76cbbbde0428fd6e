"""The `lexicon` detector: words to segments by colour, size and shape, without any learned weights.

A phrase fits a segment as well as its worst-fitting part does (the fuzzy "and"), and the less, the better another
noun fits. The best must be good enough and clearly ahead, or relative words must decide; otherwise the lexicon says
why it can't tell.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import cv2
import numpy as np
from numpy.typing import NDArray

from ..errors import DetectionFailure
from ..geometry import FloatArray
from .choosing import by_position, by_relation, by_size
from .colour import (
    LIGHTNESS_SOFTNESS,
    SATURATION_SOFTNESS,
    hue_saturation_lightness,
    within,
    within_hue,
)
from .phrases import Pick
from .referring import Reference, read_reference
from .segments import Segment
from .viewpoint import Viewpoint
from .vocabulary import ANYTHING, ColourWord, Look, Noun, Vocabulary

FLOOR = 0.45
"""Least score of what is accepted as meant."""
MARGIN = 0.2
"""Two whose scores are closer than this are equally good."""
SIZE_SOFTNESS = 0.25
"""Share of a size limit over which a thing beyond it fades from fitting to not fitting."""
SHARE_SOFTNESS = 0.2
"""Likewise for shares of colour and of the rectangle, which are numbers about 1."""
ADJECTIVE_SHARE = (0.15, 0.4)
"""Shares of the surface at which a colour word begins to hold, and holds fully."""
SAMPLES = 500
"""Points of a segment whose colours are looked at."""


@dataclass(frozen=True)
class Appearance:
    """What the lexicon sees of a segment."""

    length: float
    """m, likewise width and height."""
    width: float
    height: float
    fill: float
    """Share of the footprint's rectangle that its convex hull covers."""
    shares: dict[str, float]
    """By colour word, and by choices of the vocabulary such as "red or green": share of the surface. Colours
    overlap, so these don't add up to 1."""

    @property
    def ratio(self) -> float:
        """Length to width."""
        return self.length / max(self.width, 1e-3)


class Lexicon:
    """Grounds noun phrases on segments, and names segments."""

    def __init__(self, vocabulary: Vocabulary) -> None:
        self._vocabulary = vocabulary
        self._choices = set[str]().union(*(noun.colour_choices for noun in vocabulary.nouns.values()))

    @classmethod
    def load(cls, path: Path | None = None) -> Self:
        """The lexicon in the file at `path`, or the one that comes with maniagent. Raises UsageError for a bad file."""
        return cls(Vocabulary.load(path))

    def score(self, phrase: str, segment: Segment) -> float:
        """How well the noun and the colours of `phrase` fit, in [0, 1]. Raises DetectionFailure for unknown words."""
        return self._score(read_reference(phrase, self._vocabulary), self.appearance(segment))

    def ground(self, phrase: str, segments: Sequence[Segment], viewpoint: Viewpoint) -> int:
        """Index of the one segment that `phrase` means.

        Raises DetectionFailure where a word is unknown, where nothing fits, and where several fit equally well.
        """
        reference = read_reference(phrase, self._vocabulary)
        looks = [self.appearance(segment) for segment in segments]
        return self._ground(reference, segments, looks, viewpoint)

    def name(self, segment: Segment) -> str:
        """The plainest description that tells it from others of its kind: "red pepper", "small yellow block"."""
        look = self.appearance(segment)
        fits = {noun: _fit(prior, look) for noun, prior in self._vocabulary.nouns.items()}
        noun = max(fits, key=fits.__getitem__, default=ANYTHING)
        if fits.get(noun, 0.0) < FLOOR:
            return " ".join([*self._colour_of(look), _shape_of(look), "object"])
        varies = self._vocabulary.nouns[noun].varies
        size = [_size_of(look)] if "size" in varies else []
        colour = self._colour_of(look) if "colour" in varies else []
        return " ".join([*filter(None, size), *colour, noun])

    def appearance(self, segment: Segment) -> Appearance:
        """Measure a segment."""
        length, width, height = map(float, segment.extent)
        hull = cv2.convexHull(segment.points[:, :2].astype(np.float32))
        fill = float(cv2.contourArea(hull)) / max(length * width, 1e-6)
        step = max(len(segment.colours) // SAMPLES, 1)
        return Appearance(length, width, height, fill, self._shares(segment.colours[::step]))

    def _shares(self, colours: NDArray[np.uint8]) -> dict[str, float]:
        seen = hue_saturation_lightness(colours)
        members = {name: _membership(word, *seen) for name, word in self._vocabulary.colours.items()}
        either = {choice: np.max([members[name] for name in choice.split(" or ")], axis=0) for choice in self._choices}
        return {name: float(member.mean()) for name, member in (members | either).items()}

    def _colour_of(self, look: Appearance) -> list[str]:
        """The colour word for most of the surface; none where no word fits."""
        colour = max(self._vocabulary.colours, key=lambda name: look.shares[name], default="")
        return [colour] if look.shares.get(colour, 0.0) >= ADJECTIVE_SHARE[1] else []

    # Scores -------------------------------------------------------------------------------------------------------

    def _score(self, reference: Reference, look: Appearance) -> float:
        colours = [_ramp(look.shares[colour], *ADJECTIVE_SHARE) for colour in reference.colours]
        return min([self._noun_score(reference.noun, look), *colours])

    def _noun_score(self, noun: str, look: Appearance) -> float:
        """The noun's fit, lowered by as much as the noun that fits best is ahead of it."""
        if noun == ANYTHING:
            return 1.0
        fit = _fit(self._vocabulary.nouns[noun], look)
        best = max(_fit(other, look) for other in self._vocabulary.nouns.values())
        return fit * fit / best if best > 0 else 0.0

    # Grounding ----------------------------------------------------------------------------------------------------

    def _ground(
        self, reference: Reference, segments: Sequence[Segment], looks: Sequence[Appearance], viewpoint: Viewpoint
    ) -> int:
        scores = [self._score(reference, look) for look in looks]
        among = [i for i, score in enumerate(scores) if score >= FLOOR]
        if reference.where is not None:
            landmark = None
            if reference.landmark is not None:
                landmark = self._ground(reference.landmark, segments, looks, viewpoint)
            among = by_relation(segments, among, viewpoint, reference.where, landmark)
        best = max((scores[i] for i in among), default=0.0)
        among = [i for i in among if scores[i] >= best - MARGIN]
        for size in reference.sizes:
            among = by_size(segments, among, size)
        if reference.pick is not None or reference.ordinal is not None:
            among = by_position(segments, among, viewpoint, reference.pick or Pick.LEFT, reference.ordinal)
        if not among:
            raise DetectionFailure(f"No {reference.phrase} is in view. {self._seen(segments)}")
        if len(among) > 1 and not reference.anyone:
            raise DetectionFailure(self._which(reference, segments, among, viewpoint))
        return max(among, key=scores.__getitem__)

    def _seen(self, segments: Sequence[Segment]) -> str:
        if not segments:
            return "The table is empty."
        return f"Seen: {', '.join(self.name(segment) for segment in segments)}."

    def _which(
        self, reference: Reference, segments: Sequence[Segment], among: Sequence[int], viewpoint: Viewpoint
    ) -> str:
        """A complaint that several fit, with words that would tell them apart."""
        names = [self.name(segments[i]) for i in among]
        if len(set(names)) == len(names):
            ways = [f"the {name}" for name in names]
        else:
            places = np.array([segments[i].centre[:2] for i in among])
            across = np.ptp(places @ viewpoint.right) >= np.ptp(places @ viewpoint.away)
            sides = ("left", "right") if across else ("nearest", "farthest")
            thing = " ".join([*reference.colours, reference.noun])
            ways = [f"the {side} {thing}" for side in ([*sides, "middle"] if len(among) == 3 else sides)]
        listed = ", ".join(f"'{way}'" for way in ways)
        return f"{len(among)} objects fit '{reference.phrase}' equally well. Say which: {listed}."


def _membership(word: ColourWord, hue: FloatArray, saturation: FloatArray, lightness: FloatArray) -> FloatArray:
    """(N,) in [0, 1]: how far each colour is what the word means."""
    parts = [np.ones_like(hue)]
    if word.hue is not None:
        parts.append(within_hue(hue, *word.hue))
    if word.saturation is not None:
        parts.append(within(saturation, *word.saturation, SATURATION_SOFTNESS))
    if word.lightness is not None:
        parts.append(within(lightness, *word.lightness, LIGHTNESS_SOFTNESS))
    return np.min(parts, axis=0)


def _fit(noun: Noun, seen: Appearance) -> float:
    """How well the best-fitting of the noun's looks fits, in [0, 1]."""
    return max(_fit_look(look, seen) for look in noun.looks)


def _fit_look(look: Look, seen: Appearance) -> float:
    """The worst fit of all that the look asks for, in [0, 1]."""
    sizes = ((look.length, seen.length), (look.width, seen.width), (look.height, seen.height), (look.ratio, seen.ratio))
    fits = [_in_range(value, limits, SIZE_SOFTNESS) for limits, value in sizes if limits is not None]
    if look.fill is not None:
        fits.append(_in_share(seen.fill, look.fill))
    for choice, limits in look.colours.items():
        fits.append(_in_share(seen.shares[choice], limits))
    return min(fits, default=1.0)


def _in_range(value: float, limits: tuple[float, float], softness: float) -> float:
    """1 within the limits, 0 at `softness` of a limit beyond it."""
    low, high = limits
    if value < low:
        return max(0.0, 1 - (low - value) / (softness * low))
    return max(0.0, 1 - (value - high) / (softness * max(high, 1e-3))) if value > high else 1.0


def _in_share(value: float, limits: tuple[float, float]) -> float:
    low, high = limits
    return float(np.clip(1 - max(low - value, value - high) / SHARE_SOFTNESS, 0.0, 1.0))


def _ramp(value: float, low: float, high: float) -> float:
    return float(np.clip((value - low) / (high - low), 0.0, 1.0))


def _shape_of(look: Appearance) -> str:
    if look.height < 0.3 * look.width:
        return "flat"
    return "elongated" if look.ratio > 2.2 else "compact"


def _size_of(look: Appearance) -> str:
    """Small and large as a hand would say it: a block of 3 cm is small, one of 5 cm large."""
    size = float(np.cbrt(look.length * look.width * look.height))
    return "small" if size < 0.04 else "large" if size > 0.05 else ""
