"""Where things lie in a LeRobotDataset v3, and what its meta/info.json promises.

meta/info.json                          features, rate, totals, path templates
meta/stats.json                         statistics by feature
meta/tasks.parquet                      task_index, and the task's text as the index
meta/episodes/chunk-NNN/file-NNN.parquet  one row an episode: length, where its rows and clips lie, its statistics
data/chunk-NNN/file-NNN.parquet         one row a frame, several episodes a file
videos/CAMERA/chunk-NNN/file-NNN.mp4    several episodes a file
meta/maniagent.jsonl                    ours, optional: one EpisodeInfo a line, in episode order
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

from ...errors import UsageError

INFO = "meta/info.json"
STATS = "meta/stats.json"
TASKS = "meta/tasks.parquet"
SUBTASKS = "meta/subtasks.parquet"
EPISODES = "meta/episodes"
COLLECTED = "meta/maniagent.jsonl"

BOOKKEEPING = ("timestamp", "frame_index", "episode_index", "index", "task_index")
"""Features that every dataset has."""

_DATA_PATH = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
_FIELD = re.compile(r"\{(chunk_index|file_index|video_key)(:0?[1-9]d)?\}")


class DatasetError(UsageError):
    """A dataset that can't be read: where, what is wrong, and what to do about it."""

    def __init__(self, where: str, what: str, todo: str = "") -> None:
        self.where, self.what, self.todo = where, what, todo
        super().__init__(f"{where}: {what}{'.' if not what.endswith('.') else ''}{f' {todo}' if todo else ''}")


@dataclass(frozen=True)
class Feature:
    """One thing that is recorded with every frame."""

    name: str
    dtype: str
    """video, image, string, bool, or a numpy type's name."""
    shape: tuple[int, ...]
    """Of one frame's value; (H, W, C) of pictures."""
    names: tuple[str, ...]
    """Of the dimensions of a vector; made up where the dataset has none."""

    @property
    def is_picture(self) -> bool:
        """Whether a frame's value is an image, in a video or in the table."""
        return self.dtype in ("video", "image")

    @property
    def is_vector(self) -> bool:
        """Whether a frame's value is one number or a list of numbers."""
        return len(self.shape) == 1 and not self.is_picture and self.dtype != "string"


@dataclass(frozen=True)
class Info:
    """What meta/info.json says."""

    version: str
    robot: str
    fps: float
    total_episodes: int
    total_frames: int
    total_tasks: int
    features: Mapping[str, Feature]
    data_path: str
    video_path: str

    @property
    def cameras(self) -> tuple[str, ...]:
        """Names of the features that are videos."""
        return tuple(name for name, feature in self.features.items() if feature.dtype == "video")

    @property
    def pictures(self) -> tuple[str, ...]:
        """Names of the features that are videos or images."""
        return tuple(name for name, feature in self.features.items() if feature.is_picture)

    @property
    def stored(self) -> tuple[Feature, ...]:
        """The features that are columns of the data files."""
        return tuple(feature for feature in self.features.values() if feature.dtype != "video")

    def data_file(self, chunk: int, file: int) -> str:
        """Path of a data file, relative to the dataset."""
        return self.data_path.format(chunk_index=chunk, file_index=file)

    def video_file(self, camera: str, chunk: int, file: int) -> str:
        """Path of a video file, relative to the dataset."""
        return self.video_path.format(video_key=camera, chunk_index=chunk, file_index=file)


def load_json(path: Path, where: str) -> Any:
    """The value in a JSON file; DatasetError where there is none."""
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise DatasetError(where, "is missing", "Copy it from where the dataset was made.") from None
    except (OSError, ValueError, RecursionError) as error:
        raise DatasetError(where, f"can't be read as JSON ({error})", "Copy the file again.") from error


def load_info(root: Path) -> Info:
    """The promises of the dataset in `root`, or DatasetError."""
    raw = load_json(root / INFO, INFO)
    if not isinstance(raw, dict):
        raise DatasetError(INFO, "is no JSON object")
    version = raw.get("codebase_version")
    if not isinstance(version, str) or not re.match(r"v?3(\.|$)", version):
        raise DatasetError(
            INFO,
            f"codebase_version is {version!r}, v3.0 is wanted",
            "LeRobot converts older ones: python -m lerobot.datasets.v30.convert_dataset_v21_to_v30.",
        )
    features = _features(raw.get("features"))
    return Info(
        version,
        str(raw.get("robot_type") or "unknown"),
        _fps(raw.get("fps")),
        _count(raw, "total_episodes"),
        _count(raw, "total_frames"),
        _count(raw, "total_tasks"),
        features,
        _template(raw.get("data_path") or _DATA_PATH, "data_path", {"chunk_index", "file_index"}),
        _template(raw["video_path"], "video_path", {"video_key", "chunk_index", "file_index"})
        if raw.get("video_path")
        else _no_videos(features),
    )


def inside(root: Path, relative: str, where: str) -> Path:
    """`root / relative`, refused where it would lead out of the dataset."""
    parts = PurePosixPath(relative)
    if parts.is_absolute() or ".." in parts.parts or "\0" in relative:
        raise DatasetError(where, f"names {relative!r}, which lies outside the dataset")
    return root / parts


def _features(raw: Any) -> dict[str, Feature]:
    if not isinstance(raw, dict) or not raw:
        raise DatasetError(INFO, "has no features")
    features = {str(name): _feature(str(name), value) for name, value in raw.items()}
    if missing := [name for name in BOOKKEEPING if name not in features]:
        raise DatasetError(INFO, f"lacks the features {', '.join(missing)}, which every LeRobotDataset has")
    return features


def _feature(name: str, raw: Any) -> Feature:
    if not isinstance(raw, dict):
        raise DatasetError(INFO, f"feature {name!r} is no JSON object")
    dtype, shape = raw.get("dtype"), raw.get("shape")
    if not isinstance(dtype, str):
        raise DatasetError(INFO, f"feature {name!r} has no dtype")
    if not isinstance(shape, list) or not shape or not all(type(n) is int and 0 < n < 1 << 20 for n in shape):
        raise DatasetError(INFO, f"feature {name!r} has the shape {shape!r}, a list of positive lengths is wanted")
    if dtype in ("video", "image") and len(shape) != 3:
        raise DatasetError(INFO, f"pictures {name!r} have the shape {shape!r}, height, width and channels are wanted")
    return Feature(name, dtype, tuple(shape), _names(raw.get("names"), shape[0]))


def _names(raw: Any, count: int) -> tuple[str, ...]:
    """Names of a vector's dimensions: a list, or lists by group as some makers write them."""
    if isinstance(raw, dict):
        raw = [name for group in raw.values() for name in (group if isinstance(group, list) else [group])]
    if isinstance(raw, list) and len(raw) == count:
        return tuple(map(str, raw))
    return tuple(f"{i}" for i in range(min(count, 1000)))


def _fps(raw: Any) -> float:
    if isinstance(raw, bool) or not isinstance(raw, int | float) or not (math.isfinite(raw) and 0 < raw <= 1e5):
        raise DatasetError(INFO, f"fps is {raw!r}, a number above 0 is wanted")
    return float(raw)


def _count(raw: Mapping[str, Any], key: str) -> int:
    value = raw.get(key)
    if type(value) is not int or value < 0:
        raise DatasetError(INFO, f"{key} is {value!r}, a whole number is wanted")
    return value


def _template(raw: Any, key: str, fields: set[str]) -> str:
    """A path template, trusted to name files and nothing else."""
    found = {match[1] for match in _FIELD.finditer(raw)} if isinstance(raw, str) else set()
    if found != fields or re.search(r"[{}]", _FIELD.sub("", raw)):
        raise DatasetError(INFO, f"{key} is {raw!r}, a path with {', '.join(sorted(fields))} is wanted")
    inside(Path(), str(raw), INFO)
    return str(raw)


def _no_videos(features: Mapping[str, Feature]) -> str:
    if cameras := [name for name, feature in features.items() if feature.dtype == "video"]:
        raise DatasetError(INFO, f"has no video_path, but {', '.join(cameras)} are videos")
    return ""
