"""A dataset opened for reading: its episodes, their numbers, texts and pictures."""

from __future__ import annotations

import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from pydantic import ValidationError

from ...errors import UsageError
from ..episode import EpisodeInfo
from . import video
from .layout import (
    COLLECTED,
    EPISODES,
    INFO,
    SUBTASKS,
    TASKS,
    DatasetError,
    Feature,
    Info,
    inside,
    load_info,
)
from .tables import DataFile, parquet_files, read_rows, texts, values
from .video import Picture


@dataclass(frozen=True)
class Clip:
    """An episode's part of a video file."""

    file: str
    """Relative to the dataset."""
    start: float
    """s, when the first picture is shown."""
    end: float
    """s, when the picture after the last one would be."""


@dataclass(frozen=True)
class Episode:
    """Where an episode lies."""

    index: int
    length: int
    """Frames."""
    tasks: tuple[str, ...]
    data: str
    """The data file, relative to the dataset."""
    start: int
    """Number of its first frame in the whole dataset."""
    stop: int
    clips: Mapping[str, Clip]
    """By camera."""
    statistics: Mapping[str, Mapping[str, Any]]
    """By feature: min, max, mean, std, count; empty where they were not asked for."""

    @property
    def name(self) -> str:
        """How findings call it."""
        return f"episode {self.index}"


@dataclass(frozen=True)
class Dataset:
    """A LeRobotDataset v3 on disk. Reading raises DatasetError where a file is missing or broken."""

    root: Path
    info: Info
    tasks: Mapping[int, str]
    """Texts by task_index."""
    episodes: tuple[Episode, ...]
    _opened: dict[str, DataFile] = field(default_factory=dict, repr=False, compare=False)
    """The data file that was read last: episodes mostly share it."""

    @classmethod
    def open(cls, root: Path) -> Self:
        """Read what `root` says of itself; raises UsageError where that is no dataset, DatasetError where broken."""
        check_is_dataset(root)
        info = load_info(root)
        return cls(root, info, read_tasks(root), read_episodes(root, info))

    def episode(self, index: int) -> Episode:
        """The episode of that number; UsageError where there is none."""
        for episode in self.episodes:
            if episode.index == index:
                return episode
        raise UsageError(f"There is no episode {index}; the dataset has {len(self.episodes)}, numbered from 0.")

    def path(self, relative: str) -> Path:
        """A file of the dataset."""
        return inside(self.root, relative, INFO)

    def numbers(self, episode: Episode, features: Sequence[str]) -> dict[str, NDArray[Any]]:
        """Columns of an episode: (T, *shape), (T,) where a frame has one number."""
        table = self._table(episode, features)
        try:
            return {name: values(table[name], self.info.features[name].shape) for name in features}
        except ValueError as error:
            raise DatasetError(f"{episode.data}, {episode.name}", str(error)) from error

    def subtasks(self, episode: Episode) -> tuple[str, ...]:
        """What the robot was doing, a text a frame; none where the dataset doesn't say.

        By the feature `subtask`, or by `subtask_index` into meta/subtasks.parquet.
        """
        if _is_text(self.info.features.get("subtask")):
            return texts(self._table(episode, ["subtask"])["subtask"])
        if "subtask_index" in self.info.features and (self.root / SUBTASKS).is_file():
            names = _named(self.root / SUBTASKS, SUBTASKS, "subtask_index")
            indices = self.numbers(episode, ["subtask_index"])["subtask_index"]
            return tuple(names.get(int(index), "") for index in indices)
        return ()

    def pictures(self, episode: Episode, camera: str, frames: Sequence[int]) -> list[Picture]:
        """(H, W, 3) RGB of the frames with these numbers (ascending), counted from the episode's first."""
        if self.info.features[camera].dtype == "image":
            cells = self._table(episode, [camera])[camera]
            return [_decoded(cells[frame].as_py(), f"{episode.data}, {episode.name}") for frame in frames]
        clip = episode.clips[camera]
        times = [clip.start + frame / self.info.fps for frame in frames]
        return video.pictures_at(self.path(clip.file), clip.file, times)

    def _table(self, episode: Episode, columns: Sequence[str]) -> Any:
        file = self._file(episode.data)
        if missing := [name for name in columns if name not in file.columns]:
            raise DatasetError(episode.data, f"has no column {', '.join(missing)}")
        rows = np.flatnonzero(file.column("episode_index") == episode.index)
        if len(rows) != episode.length or (np.diff(rows) != 1).any():
            raise DatasetError(
                f"{episode.data}, {episode.name}", f"has {len(rows)} rows in one piece or several, not {episode.length}"
            )
        return file.table(int(rows[0]), int(rows[-1]) + 1, tuple(columns)) if len(rows) else file.table(0, 0, columns)

    def _file(self, name: str) -> DataFile:
        if name not in self._opened:
            self._opened.clear()
            self._opened[name] = DataFile(self.path(name), name)
        return self._opened[name]


def check_is_dataset(root: Path) -> None:
    """UsageError where there is no dataset at all in `root`, with the nearest one if there is one."""
    if not root.is_dir():
        raise UsageError(f"There is no folder {root}.")
    if not (root / "meta").is_dir():
        near = sorted(path.parent.parent for path in root.glob(f"*/{INFO}"))
        hint = f" Did you mean {near[0]}?" if near else ""
        raise UsageError(f"{root} is no LeRobot dataset: it has no folder meta.{hint}")


def read_tasks(root: Path) -> dict[int, str]:
    """The tasks' texts by task_index."""
    return _named(root / TASKS, TASKS, "task_index")


def read_episodes(root: Path, info: Info, statistics: bool = False) -> tuple[Episode, ...]:
    """The episodes in the order in which the files hold them."""
    episodes: list[Episode] = []
    paths = parquet_files(root / EPISODES)
    if not paths and info.total_episodes:
        raise DatasetError(EPISODES, "has no Parquet file", "Copy it from where the dataset was made.")
    for path in paths:
        where = path.relative_to(root).as_posix()
        for row in read_rows(path, where, without="" if statistics else "stats/"):
            episodes.append(_episode(row, info, f"{where}, row {len(episodes)}"))
    return tuple(episodes)


def read_collected(root: Path) -> tuple[EpisodeInfo, ...] | None:
    """What our collector wrote about each episode, in order; None where another one made the dataset."""
    path = root / COLLECTED
    if not path.is_file():
        return None
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, ValueError) as error:
        raise DatasetError(COLLECTED, f"can't be read ({error})") from error
    infos = []
    for number, line in enumerate(lines, 1):
        try:
            infos.append(EpisodeInfo.model_validate_json(line))
        except ValidationError as error:
            said = error.errors()[0]["msg"]
            raise DatasetError(f"{COLLECTED}, line {number}", f"is no EpisodeInfo ({said})") from error
    return tuple(infos)


def _named(path: Path, where: str, key: str) -> dict[int, str]:
    """A table of names by number; LeRobot keeps the names in the table's index, others in a column of their own."""
    names: dict[int, str] = {}
    for row in read_rows(path, where):
        number = row.pop(key, None)
        found = [value for value in row.values() if isinstance(value, str)]
        if not isinstance(number, int) or len(found) != 1:
            raise DatasetError(where, f"has a row without {key} and one text: {str({key: number, **row})[:200]}")
        if number in names:
            raise DatasetError(where, f"has {key} {number} twice")
        names[number] = found[0]
    return names


def _episode(row: Mapping[str, Any], info: Info, where: str) -> Episode:
    def whole(key: str) -> int:
        value = row.get(key)
        if not isinstance(value, int | float) or not 0 <= value < 1 << 53 or value != int(value):
            raise DatasetError(where, f"{key} is {value!r}, a whole number is wanted")
        return int(value)

    def seconds(key: str) -> float:
        value = row.get(key)
        if not isinstance(value, int | float) or not (math.isfinite(value) and 0 <= value < 1e9):
            raise DatasetError(where, f"{key} is {value!r}, seconds are wanted")
        return float(value)

    def clip(camera: str) -> Clip:
        at = f"videos/{camera}"
        file = info.video_file(camera, whole(f"{at}/chunk_index"), whole(f"{at}/file_index"))
        return Clip(file, seconds(f"{at}/from_timestamp"), seconds(f"{at}/to_timestamp"))

    tasks = row.get("tasks")
    return Episode(
        whole("episode_index"),
        whole("length"),
        tuple(map(str, tasks)) if isinstance(tasks, list) else (),
        info.data_file(whole("data/chunk_index"), whole("data/file_index")),
        whole("dataset_from_index"),
        whole("dataset_to_index"),
        {camera: clip(camera) for camera in info.cameras},
        _statistics(row),
    )


def _statistics(row: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """The columns stats/FEATURE/NAME of an episode's row."""
    found: dict[str, dict[str, Any]] = {}
    for key, value in row.items():
        if key.startswith("stats/"):
            feature, _, name = key.removeprefix("stats/").rpartition("/")
            found.setdefault(feature, {})[name] = value
    return found


def _is_text(feature: Feature | None) -> bool:
    return feature is not None and feature.dtype == "string"


def _decoded(cell: Any, where: str) -> Picture:
    """A picture that lies in the table itself."""
    data = cell.get("bytes") if isinstance(cell, dict) else None
    if not data:
        raise DatasetError(where, "has a picture that is not in the table")
    try:
        with Image.open(io.BytesIO(data)) as image:
            return np.asarray(image.convert("RGB"))
    except (OSError, ValueError) as error:
        raise DatasetError(where, f"has a picture that can't be decoded ({error})") from error
