"""A dataset summed up: how much of what it holds, and how good its labels are."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..episode import EpisodeInfo
from .checks.statistics import Moments
from .layout import BOOKKEEPING, Feature
from .reading import Dataset, read_collected
from .video import probe

_MEASURES = ("low", "mean", "high", "std")


@dataclass(frozen=True)
class Dimension:
    """The range of one number over all frames."""

    feature: str
    name: str
    low: float
    mean: float
    high: float
    std: float


@dataclass(frozen=True)
class Camera:
    """A feature that is pictures."""

    name: str
    codec: str
    pixel_format: str
    width: int
    height: int
    files: int
    bytes: int


@dataclass(frozen=True)
class Labels:
    """How our collector judged the episodes that are in the dataset, and whether it was right."""

    counts: dict[str, int]
    """Episodes by label."""
    attempts: dict[int, int]
    """Episodes by the attempt that succeeded."""
    interventions: int
    judged: int
    """Episodes of which the truth is known."""
    precision: float | None
    """Share of those labelled valid that truly are; None where the truth isn't known."""
    recall: float | None
    """Share of the truly valid that are labelled so; None where only valid ones were kept, as it can't be told."""


@dataclass(frozen=True)
class DatasetSummary:
    """What a dataset holds."""

    path: str
    version: str
    robot: str
    fps: float
    episodes: int
    frames: int
    seconds: float
    tasks: dict[str, int]
    """Episodes by task."""
    lengths: dict[str, float]
    """Frames of an episode: min, median, mean, max."""
    dimensions: tuple[Dimension, ...]
    cameras: tuple[Camera, ...]
    bytes: dict[str, int]
    """By folder: data, videos, meta."""
    subtasks: dict[str, int]
    """Frames by sub-task; empty where the dataset has none."""
    labels: Labels | None
    """None where another program collected the dataset."""

    def to_plain(self) -> dict[str, Any]:
        """For JSON, which has no numbers but finite ones: null stands for the others."""
        plain = asdict(self)
        for dimension in plain["dimensions"]:
            dimension |= {name: None for name in _MEASURES if not math.isfinite(dimension[name])}
        return plain


def summarise(dataset: Dataset) -> DatasetSummary:
    """Read every row of a dataset and no picture. Raises DatasetError where something is broken."""
    info, episodes = dataset.info, dataset.episodes
    vectors = [f for f in info.stored if f.is_vector and f.name not in BOOKKEEPING]
    moments: dict[str, Moments] = {}
    subtasks: Counter[str] = Counter()
    for episode in episodes:
        subtasks.update(dataset.subtasks(episode))
        for name, column in dataset.numbers(episode, [feature.name for feature in vectors]).items():
            if len(column) and column.dtype.kind in "biuf":
                found = Moments.of(column)
                moments[name] = moments[name] + found if name in moments else found
    lengths = [episode.length for episode in episodes]
    collected = read_collected(dataset.root)
    return DatasetSummary(
        path=str(dataset.root),
        version=info.version,
        robot=info.robot,
        fps=info.fps,
        episodes=len(episodes),
        frames=sum(lengths),
        seconds=sum(lengths) / info.fps,
        tasks=dict(Counter(text for episode in episodes for text in episode.tasks).most_common()),
        lengths=_lengths(lengths),
        dimensions=tuple(d for f in vectors if f.name in moments for d in _dimensions(f, moments[f.name])),
        cameras=tuple(_camera(dataset, name) for name in info.pictures),
        bytes={folder: _size((dataset.root / folder).rglob("*")) for folder in ("data", "videos", "meta")},
        subtasks=dict(subtasks.most_common()),
        labels=None if collected is None else judge(collected),
    )


def judge(infos: Sequence[EpisodeInfo]) -> Labels:
    """How good the labels of these episodes are."""
    known = [info for info in infos if info.truly_valid is not None]
    said = [info for info in known if info.label == "valid"]
    true = [info for info in known if info.truly_valid]
    right = sum(bool(info.truly_valid) for info in said)
    only_valid = all(info.label == "valid" for info in infos)
    return Labels(
        counts=dict(Counter(str(info.label) for info in infos).most_common()),
        attempts=dict(sorted(Counter(info.attempts for info in infos).items())),
        interventions=sum(info.interventions for info in infos),
        judged=len(known),
        precision=right / len(said) if said else None,
        recall=right / len(true) if true and not only_valid else None,
    )


def _lengths(lengths: Sequence[int]) -> dict[str, float]:
    if not lengths:
        return {}
    return {
        name: float(f(lengths)) for name, f in (("min", min), ("median", np.median), ("mean", np.mean), ("max", max))
    }


def _dimensions(feature: Feature, moments: Moments) -> Iterable[Dimension]:
    columns = (moments.low, moments.mean, moments.high, moments.std)
    for i, (low, mean, high, std) in enumerate(zip(*columns, strict=True)):
        name = feature.names[i] if i < len(feature.names) else str(i)
        yield Dimension(feature.name, name, float(low), float(mean), float(high), float(std))


def _camera(dataset: Dataset, name: str) -> Camera:
    """The encoding is that of the first file: one encoder makes all files of a camera."""
    feature = dataset.info.features[name]
    if feature.dtype == "image":
        height, width, _ = feature.shape
        return Camera(name, "in the data files", "", width, height, 0, 0)
    files = list(dict.fromkeys(episode.clips[name].file for episode in dataset.episodes))
    if not files:
        return Camera(name, "", "", 0, 0, 0, 0)
    stream = probe(dataset.path(files[0]), files[0])
    size = _size(dataset.path(file) for file in files)
    return Camera(name, stream.codec, stream.pixel_format, stream.width, stream.height, len(files), size)


def _size(paths: Iterable[Path]) -> int:
    return sum(path.stat().st_size for path in paths if path.is_file())
