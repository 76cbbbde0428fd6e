"""What a robot that can be recorded tells, at a fixed rate, while it moves."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Protocol

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from ..errors import CameraFailure
from ..geometry import FloatArray
from .robot import Robot


class Sampling(BaseModel):
    """How often a robot is sampled, and how its pictures are taken."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    rate: Annotated[float, Field(gt=0, le=50)] = 10.0
    """Samples per second in which the robot moves."""
    width: Annotated[int, Field(ge=16, le=4096)] = 320
    height: Annotated[int, Field(ge=16, le=4096)] = 240
    """px. The vertical field of view is the camera's; a squarer picture leaves out what is at its sides."""
    depth: bool = False
    noise: bool = True
    """Whether simulated pictures have their camera's noise. A real camera has its own."""
    seed: Annotated[int, Field(ge=0)] = 0
    """Draws that noise, apart from the noise of what the agents see: a recorded run is the same as one that isn't."""


@dataclass(frozen=True)
class Picture:
    """One camera's picture in a sample."""

    rgb: NDArray[np.uint8]
    """(H, W, 3)."""
    time: float
    """s of the robot's clock at which it was taken."""
    depth: NDArray[np.float32] | None = None
    """(H, W) z-depth, m, NaN where nothing is known; None where it was not asked for."""


@dataclass(frozen=True)
class Sample:
    """Robot and pictures at one moment."""

    time: float
    """s, the robot's clock."""
    moving_time: float
    """s in which the robot was commanded since sampling began: the clock, but for the pauses in which it stood by."""
    joints: FloatArray
    """(6,) rad, measured."""
    opening: float
    """m between the fingers, measured."""
    T_base_tcp: FloatArray
    """(4, 4), measured."""
    joint_targets: FloatArray
    """(6,) rad, the command that is in force."""
    opening_target: float
    """m, likewise."""
    T_base_target: FloatArray
    """(4, 4): where the TCP is once the joints are at their targets."""
    pictures: Mapping[str, Picture]
    """By camera."""


class SampleListener(Protocol):
    """Who is told. Both methods must return quickly: the robot waits."""

    def on_sample(self, sample: Sample) -> None:
        """Take note of a sample; its arrays are the listener's to keep."""
        ...

    def on_camera_failure(self, failure: CameraFailure) -> None:
        """A camera gave no picture, so that there is no sample; the robot moves on and doesn't ask it again."""
        ...


class RecordableRobot(Robot, Protocol):
    """A `Robot` that can be recorded while it moves."""

    def start_sampling(self, listener: SampleListener, sampling: Sampling) -> None:
        """Tell `listener` of every sample from now on, whatever makes the robot move; one listener at a time.

        Raises UsageError where the cameras take no such pictures.
        """
        ...

    def stop_sampling(self) -> None:
        """Tell nobody any more."""
        ...


class Metronome:
    """Says at which control ticks a sample is due: at a fixed rate, counting only time in which the robot moves.

    Between two ticks that are more than a sampling period apart the robot stood by, while its agents were thinking or
    things came to rest. To learn from such a pause would be to learn to pause: it counts as one control period.
    """

    def __init__(self, rate: float, control_period: float) -> None:
        """`rate` in samples per second; `control_period` in s."""
        self._rate = rate
        self._control_period = control_period
        self._last: float | None = None
        self._moving = 0.0
        self._taken = 0

    def tick(self, time: float) -> float | None:
        """The moving time (s) where a sample is due at this tick, else None. `time` (s) is the robot's clock."""
        if self._last is not None:
            elapsed = time - self._last
            self._moving += elapsed if 0.0 < elapsed <= 1.0 / self._rate else self._control_period
        self._last = time
        if self._moving < self._taken / self._rate - self._control_period / 2:
            return None
        self._taken += 1
        return self._moving
