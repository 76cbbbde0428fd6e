"""From what we record to what the Bridge data and Open X-Embodiment call a state and an action.

Pose: position of the TCP in the base frame (m), then roll, pitch, yaw (rad) of its rotation away from pointing
straight down, about the base's fixed axes x, y, z: R_base_tcp = Rz(yaw) Ry(pitch) Rx(roll) TOP_DOWN. Bridge measures
from the same pose (`default_rot` of its WidowX controller): a gripper that points down has roll and pitch 0.

Action: how far the commanded pose moves until the next step, translation and roll, pitch, yaw of the turn, both along
the base's axes: R_next = Rz(yaw) Ry(pitch) Rx(roll) R. From the first measured pose on, they add up to the commanded
path.

Gripper: 1 open, 0 closed. A state is how far the fingers are open, an action is what they are told, one or the other.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ...geometry import FloatArray, top_down_rotation

_TOP_DOWN = Rotation.from_matrix(top_down_rotation(0.0))
_FIXED_AXES: Literal["xyz"] = "xyz"  # lower case: scipy's word for axes that don't turn along
_AT_END = 0.05
"""Share of the fingers' way within which they count as closed."""
_STILL = 0.01
"""Share of the fingers' way by which a target may differ from the one before and stand still."""


@dataclass(frozen=True)
class Fingers:
    """How far a gripper's fingers are apart, m."""

    closed: float
    open: float

    def openness(self, opening: FloatArray) -> FloatArray:
        """From 0 (closed) to 1 (open), of openings in m."""
        return np.clip((opening - self.closed) / (self.open - self.closed), 0.0, 1.0)


@dataclass(frozen=True)
class Moves:
    """The numbers of an episode as an RLDS dataset has them, T rows of float32."""

    state: NDArray[np.float32]
    """(T, 7) measured: x, y, z, roll, pitch, yaw, openness of the gripper."""
    joint_state: NDArray[np.float32]
    """(T, J) measured, rad."""
    action: NDArray[np.float32]
    """(T, 7): translation, roll, pitch, yaw of the turn, gripper."""


def to_moves(state: FloatArray, ee_pose: FloatArray, ee_delta: FloatArray, fingers: Fingers, every: int = 1) -> Moves:
    """Convert an episode of a LeRobot dataset of ours, and keep every so-many-th row.

    `state` (N, J + 1) joints and opening, `ee_pose` (N, 7) x, y, z, quaternion x, y, z, w, `ee_delta` (N, 7) as
    docs/data.md has them. An action of a row that is kept leads as far as the rows' actions up to the next one.
    """
    rows = np.arange(0, len(state), every)
    ends = np.append(rows[1:], len(state))
    positions, turns = commanded_path(ee_pose[0], ee_delta[:, :6])
    bounds = np.append(rows, len(state))
    gripper = gripper_commands(ee_delta[:, 6], fingers)[ends - 1]
    action = [np.diff(positions[bounds], axis=0), _rpy(turns[bounds[1:]] * turns[bounds[:-1]].inv()), gripper[:, None]]
    measured = [to_rpy_poses(ee_pose[rows]), fingers.openness(state[rows, -1:])]
    return Moves(
        np.hstack(measured).astype(np.float32),
        state[rows, :-1].astype(np.float32),
        np.hstack(action).astype(np.float32),
    )


def commanded_path(first: FloatArray, deltas: FloatArray) -> tuple[FloatArray, Rotation]:
    """(N + 1, 3) positions and N + 1 rotations R_base_tcp: the first pose (7,), then where each delta (N, 6) leads.

    A delta is a translation and a rotation vector, both along the base's axes.
    """
    positions = first[:3] + np.vstack([np.zeros(3), np.cumsum(deltas[:, :3], axis=0, dtype=float)])
    rotations = [Rotation.from_quat(first[3:])]
    for turn in Rotation.from_rotvec(deltas[:, 3:]):
        rotations.append(turn * rotations[-1])
    return positions, Rotation.concatenate(rotations)


def to_rpy_poses(ee_pose: FloatArray) -> FloatArray:
    """(N, 6) x, y, z, roll, pitch, yaw of (N, 7) poses x, y, z, quaternion x, y, z, w."""
    return np.hstack([ee_pose[:, :3], _rpy(Rotation.from_quat(ee_pose[:, 3:]) * _TOP_DOWN.inv())])


def gripper_commands(targets: FloatArray, fingers: Fingers) -> FloatArray:
    """(N,) 1 open or 0 closed, of the fingers' targets (N,) in m.

    A target that stands still is closed where the fingers can't close further, and open anywhere else: a gripper that
    opens just wide enough for a grasp is open. One on its way counts as where it leads, as OpenVLA has it for Bridge.
    """
    share = fingers.openness(targets)
    closed = share <= _AT_END
    moving = np.append(False, np.abs(np.diff(share)) > _STILL) & ~closed
    moving[-1] = False  # what comes after isn't known
    settled = np.where(moving, len(share), np.arange(len(share)))
    arrives = np.minimum.accumulate(settled[::-1])[::-1]  # the next row, from each on, at which the target stands still
    return np.where(closed[arrives], 0.0, 1.0)


def _rpy(rotations: Rotation) -> FloatArray:
    angles: FloatArray = rotations.as_euler(_FIXED_AXES)
    return angles
