"""What the robot saw on one turn, without loss: colours as the PNG files that people look at, all else in one .npz.

Depth is kept as the four byte planes of its 32-bit floats: next to each other, sign and exponent bytes hardly differ,
so that the file is a fifth smaller than that of the plain floats and is written three times as fast.
"""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ..errors import UsageError
from ..types import CameraFrame, Observation, RobotState

_LARGEST = 2**30
"""Bytes that a file may unpack to."""


def save_look(path: Path, observation: Observation) -> None:
    """Write everything but the colours; the file is there as a whole or not at all."""
    frames = list(observation.frames.values())
    arrays: dict[str, NDArray[np.generic]] = {
        "names": np.array([frame.name for frame in frames]),
        "keys": np.array(list(observation.frames)),
        "main": np.array(observation.main),
        "joint_positions": observation.robot.joint_positions,
        "T_base_tcp": observation.robot.T_base_tcp,
        "opening_and_time": np.array([observation.robot.gripper_opening, observation.robot.time]),
    }
    for number, frame in enumerate(frames):
        arrays[f"depth_{number}"] = _planes(frame.depth)
        arrays[f"K_{number}"] = frame.K
        arrays[f"T_base_camera_{number}"] = frame.T_base_camera
    part = path.with_suffix(".part")
    with part.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, **arrays)
    part.replace(path)


def load_look(path: Path, picture_of: Callable[[str], Path]) -> Observation:
    """The inverse of `save_look`; `picture_of` says in which file the colours of a view are.

    Raises UsageError where a file is missing or damaged.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            if sum(member.file_size for member in archive.infolist()) > _LARGEST:
                raise UsageError(f"{path} is too large for one observation.")
        with np.load(path, allow_pickle=False) as arrays:
            frames = {}
            for number, (key, name) in enumerate(zip(arrays["keys"].tolist(), arrays["names"].tolist(), strict=True)):
                with Image.open(picture_of(key)) as picture:
                    rgb = np.asarray(picture.convert("RGB"))
                depth = _depth(arrays[f"depth_{number}"])
                frames[key] = CameraFrame(name, rgb, depth, arrays[f"K_{number}"], arrays[f"T_base_camera_{number}"])
            opening, time = arrays["opening_and_time"].tolist()
            robot = RobotState(arrays["joint_positions"], arrays["T_base_tcp"], opening, time)
            return Observation(frames, str(arrays["main"]), robot)
    except (OSError, EOFError, ValueError, KeyError, zipfile.BadZipFile, zlib.error) as error:
        raise UsageError(f"What was seen can't be read back from {path}: {error}") from error


def _planes(depth: NDArray[np.float32]) -> NDArray[np.uint8]:
    """(4, H, W) bytes of a float32 image (H, W), the lowest first."""
    return np.ascontiguousarray(depth.astype("<f4").view(np.uint8).reshape(*depth.shape, 4).transpose(2, 0, 1))


def _depth(planes: NDArray[np.uint8]) -> NDArray[np.float32]:
    return np.ascontiguousarray(planes.transpose(1, 2, 0)).view("<f4")[..., 0].astype(np.float32)
