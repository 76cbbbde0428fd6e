"""Notices when an arm doesn't go where it is told: contact, a stall, a lost servo."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..assets import JOINTS
from ..geometry import FloatArray
from .arm import ArmState
from .kinematics import ArmModel


@dataclass(frozen=True)
class WatchSettings:
    """When a deviation counts as being blocked."""

    servo_lag: float = 0.06
    """s: how far a freely moving arm follows behind its set-points."""
    tcp_deviation: float = 0.008
    """m: between the TCP and where a free arm's would be."""
    joint_deviation: float = 0.12
    """rad, likewise; catches a blocked wrist, which hardly moves the TCP."""
    patience: float = 0.04
    """s that a deviation lasts before it counts."""


class TrackingWatch:
    """Compares the arm with what a free one would do: follow the set-points as a first-order lag."""

    def __init__(self, model: ArmModel, settings: WatchSettings, start: FloatArray, period: float) -> None:
        self._model = model
        self._settings = settings
        self._expected = np.array(start, dtype=float)
        self._gain = 1.0 - np.exp(-period / settings.servo_lag)
        self._period = period
        self._off_for = 0.0

    def update(self, set_point: FloatArray, state: ArmState) -> str:
        """What is wrong after this period, as the rest of a sentence about the arm; empty where nothing is."""
        if not state.is_finite():
            return "a servo reads no valid position"
        self._expected += self._gain * (set_point - self._expected)
        behind = np.abs(self._expected - state.joint_positions)
        expected_tcp = self._model.forward(self._expected)[:3, 3]
        off = float(np.linalg.norm(expected_tcp - self._model.forward(state.joint_positions)[:3, 3]))
        deviates = off > self._settings.tcp_deviation or behind.max() > self._settings.joint_deviation
        self._off_for = self._off_for + self._period if deviates else 0.0
        if self._off_for < self._settings.patience:
            return ""
        joint = JOINTS[int(behind.argmax())]
        return f"something is in its way ({1000 * off:.0f} mm off its path, mostly at the {joint} joint)"
