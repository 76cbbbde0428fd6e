"""What a collected episode is, and how it lies on disk until it is part of a dataset.

A folder an episode. It is written under a name that begins with a dot, and gets its own name only when all of it is on
the disk: a folder that can be seen is whole.

    episode.json           EpisodeInfo
    steps.npz              the arrays of `Steps`
    rgb-<camera>.npy       (T, H, W, 3) uint8
    depth-<camera>.npy     (T, H, W) uint16, millimetres, 0 where unknown; only where depth was asked for
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from ..geometry import FloatArray

JOINTS = ("waist", "shoulder", "elbow", "forearm_roll", "wrist_angle", "wrist_rotate")
"""Names of the arm's joints, in the order of every array over them."""
Label = Literal["valid", "failed", "doubtful"]


@dataclass(frozen=True)
class Steps:
    """The numbers of an episode at a fixed rate: T rows, base frame, metres, radians, seconds."""

    time: FloatArray
    """(T,) from the first row's 0."""
    joints: FloatArray
    """(T, 6) measured."""
    opening: FloatArray
    """(T,) measured, between the fingers."""
    tcp: FloatArray
    """(T, 7) measured: x, y, z, and the quaternion x, y, z, w."""
    joint_targets: FloatArray
    """(T, 6) the action: where the joints are sent until the next row."""
    opening_target: FloatArray
    """(T,) the action, likewise."""
    tcp_delta: FloatArray
    """(T, 6) the same action as an end-effector delta: translation, then rotation vector, both along the base's axes,
    from the TCP that the row before commanded (the first: that was measured) to the one that this row commands."""
    subtasks: tuple[str, ...]
    """T texts: what the robot was doing."""


@dataclass(frozen=True)
class Recording:
    """An episode as it was recorded."""

    steps: Steps
    rgb: Mapping[str, NDArray[np.uint8]]
    """By camera: (T, H, W, 3)."""
    depth: Mapping[str, NDArray[np.uint16]]
    """By camera: (T, H, W), millimetres, 0 where unknown; empty where it was not asked for."""


class EpisodeInfo(BaseModel):
    """What is known of an episode besides its recording."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    key: Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9-]{0,79}$")]
    """Names the episode for good; also its folder's name."""
    task: str
    instruction: str
    paraphrases: tuple[str, ...] = ()
    fps: Annotated[float, Field(gt=0)]
    seed: int
    start: tuple[float, float, float]
    """x, y (m), yaw (rad) at which the plan wanted the object to begin."""
    began: tuple[float, float] | None = None
    """x, y (m) at which the object was seen to begin; None where it wasn't."""
    attempts: Annotated[int, Field(ge=1)] = 1
    """The attempt at this start that is recorded here."""
    label: Label
    """By what the robot sees, never by the simulator."""
    reason: str = ""
    """Why it isn't valid."""
    distance: float | None = None
    """m from where the object was to be, by perception; None where it wasn't seen."""
    true_distance: float | None = None
    """m, by the simulator; None on a real robot."""
    truly_valid: bool | None = None
    """By the simulator's predicate, for the precision and recall of `label`."""
    seconds: Annotated[float, Field(ge=0)] = 0.0
    """Wall time."""
    interventions: Annotated[int, Field(ge=0)] = 0
