"""Whether the statistics by which training normalises are those of the numbers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....geometry import FloatArray
from ..findings import Check, named
from ..layout import BOOKKEEPING, STATS, Feature, Info
from .rows import EpisodeRows

_RELATIVE = 1e-4
"""Of a feature's scale (its square for variances): LeRobot computes in float32."""
_OVERFLOW = "LeRobot issue 3682: compute the statistics anew, or train with ImageNet's, LeRobot's default."
_ANEW = "Compute the statistics anew; training normalises by them."


@dataclass(frozen=True)
class Moments:
    """Count, extremes, mean and sum of squared deviations, by dimension; those of two parts can be joined."""

    count: int
    low: FloatArray
    high: FloatArray
    mean: FloatArray
    deviations: FloatArray

    @classmethod
    def of(cls, rows: NDArray[Any]) -> Moments:
        """Of (T, D) or (T,) rows, T > 0."""
        with np.errstate(all="ignore"):  # of what isn't finite nothing is wanted but that
            table = rows.reshape(len(rows), -1).astype(np.float64)
            mean = table.mean(axis=0)
            return cls(len(table), table.min(axis=0), table.max(axis=0), mean, ((table - mean) ** 2).sum(axis=0))

    def __add__(self, other: Moments) -> Moments:
        """Chan, Golub and LeVeque 1983: the pairwise update, which loses no digits."""
        count = self.count + other.count
        step = other.mean - self.mean
        return Moments(
            count,
            np.minimum(self.low, other.low),
            np.maximum(self.high, other.high),
            self.mean + step * other.count / count,
            self.deviations + other.deviations + step**2 * self.count * other.count / count,
        )

    @property
    def std(self) -> FloatArray:
        """Standard deviation of the whole, not of a sample, as LeRobot has it."""
        return np.sqrt(self.deviations / self.count)


class Statistics:
    """Recomputes the statistics of every vector that is recorded, by episode and overall.

    LeRobot's own columns (index, timestamp, ...) are left out: nothing is normalised by them, and LeRobot itself
    doesn't keep theirs when it merges datasets. So are quantiles, which it only estimates.
    """

    def __init__(self, info: Info, stored: Mapping[str, Any] | None, frames: int) -> None:
        self._info, self._stored, self._frames = info, stored, frames
        self._features = [f for f in info.stored if f.is_vector and f.name not in BOOKKEEPING]
        self.moments: dict[str, Moments] = {}
        self._without: list[int] = []
        self._flat: dict[str, list[int]] = {}
        self.check = Check("statistics", f"Is {STATS} what the frames say?")
        self.by_episode = Check("episode statistics", "Are each episode's statistics what its frames say?")

    def visit(self, rows: EpisodeRows) -> None:
        """Look at one episode."""
        if not rows.episode.statistics:
            self._without.append(rows.episode.index)
        for name in self._info.pictures:
            if _is_overflow(rows.episode.statistics.get(name, {})):
                self._flat.setdefault(name, []).append(rows.episode.index)
        for feature in self._features:
            column = rows.columns.get(feature.name)
            if column is None or not len(column) or not np.isfinite(column).all():
                continue
            found = Moments.of(column)
            before = self.moments.get(feature.name)
            self.moments[feature.name] = found if before is None else before + found
            stored = rows.episode.statistics.get(feature.name)
            if stored is not None:
                for what in differences(found, stored):
                    self.by_episode.problem(rows.episode.name, f"{feature.name}: {what}", _ANEW)

    def finish(self) -> None:
        """Compare the whole."""
        if self._without:
            what = f"no statistics in episodes {named(self._without)}"
            self.by_episode.warning("meta/episodes", what, "LeRobot needs them to merge datasets.")
        for name, numbers in self._flat.items():
            what = f"{name}: std is 0 in episodes {named(numbers)}, though the pictures vary"
            self.by_episode.warning(STATS, what, _OVERFLOW)
        if self._stored is None:
            self.check.skipped = f"{STATS} can't be read"
            return
        for feature in self._info.features.values():
            stored = self._stored.get(feature.name)
            if isinstance(stored, Mapping):
                self._compare(feature, stored)
            elif feature.dtype != "string":
                self.check.problem(STATS, f"has nothing of {feature.name}", _ANEW)

    def _compare(self, feature: Feature, stored: Mapping[str, Any]) -> None:
        if feature.is_picture:
            self._picture(feature, stored)
        elif feature in self._features:
            found = self.moments.get(feature.name)
            if found is None or found.count != self._frames:
                self.check.skipped = "not all numbers can be read"
                return
            for what in differences(found, stored):
                self.check.problem(STATS, f"{feature.name}: {what}", _ANEW)

    def _picture(self, feature: Feature, stored: Mapping[str, Any]) -> None:
        """Pictures' statistics are of samples, so they are only asked whether they can be true."""
        low, high, mean, std = (_numbers(stored.get(name)) for name in ("min", "max", "mean", "std"))
        if (
            low is None
            or high is None
            or mean is None
            or std is None
            or len({a.size for a in (low, high, mean, std)}) > 1
        ):
            self.check.problem(STATS, f"{feature.name}: min, max, mean or std is missing or of another shape", _ANEW)
        elif not ((low >= -1e-6) & (low <= mean + 1e-6) & (mean <= high + 1e-6) & (high <= 1 + 1e-6)).all():
            self.check.problem(STATS, f"{feature.name}: 0 <= min <= mean <= max <= 1 does not hold", _ANEW)


def differences(found: Moments, stored: Mapping[str, Any]) -> Iterator[str]:
    """What stored statistics have otherwise than the numbers, each as half a sentence."""
    count = _numbers(stored.get("count"))
    if count is not None and count.size and (count != found.count).any():
        yield f"count is {count[0]:g}, of {found.count} frames"
    scale = np.maximum(np.abs(found.low), np.abs(found.high))
    tolerance = _RELATIVE * scale + 1e-9
    for name, is_ in (("min", found.low), ("max", found.high), ("mean", found.mean), ("std", found.std)):
        said = _numbers(stored.get(name))
        if said is None or said.shape != is_.shape:
            yield f"{name} is missing or of another shape"
            continue
        if name == "std":
            wrong = ~(np.abs(said**2 - is_**2) <= _RELATIVE * scale**2 + 1e-12)
        else:
            wrong = ~(np.abs(said - is_) <= tolerance)
        if wrong.any():
            at = int(np.argmax(wrong))
            yield f"{name} of dimension {at} is {said[at]:.6g}, computed {is_[at]:.6g}"


def _is_overflow(stored: Mapping[str, Any]) -> bool:
    """Whether pictures are said to vary in their extremes, but not in their standard deviation."""
    low, high, std = (_numbers(stored.get(name)) for name in ("min", "max", "std"))
    if low is None or high is None or std is None or not low.shape == high.shape == std.shape:
        return False
    return bool(((std <= 0) & (high > low + 1 / 255)).any())


def _numbers(value: Any) -> FloatArray | None:
    """A stored statistic as a flat array; None where it is none."""
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        return None
    return array.reshape(-1) if value is not None else None
