"""What every row must keep to, asked episode by episode while the data files are read once."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ...episode import JOINTS
from ..findings import Check, named
from ..layout import Feature, Info
from ..reading import Episode
from ..video import TOLERANCE

_STILL_FROM = 10
"""Frames; a shorter episode may well hold still."""
_SPIKE = 100.0
"""A value this many times the usual motion of an episode away from the usual place is no motion."""
_TURN = 2 * np.pi
"""rad, either way; no joint of the arm goes farther."""
_OPENING = (-0.01, 0.2)
"""m, between the fingers; a hair below 0 is a calibration."""


@dataclass(frozen=True)
class EpisodeRows:
    """An episode as the data files hold it."""

    episode: Episode
    position: int
    """Of its first row over all data files in order, by which LeRobot looks rows up."""
    columns: Mapping[str, NDArray[Any]]
    """(T, *shape) by feature; those that could be read."""
    subtasks: tuple[str, ...] = ()
    """A text a frame; none where the dataset has no such feature."""


class RowCheck(Protocol):
    """A question that is answered episode by episode."""

    check: Check

    def visit(self, rows: EpisodeRows) -> None:
        """Look at one episode."""

    def finish(self) -> None:
        """Look at all of them together."""


class Indices:
    """Frames are counted from 0 in the episode, and on over all episodes."""

    def __init__(self) -> None:
        self.check = Check("indices", "Are frames numbered without gaps, in their episode and in the whole dataset?")

    def visit(self, rows: EpisodeRows) -> None:
        """Look at one episode."""
        episode = rows.episode
        for name, first in (("frame_index", 0), ("index", episode.start)):
            found = rows.columns.get(name)
            if found is None:
                continue
            wrong = np.flatnonzero(found != first + np.arange(len(found)))
            if wrong.size:
                at = int(wrong[0])
                self.check.problem(f"{episode.name}, frame {at}", f"{name} is {found[at]}, not {first + at}")
        if rows.position != episode.start:
            what = f"lies in row {rows.position} of the data files, its dataset_from_index says {episode.start}"
            self.check.problem(episode.name, what, "LeRobot would load other frames: write the dataset anew.")

    def finish(self) -> None:
        """Nothing is left to do."""


class Timestamps:
    """The n-th frame is n / fps seconds from the first, by LeRobot's tolerance."""

    def __init__(self, info: Info) -> None:
        self._fps = info.fps
        self.check = Check("timestamps", f"Is every frame at its time, {info.fps:g} a second?")

    def visit(self, rows: EpisodeRows) -> None:
        """Look at one episode."""
        found = rows.columns.get("timestamp")
        if found is None:
            return
        wanted = np.arange(len(found)) / self._fps
        tolerance = np.maximum(TOLERANCE, 2 * np.finfo(np.float32).eps * wanted)  # they are stored as float32
        wrong = np.flatnonzero(~(np.abs(found.astype(float) - wanted) <= tolerance))
        if wrong.size:
            at = int(wrong[0])
            what = f"timestamp is {found[at]:.6g} s, not {wanted[at]:.6g} s ({wrong.size} of {len(found)} frames)"
            todo = "LeRobot refuses frames off by 0.1 ms: resample the episode at its rate."
            self.check.problem(f"{rows.episode.name}, frame {at}", what, todo)

    def finish(self) -> None:
        """Nothing is left to do."""


class Finite:
    """No number is NaN or infinite."""

    def __init__(self) -> None:
        self.check = Check("finite", "Is every number finite?")

    def visit(self, rows: EpisodeRows) -> None:
        """Look at one episode."""
        for name, column in rows.columns.items():
            if column.dtype.kind != "f":
                continue
            bad = np.flatnonzero(~np.isfinite(column.reshape(len(column), -1)).all(axis=1))
            if bad.size:
                where = f"{rows.episode.name}, frame {bad[0]}"
                what = f"{name} is NaN or infinite ({bad.size} of {len(column)} frames)"
                self.check.problem(where, what, "Training would diverge: leave the episode out.")

    def finish(self) -> None:
        """Nothing is left to do."""


class Motion:
    """States and actions move, within what a robot can do, and without spikes."""

    def __init__(self, info: Info) -> None:
        self._features = [feature for feature in info.features.values() if _moves(feature)]
        self._seen: dict[str, list[NDArray[Any]]] = {feature.name: [] for feature in self._features}
        self.check = Check("motion", "Do states and actions move, and within bounds?")

    def visit(self, rows: EpisodeRows) -> None:
        """Look at one episode."""
        for feature in self._features:
            column = rows.columns.get(feature.name)
            if column is None or not len(column) or not np.isfinite(column).all():
                continue
            column = column.reshape(len(column), -1)
            if len(column) >= _STILL_FROM and (column == column[0]).all():
                what = f"{feature.name} is the same in all {len(column)} frames"
                self.check.warning(rows.episode.name, what, "A sensor or a controller stood still: look at it.")
            self._seen[feature.name].append(_extremes(column, rows.episode.index))

    def finish(self) -> None:
        """Look for values far outside of all the others."""
        for feature in self._features:
            if not self._seen[feature.name]:
                continue
            episodes = np.stack(self._seen[feature.name])
            self._spikes(feature, episodes)
            if set(JOINTS) <= set(feature.names):
                self._bounds(feature, episodes)

    def _bounds(self, feature: Feature, episodes: NDArray[Any]) -> None:
        """Our own robot's joints and fingers, known by their names."""
        low, high = episodes[:, 5].min(axis=0), episodes[:, 6].max(axis=0)
        for i, name in enumerate(feature.names[: len(low)]):
            least, most = _OPENING if name == "opening" else (-_TURN, _TURN)
            if name in (*JOINTS, "opening") and (low[i] < least or high[i] > most):
                what = f"{feature.name}, {name} goes from {low[i]:.3g} to {high[i]:.3g}"
                self.check.warning("data", what, "Are its units rad and m?")

    def _spikes(self, feature: Feature, episodes: NDArray[Any]) -> None:
        number, low, middle, high, reach, *_ = episodes.transpose(1, 0, 2)
        centre = np.median(middle, axis=0)
        width = np.median(high - low, axis=0) + np.ptp(np.percentile(middle, (10, 90), axis=0), axis=0)
        far = np.abs(reach - centre) > _SPIKE * np.where(width > 0, width, np.inf)
        for i, dimension in zip(*np.nonzero(far), strict=True):
            name = feature.names[dimension] if dimension < len(feature.names) else dimension
            value, usual = reach[i, dimension], centre[dimension]
            what = f"{feature.name}, {name}: {value:.4g} is far from all else (about {usual:.3g})"
            self.check.warning(f"episode {int(number[i, 0])}", what, "Look at it: maniagent data view.")


class Tasks:
    """The rows name the tasks that their episode has."""

    def __init__(self, tasks: Mapping[int, str]) -> None:
        self._tasks = tasks
        self.check = Check("task of each frame", "Do frames name a task, and that of their episode?")

    def visit(self, rows: EpisodeRows) -> None:
        """Look at one episode."""
        column = rows.columns.get("task_index")
        if column is None:
            return
        numbers = [int(number) for number in np.unique(column)]
        if unknown := [number for number in numbers if number not in self._tasks]:
            self.check.problem(rows.episode.name, f"names task {named(unknown)}, which has no text")
        elif {self._tasks[number] for number in numbers} != set(rows.episode.tasks):
            texts = named((repr(self._tasks[number]) for number in numbers), 3)
            self.check.problem(
                rows.episode.name, f"its frames say {texts}, its tasks are {named(map(repr, rows.episode.tasks), 3)}"
            )

    def finish(self) -> None:
        """Nothing is left to do."""


class Subtasks:
    """Frames say what the robot was doing, where the dataset promises that they do."""

    def __init__(self, info: Info) -> None:
        self.check = Check("sub-task of each frame", "Do frames say what the robot was doing?")
        if "subtask" not in info.features:
            self.check.skipped = "the dataset has no feature subtask"

    def visit(self, rows: EpisodeRows) -> None:
        """Look at one episode."""
        silent = [frame for frame, text in enumerate(rows.subtasks) if not text.strip()]
        if silent:
            what = f"{len(silent)} of {len(rows.subtasks)} frames name no sub-task"
            self.check.warning(f"{rows.episode.name}, frame {silent[0]}", what)

    def finish(self) -> None:
        """Nothing is left to do."""


class Duplicates:
    """No two episodes hold the same numbers."""

    def __init__(self, info: Info) -> None:
        self._names = [name for name, feature in info.features.items() if _moves(feature)]
        self._seen: dict[bytes, Episode] = {}
        self.check = Check("duplicates", "Is every episode another one?")

    def visit(self, rows: EpisodeRows) -> None:
        """Look at one episode."""
        columns = [rows.columns[name] for name in self._names if name in rows.columns]
        if not columns or not len(columns[0]):
            return
        digest = hashlib.blake2b(digest_size=16)
        for column in columns:
            digest.update(np.ascontiguousarray(column).tobytes())
        before = self._seen.setdefault(digest.digest(), rows.episode)
        if before is not rows.episode:
            what = f"has the same states and actions as {before.name}"
            self.check.problem(rows.episode.name, what, "Leave one of them out.")

    def finish(self) -> None:
        """Nothing is left to do."""


def _moves(feature: Feature) -> bool:
    """Whether a feature is a state or an action."""
    kind = feature.dtype.startswith("float") and feature.is_vector
    return kind and (feature.name.startswith(("observation", "action")) or feature.name == "ee_delta")


def _extremes(column: NDArray[Any], number: int) -> NDArray[Any]:
    """(7, D): episode's number, 1st percentile, median, 99th percentile, what is farthest from it, least, and most."""
    column = column.astype(float)
    low, middle, high = np.percentile(column, (1, 50, 99), axis=0)
    farthest = np.abs(column - middle).argmax(axis=0)
    reach = np.take_along_axis(column, farthest[None], axis=0)[0]
    ends = column.min(axis=0), column.max(axis=0)
    return np.stack([np.full(len(middle), float(number)), low, middle, high, reach, *ends])
