"""What a dataset's frames are made of, and whether an episode fits a dataset."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import UsageError
from ...robots.sampling import Sampling
from ..episode import JOINTS, EpisodeInfo

ROBOT = "widowx_250s"
_STATE = (*JOINTS, "opening")
_TWIST = ("dx", "dy", "dz", "rx", "ry", "rz")
Feature = dict[str, Any]
"""dtype, shape and names, as LeRobot's meta/info.json has them."""


@dataclass(frozen=True)
class Schema:
    """What has to be the same in all of a dataset's episodes."""

    fps: int
    robot_type: str
    features: Mapping[str, Feature]

    def to_plain(self) -> dict[str, Any]:
        """For JSON."""
        return {"fps": self.fps, "robot_type": self.robot_type, "features": dict(self.features)}


def schema_of(folder: Path, info: EpisodeInfo, robot_type: str = ROBOT) -> Schema:
    """The schema that a staged episode has.

    Only its images' headers are read. Raises UsageError where its rate isn't a whole number of frames a second, which
    LeRobot's videos can't have, or where an image file can't be read.
    """
    check_rate(info.fps, str(folder))
    features: dict[str, Feature] = {
        "observation.state": _numbers(_STATE),
        "observation.ee_pose": _numbers(("x", "y", "z", "qx", "qy", "qz", "qw")),
        "action": _numbers(_STATE),
        "ee_delta": _numbers((*_TWIST, "opening")),
        "subtask": _text(),
    }
    for path in sorted(folder.glob("rgb-*.npy")):
        name = f"observation.images.{path.stem.removeprefix('rgb-')}"
        features[name] = {"dtype": "video", "shape": _shape(path), "names": ["height", "width", "channels"]}
    for path in sorted(folder.glob("depth-*.npy")):
        features[f"depth.{path.stem.removeprefix('depth-')}"] = _text()
    return Schema(round(info.fps), robot_type, features)


def read_schema(dataset: Path) -> Schema:
    """The schema of a dataset, without what LeRobot adds to each. Raises UsageError where it can't be read."""
    path = dataset / "meta" / "info.json"
    try:
        info = json.loads(path.read_text())
        features = {
            name: {"dtype": f["dtype"], "shape": list(f["shape"]), "names": f["names"]}
            for name, f in info["features"].items()
            if name not in ("timestamp", "frame_index", "episode_index", "index", "task_index")
        }
        return Schema(info["fps"], info["robot_type"], features)
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise UsageError(
            f"{path} is no description of a LeRobot dataset ({error}). Publish into another folder."
        ) from error


def check_rate(fps: float, whose: str) -> None:
    """Raises UsageError, which names `whose` it is, for a rate that LeRobot's videos can't have."""
    if fps != round(fps):
        raise UsageError(f"{whose}: LeRobot's videos have a whole number of frames a second, not {fps:g}.")


def unlike(have: Schema, sampling: Sampling, robot_type: str = ROBOT) -> list[str]:
    """In what episodes sampled so will differ from those of a dataset, as far as that is known before there is one."""
    found = []
    if have.fps != sampling.rate:
        found.append(f"{have.fps} frames a second, not {sampling.rate:g}")
    if have.robot_type != robot_type:
        found.append(f"robot {have.robot_type}, not {robot_type}")
    for name, feature in have.features.items():
        height, width = feature["shape"][:2] if feature["dtype"] in ("video", "image") else (None, None)
        if height is not None and (height, width) != (sampling.height, sampling.width):
            found.append(f"{name} has {width} x {height} px, not {sampling.width} x {sampling.height}")
    if any(name.startswith("depth.") for name in have.features) != sampling.depth:
        found.append("no depth" if sampling.depth else "depth")
    return found


def differences(have: Schema, want: Schema) -> list[str]:
    """In what `want` differs from the schema `have` of a dataset, one clause each; empty where it fits."""
    found = []
    if have.fps != want.fps:
        found.append(f"{want.fps} frames a second, there {have.fps}")
    if have.robot_type != want.robot_type:
        found.append(f"robot {want.robot_type}, there {have.robot_type}")
    for name in sorted(have.features.keys() | want.features.keys()):
        old, new = have.features.get(name), want.features.get(name)
        if old is None or new is None:
            found.append(f"{name} is missing {'there' if old is None else 'here'}")
        elif old != new:
            found.append(f"{name} is {_told(new)}, there {_told(old)}")
    return found


def _numbers(names: tuple[str, ...]) -> Feature:
    return {"dtype": "float32", "shape": [len(names)], "names": list(names)}


def _text() -> Feature:
    return {"dtype": "string", "shape": [1], "names": None}


def _shape(path: Path) -> list[int]:
    try:
        return list(np.load(path, mmap_mode="r").shape[1:])
    except (OSError, ValueError) as error:
        raise UsageError(f"{path} can't be read ({error}). Move its episode out of the folder.") from error


def _told(feature: Feature) -> str:
    shape = " x ".join(str(n) for n in feature["shape"])
    return f"{feature['dtype']} {shape}" + (f" {', '.join(feature['names'])}" if feature["names"] else "")
