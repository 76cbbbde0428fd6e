"""Timing: when the joints are where on a path, within velocity, acceleration and jerk limits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from ruckig import InputParameter, Result, Ruckig, Trajectory

from ..errors import MotionRejected
from ..geometry import FloatArray
from .kinematics import ArmModel
from .limits import MotionLimits
from .path import JointPath

SAMPLE_PERIOD = 0.02
"""s between the samples of a trajectory."""

_HEADROOM = 0.98
"""Share of every limit that timing uses, so that interpolation between samples stays under it."""


@dataclass(frozen=True)
class JointTrajectory:
    """Joint positions over time, at rest at both ends."""

    times: FloatArray
    """(N,) s, increasing from 0."""
    positions: FloatArray
    """(N, 6) rad."""
    velocities: FloatArray
    """(N, 6) rad/s."""

    def __post_init__(self) -> None:
        for array in (self.times, self.positions, self.velocities):
            array.setflags(write=False)  # what the gate has seen stays as it was

    @property
    def duration(self) -> float:
        """Seconds from the first to the last sample."""
        return float(self.times[-1])

    @property
    def start(self) -> FloatArray:
        """(6,) rad."""
        return self.positions[0]

    @property
    def goal(self) -> FloatArray:
        """(6,) rad."""
        return self.positions[-1]

    def sample(self, t: float) -> FloatArray:
        """The (6,) set-point at time `t` (s); the first before the start, the last after the end.

        Cubic Hermite interpolation between samples, so that velocity is continuous.
        """
        if t <= 0.0 or len(self.times) == 1:
            return self.positions[0]
        if t >= self.times[-1]:
            return self.positions[-1]
        after = int(np.searchsorted(self.times, t, side="right"))
        before = after - 1
        h = self.times[after] - self.times[before]
        u = (t - self.times[before]) / h
        return (
            (1 + 2 * u) * (1 - u) ** 2 * self.positions[before]
            + u * (1 - u) ** 2 * h * self.velocities[before]
            + u**2 * (3 - 2 * u) * self.positions[after]
            + u**2 * (u - 1) * h * self.velocities[after]
        )


def time_path(path: JointPath, model: ArmModel, limits: MotionLimits, tcp_speed: float = np.inf) -> JointTrajectory:
    """The fastest rest-to-rest motion along a path whose path speed has constant limits.

    The limits of joints and TCP become limits on s: with q(s), joint velocity is q' s', joint acceleration is
    q'' s'^2 + q' s''. Half the acceleration is left to each of the two terms. ruckig (Berscheid & Kröger 2021)
    then gives the time-optimal jerk-limited s(t). `tcp_speed` (m/s) slows the TCP down further.
    """
    s = np.linspace(0.0, 1.0, 25)
    q, dq, ddq = path.at(s), path.at(s, 1), path.at(s, 2)
    if np.abs(np.diff(path.positions, axis=0)).max() < 1e-9:
        return JointTrajectory(np.zeros(1), path.positions[:1].copy(), np.zeros((1, path.positions.shape[1])))
    tcp_rate = max(float(np.linalg.norm((model.jacobian(qi) @ dqi)[:3])) for qi, dqi in zip(q, dq, strict=True))
    joint_rate = float((np.abs(dq) / (limits.joint_speed_share * model.velocity_limit)).max())
    bend, slope = float(np.abs(ddq).max()), float(np.abs(dq).max())
    speed = min(min(tcp_speed, limits.tcp_speed) / max(tcp_rate, 1e-9), 1.0 / joint_rate)
    if bend > 1e-9:
        speed = min(speed, float(np.sqrt(0.5 * limits.joint_acceleration / bend)))
    share = 0.5 if bend * speed**2 > 0.05 * limits.joint_acceleration else 0.95
    acceleration = share * limits.joint_acceleration / slope
    times, along, rate = _along(_HEADROOM * speed, acceleration, limits.joint_jerk / slope)
    return JointTrajectory(times, path.at(along), path.at(along, 1) * rate[:, None])


def chain(trajectories: Sequence[JointTrajectory]) -> JointTrajectory:
    """Trajectories one after the other, with a rest in between; each must start where the one before ends."""
    times, end = [], 0.0
    for trajectory in trajectories:
        times.append(trajectory.times + end)
        end += trajectory.duration + SAMPLE_PERIOD
    return JointTrajectory(
        np.concatenate(times),
        np.concatenate([t.positions for t in trajectories]),
        np.concatenate([t.velocities for t in trajectories]),
    )


def _along(speed: float, acceleration: float, jerk: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Sample times (N,), s (N,) and s' (N,) of the jerk-limited motion of s from 0 to 1."""
    profile, request = Trajectory(1), InputParameter(1)
    request.current_position, request.target_position = [0.0], [1.0]
    request.max_velocity, request.max_acceleration, request.max_jerk = [speed], [acceleration], [jerk]
    if Ruckig(1).calculate(request, profile) != Result.Working:
        raise MotionRejected("The path can't be timed within the motion limits.")
    times = np.append(np.arange(0.0, profile.duration, SAMPLE_PERIOD), profile.duration)
    states = np.array([profile.at_time(t)[:2] for t in times]).reshape(len(times), 2)
    return times, np.clip(states[:, 0], 0.0, 1.0), states[:, 1]
