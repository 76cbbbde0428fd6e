"""What the arm may do: the numbers that the planner keeps to and the gate enforces."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from ..geometry import FloatArray

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Corner = tuple[
    Annotated[float, Field(ge=-1.0, le=1.0)],
    Annotated[float, Field(ge=-1.0, le=1.0)],
    Annotated[float, Field(ge=-1, le=1)],
]


class MotionLimits(BaseModel):
    """Limits on where the TCP may go and how fast, on top of the arm's own joint limits."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    workspace_low: Corner = (0.05, -0.36, -0.005)
    """m, base frame: lower corner of the box that the TCP stays in."""
    workspace_high: Corner = (0.50, 0.36, 0.50)
    """m, base frame: upper corner."""
    tcp_speed: Positive = 0.25
    """m/s, fastest motion of the TCP."""
    contact_speed: Positive = 0.12
    """m/s, of moves that may touch an object; above `tcp_speed` it changes nothing."""
    joint_margin: Annotated[float, Field(ge=0, le=0.5)] = 0.01
    """rad, kept free at both ends of every joint's range."""
    joint_speed_share: Annotated[float, Field(gt=0, le=1)] = 0.5
    """Share of the joints' published speed limits that may be used."""
    joint_acceleration: Positive = 4.0
    """rad/s^2."""
    joint_jerk: Positive = 40.0
    """rad/s^3."""

    @model_validator(mode="after")
    def _box_has_a_volume(self) -> MotionLimits:
        if not all(low < high for low, high in zip(self.workspace_low, self.workspace_high, strict=True)):
            raise ValueError("workspace_low must be below workspace_high on every axis")
        return self

    def outside(self, point: FloatArray) -> str:
        """How a TCP position ((3,) m) leaves the workspace, in words; empty where it doesn't."""
        for name, value, low, high in zip("xyz", point, self.workspace_low, self.workspace_high, strict=True):
            if not low <= value <= high:
                return f"{name} = {value:.3f} m is outside the workspace ({low:.3f} to {high:.3f} m)"
        return ""

    def contains(self, points: FloatArray) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
        """Which of the points (..., 3) (m, base frame) are in the workspace; NaN is not. Returns (...,) bool."""
        return np.all((points >= self.workspace_low) & (points <= self.workspace_high), axis=-1)
