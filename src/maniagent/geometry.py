"""Rigid transforms and the pinhole camera.

A transform `T_a_b` is a (4, 4) float64 matrix that takes points expressed in frame b to frame a. Quaternions,
where they must appear (MuJoCo), are (w, x, y, z). Pixels are (u, v) = (column, row), pixel centres at integers.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.floating[Any]]


def make_transform(rotation: ArrayLike, translation: ArrayLike) -> FloatArray:
    """The (4, 4) transform with this (3, 3) rotation and (3,) translation."""
    T = np.eye(4)
    T[:3, :3] = rotation
    T[:3, 3] = translation
    return T


def invert_transform(T: FloatArray) -> FloatArray:
    """T_b_a from T_a_b, using that the rotation is orthonormal."""
    R_inv = T[:3, :3].T
    return make_transform(R_inv, -R_inv @ T[:3, 3])


def transform_points(T_a_b: FloatArray, points_b: FloatArray) -> FloatArray:
    """Points (..., 3) in frame b, expressed in frame a."""
    return points_b @ T_a_b[:3, :3].T + T_a_b[:3, 3]


def rotation_z(yaw: float) -> FloatArray:
    """The (3, 3) rotation by `yaw` (rad) about +z."""
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def top_down_rotation(yaw: float) -> FloatArray:
    """R_base_tcp of a gripper that points straight down, (3, 3).

    TCP axes: x is the approach direction (out of the fingers), y the closing axis. At yaw 0 the closing axis is
    base +y; a positive yaw (rad) turns it counter-clockwise seen from above. yaw and yaw + pi grasp alike.
    """
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[0.0, -s, c], [0.0, c, s], [-1.0, 0.0, 0.0]])


def yaw_of_top_down(R_base_tcp: FloatArray) -> float:
    """The yaw (rad, in (-pi, pi]) of the closing axis seen from above; inverse of `top_down_rotation`."""
    return float(np.arctan2(-R_base_tcp[0, 1], R_base_tcp[1, 1]))


def wrap_angle(angle: float, period: float = 2 * np.pi) -> float:
    """`angle` (rad) shifted by whole periods into (-period/2, period/2]."""
    wrapped = np.mod(angle, period)
    return float(wrapped - period if wrapped > period / 2 else wrapped)


def rotation_angle(R: FloatArray) -> float:
    """The angle (rad, in [0, pi]) by which a (3, 3) rotation turns; exact also for tiny angles."""
    sin = 0.5 * np.linalg.norm([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    return float(np.arctan2(sin, 0.5 * (np.trace(R) - 1.0)))


def look_at(eye: ArrayLike, target: ArrayLike) -> FloatArray:
    """T_base_camera of a camera at `eye` that looks at `target`, upright (base z points up in the image).

    OpenCV camera axes: x right, y down, z forward. Raises ValueError where the view is vertical, because then
    "upright" means nothing, and where the target is the eye itself.
    """
    eye, target = np.asarray(eye, float), np.asarray(target, float)
    forward = target - eye
    right = np.cross(forward, [0.0, 0.0, 1.0])
    if np.linalg.norm(right) <= 1e-9 * np.linalg.norm(forward):
        raise ValueError("look_at needs a direction that is not vertical")
    forward /= np.linalg.norm(forward)
    right /= np.linalg.norm(right)
    down = np.cross(forward, right)
    return make_transform(np.stack([right, down, forward], axis=1), eye)


def project(K: FloatArray, points_camera: FloatArray) -> FloatArray:
    """Pixels (..., 2) of points (..., 3) in the camera frame; behind the camera the result is meaningless."""
    z = points_camera[..., 2:3]
    return points_camera[..., :2] / z * np.array([K[0, 0], K[1, 1]]) + np.array([K[0, 2], K[1, 2]])


def backproject(K: FloatArray, depth: FloatArray) -> FloatArray:
    """Points (H, W, 3) in the camera frame of a z-depth image (H, W) in metres; NaN where depth is NaN."""
    height, width = depth.shape
    u = (np.arange(width, dtype=np.float32) - np.float32(K[0, 2])) / np.float32(K[0, 0])
    v = (np.arange(height, dtype=np.float32) - np.float32(K[1, 2])) / np.float32(K[1, 1])
    points = np.empty((height, width, 3), dtype=np.float32)
    points[..., 0] = u[None, :] * depth
    points[..., 1] = v[:, None] * depth
    points[..., 2] = depth
    return points
