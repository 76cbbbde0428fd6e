"""Reads a LeRobot dataset of ours, an episode at a time, and packs each as the writer wants it."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ...errors import UsageError
from ...motion.kinematics import ArmModel
from ..dataset.layout import INFO, DatasetError
from ..dataset.reading import Dataset, Episode, read_collected
from ..lerobot.schema import ROBOT
from .conventions import Fingers, to_moves

JPEG_QUALITY = 95
"""The recorded videos lose more than this does; a PNG would be ten times as large."""
_STATE, _POSE, _DELTA = "observation.state", "observation.ee_pose", "ee_delta"
_PICTURES = "observation.images."


@dataclass(frozen=True)
class Settings:
    """What of a dataset is exported, and how."""

    camera: str = "main"
    """Becomes `image`, what a policy sees."""
    every: int = 1
    """Keeps every so-many-th frame."""
    size: tuple[int, int] | None = None
    """Width and height of the pictures, px; None keeps them as they were recorded."""
    fingers: Fingers | None = None
    """The gripper's; None takes those of the robot that the dataset names."""


@dataclass(frozen=True)
class Packed:
    """An episode, ready for the writer."""

    data: bytes
    """A file of numpy's npz format, as writer.py says."""
    steps: int


class Source:
    """A dataset that has been looked at, so that what can't be exported is known before anything is written.

    Raises UsageError where it lacks what an RLDS dataset needs, DatasetError where it is broken.
    """

    def __init__(self, root: Path, settings: Settings = Settings()) -> None:
        self.dataset = Dataset.open(root)
        self._settings = settings
        self._check_numbers()
        self.cameras = self._cameras()
        """Features that hold pictures, by the names that they get: `image` is the first."""
        self._fingers = settings.fingers or _fingers(self.dataset.info.robot)
        self._keys = {number: info.key for number, info in enumerate(read_collected(root) or ())}
        if not self.dataset.episodes:
            raise UsageError(f"{root} has no episodes.")

    @property
    def rate(self) -> float:
        """Steps a second."""
        return self.dataset.info.fps / self._settings.every

    def schema(self) -> dict[str, Any]:
        """The shapes of what an episode holds, for the writer."""
        return {
            "images": {name: self._shape(feature) for name, feature in self.cameras.items()},
            "joints": self.dataset.info.features[_STATE].shape[0] - 1,
        }

    def pack(self, episode: Episode) -> Packed:
        """Convert an episode, pictures and all."""
        numbers = self.dataset.numbers(episode, [_STATE, _POSE, _DELTA])
        if not episode.length or not all(np.isfinite(column).all() for column in numbers.values()):
            raise DatasetError(episode.data, f"{episode.name} is empty or holds what is no number")
        moves = to_moves(numbers[_STATE], numbers[_POSE], numbers[_DELTA], self._fingers, self._settings.every)
        rows = range(0, episode.length, self._settings.every)
        texts = self.dataset.subtasks(episode) or ("",) * episode.length
        arrays: dict[str, NDArray[Any]] = {
            "state": moves.state,
            "joint_state": moves.joint_state,
            "action": moves.action,
            "subtask": np.array([texts[row] for row in rows]),
            "language_instruction": np.array(self._instruction(episode)),
            "key": np.array(self._keys.get(episode.index, str(episode.index))),
            "episode_index": np.array(episode.index),
        }
        for name, feature in self.cameras.items():
            arrays |= _joined(name, self._jpegs(episode, feature, rows))
        file = io.BytesIO()
        np.savez(file, **arrays)  # type: ignore[arg-type] # its stub takes the names for its own options
        return Packed(file.getvalue(), len(rows))

    def _jpegs(self, episode: Episode, feature: str, rows: range) -> Iterator[bytes]:
        for picture in self.dataset.pictures(episode, feature, rows):
            image = Image.fromarray(picture)
            if self._settings.size is not None:
                image = image.resize(self._settings.size, Image.Resampling.LANCZOS)
            file = io.BytesIO()
            image.save(file, "JPEG", quality=JPEG_QUALITY)
            yield file.getvalue()

    def _instruction(self, episode: Episode) -> str:
        if not episode.tasks:
            raise DatasetError(episode.data, f"{episode.name} has no task", "`maniagent data verify` says more.")
        return episode.tasks[0]

    def _shape(self, feature: str) -> tuple[int, int, int]:
        height, width, _ = self.dataset.info.features[feature].shape
        width, height = self._settings.size or (width, height)
        return height, width, 3

    def _check_numbers(self) -> None:
        features = self.dataset.info.features
        missing = [name for name in (_STATE, _POSE, _DELTA) if name not in features or len(features[name].shape) != 1]
        wrong = [name for name in (_POSE, _DELTA) if name not in missing and features[name].shape != (7,)]
        if missing or wrong or features[_STATE].names[-1] != "opening":
            raise UsageError(
                f"{self.dataset.root} can't become an RLDS dataset with end-effector actions: it has no "
                f"{', '.join(missing + wrong) or 'finger opening at the end of ' + _STATE} as datasets that maniagent "
                "collected have (docs/data.md)."
            )

    def _cameras(self) -> dict[str, str]:
        known = {feature.removeprefix(_PICTURES): feature for feature in self.dataset.info.pictures}
        main = self._settings.camera
        if main not in known:
            raise UsageError(f"There is no camera {main!r} in {INFO}; it has {', '.join(sorted(known)) or 'none'}.")
        others = {_feature_name(name): feature for name, feature in known.items() if name != main}
        return {"image": known[main], **others}


def _feature_name(camera: str) -> str:
    """Of a camera that is not the main one: `wrist_image` as others have it, else its own name."""
    return "wrist_image" if camera == "wrist" else "image_" + re.sub(r"\W", "_", camera)


def _fingers(robot: str) -> Fingers:
    if robot != ROBOT:
        raise UsageError(
            f"It isn't known how far the fingers of {robot!r} open. Export from Python, with Settings(fingers=...)."
        )
    model = ArmModel()
    return Fingers(model.min_opening, model.max_opening)


def _joined(name: str, files: Iterator[bytes]) -> Mapping[str, NDArray[Any]]:
    """Files as one array of bytes, and where each of them ends."""
    parts = list(files)
    return {
        f"{name}.bytes": np.frombuffer(b"".join(parts), np.uint8),
        f"{name}.ends": np.cumsum([len(part) for part in parts]),
    }
