"""From calibrated RGB-D images to points in the base frame that belong to things on the table."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ..errors import CameraFailure
from ..geometry import transform_points
from ..types import BoolArray, CameraFrame, Observation, RobotState

RobotFilter = Callable[[NDArray[np.float32], RobotState], BoolArray]
"""Which of these points (N, 3), base frame, lie on the robot itself: (N,) bool."""


@dataclass(frozen=True)
class Workspace:
    """The part of the table that is looked at, base frame, m."""

    x: tuple[float, float] = (0.02, 0.53)
    y: tuple[float, float] = (-0.37, 0.37)
    z: tuple[float, float] = (-0.03, 0.30)


@dataclass(frozen=True)
class Tuning:
    """Thresholds of the foreground, stated for a D435-class camera about 0.8 m away."""

    height: float = 0.008
    """m above the table plane from which a point belongs to a thing, whatever its colour."""
    foot: float | None = None
    """m from which a point belongs to the thing it is connected to in the image; None: from `height`. Only exact depth
    allows for one; then a gap between two points is no noise either."""
    chroma: float = 11.0
    """Distance in the a, b plane of CIE Lab from the table's colour that makes a thing, however flat."""
    bleeding: float = 0.4
    """What has less than this share of the colour next to it has it from there."""
    brighter: float = 40.0
    darker: float = 0.35
    """A thing of the table's hue is that much lighter (8-bit L), or darker than this share: a shadow is not so dark."""
    plane_band: float = 0.015
    """m around z = 0 in which the table plane is sought: the calibration may be off by that much."""
    min_seen: float = 0.25
    """Share of the workspace's pixels that must have depth for a view to be of use."""


@dataclass(frozen=True)
class ViewPoints:
    """The foreground of one view."""

    name: str
    shape: tuple[int, int]
    pixels: NDArray[np.intp]
    """(N,) flat pixel indices."""
    points: NDArray[np.float32]
    """(N, 3) m, base frame, z above the table plane."""
    colours: NDArray[np.uint8]
    """(N, 3) RGB."""
    bare: NDArray[np.float32]
    """(M, 2) m, base frame: where the bare table is seen, a sample of every other pixel."""


def foreground(
    observation: Observation, covers_robot: RobotFilter, workspace: Workspace, tuning: Tuning
) -> tuple[ViewPoints, ...]:
    """What stands on the table, view by view.

    A view without depth on enough of the table is left out; the main view may not be.

    Raises
    ------
    CameraFailure
        Where the main view is blocked, has no depth, or shows no table.

    """
    views = []
    for name, frame in observation.frames.items():
        try:
            views.append(_view_foreground(frame, observation.robot, covers_robot, workspace, tuning))
        except CameraFailure:
            if name == observation.main:
                raise
    return tuple(views)


def _view_foreground(
    frame: CameraFrame, robot: RobotState, covers_robot: RobotFilter, workspace: Workspace, tuning: Tuning
) -> ViewPoints:
    # The median takes out most of the depth noise and keeps edges; it can't handle NaN, zero stands for it.
    known = np.isfinite(frame.depth) & (frame.depth > 0)
    depth = np.asarray(cv2.medianBlur(np.where(known, frame.depth, np.float32(0)), 5), np.float32)
    x, y, z = _base_coordinates(frame, np.where(known & (depth > 0), depth, np.float32(np.nan)))
    inside = _within(x, workspace.x) & _within(y, workspace.y) & _within(z, workspace.z)
    _check_view(frame, inside, workspace, tuning)
    coarse = (slice(None, None, 6), slice(None, None, 6))  # a plane needs no more
    chosen = inside[coarse]
    a, b, c = _fit_table(frame.name, np.stack([x[coarse][chosen], y[coarse][chosen], z[coarse][chosen]], -1), tuning)
    height = z - (a * x + b * y + c)
    coloured = _off_colour(frame.rgb, inside & (np.abs(height) < 0.004), tuning)
    things = inside & ((height > tuning.height) | (coloured & (height > -tuning.height)))
    if tuning.foot is not None:
        things = _connected(things, inside & (height > tuning.foot))
    pixels = np.flatnonzero(things)
    points = np.stack([x.ravel()[pixels], y.ravel()[pixels], height.ravel()[pixels]], axis=-1)
    sample = (slice(None, None, 2), slice(None, None, 2))
    on_table = inside[sample] & ~things[sample] & (np.abs(height[sample]) <= tuning.height)
    bare = np.stack([x[sample][on_table], y[sample][on_table]], axis=-1)
    keep = ~covers_robot(points, robot)
    colours = frame.rgb.reshape(-1, 3)[pixels[keep]]
    return ViewPoints(frame.name, frame.depth.shape, pixels[keep], points[keep], colours, bare)


def _base_coordinates(frame: CameraFrame, depth: NDArray[np.float32]) -> NDArray[np.float32]:
    """(3, H, W) m: x, y and z in the base frame of every pixel, NaN where the depth (H, W) is.

    One plane a coordinate, not one triple a pixel: everything that follows is faster on them.
    """
    height, width = depth.shape
    u = (np.arange(width) - frame.K[0, 2]) / frame.K[0, 0]
    v = (np.arange(height) - frame.K[1, 2]) / frame.K[1, 1]
    right, down, forward, origin = frame.T_base_camera[:3, :, None, None].astype(np.float32).swapaxes(0, 1)
    rays = right * u.astype(np.float32) + (down * v.astype(np.float32)[:, None] + forward)
    return rays * depth + origin


def _connected(sure: BoolArray, possible: BoolArray) -> BoolArray:
    """What is sure (H, W), and what is possible and connected to it by more than a line of pixels."""
    broad = cv2.morphologyEx((possible & ~sure).astype(np.uint8), cv2.MORPH_OPEN, np.ones((2, 2), np.uint8)) > 0
    _, islands = cv2.connectedComponents((sure | broad).astype(np.uint8), connectivity=8)
    kept = np.zeros(int(islands.max()) + 1, bool)
    kept[np.unique(islands[sure])] = True
    kept[0] = False
    return np.asarray(kept[islands])


def _within(values: NDArray[np.float32], bounds: tuple[float, float]) -> BoolArray:
    return (values > bounds[0]) & (values < bounds[1])


def _off_colour(rgb: NDArray[np.uint8], on_plane: BoolArray, tuning: Tuning) -> BoolArray:
    """Where an image (H, W, 3) has another colour than the table, lit or in shadow: (H, W).

    Judged at half the resolution, which also averages the noise out: cloths are large.
    """
    height, width = on_plane.shape
    half = cv2.resize(rgb, (width // 2, height // 2), interpolation=cv2.INTER_AREA)
    lab = cv2.cvtColor(half, cv2.COLOR_RGB2LAB).astype(np.float32)
    sample = on_plane[: height // 2 * 2 : 8, : width // 2 * 2 : 8]
    table = np.median(lab[::4, ::4][sample], axis=0)
    lightness = lab[..., 0]
    # In shadow a surface loses chroma along with lightness (128 is grey in 8-bit Lab).
    shade = np.minimum(lightness / max(table[0], 1.0), np.float32(1.2))[..., None]
    off_hue = lab[..., 1:] - np.float32(128) - (table[1:] - np.float32(128)) * shade
    strength = np.linalg.norm(off_hue, axis=-1)
    # Lens and averaging let strong colours bleed into the pixels around them, fainter than they are.
    bled = strength < tuning.bleeding * np.asarray(cv2.dilate(strength, np.ones((3, 3), np.uint8)))
    other_hue = (strength > tuning.chroma) & ~bled
    differs = other_hue | (lightness > table[0] + tuning.brighter) | (lightness < table[0] * tuning.darker)
    return cv2.resize(differs.astype(np.uint8), (width, height), interpolation=cv2.INTER_NEAREST) > 0


def _check_view(frame: CameraFrame, inside: BoolArray, workspace: Workspace, tuning: Tuning) -> None:
    """Raise CameraFailure unless enough of the part of the image that shows the workspace has depth."""
    corners = np.array([[x, y, 0.0] for x in workspace.x for y in workspace.y])
    in_camera = transform_points(frame.T_camera_base, corners)
    if (in_camera[:, 2] <= 0.05).any():
        raise CameraFailure(f"The {frame.name} camera's calibration puts the table behind it.")
    uv = in_camera[:, :2] / in_camera[:, 2:] * [frame.K[0, 0], frame.K[1, 1]] + frame.K[:2, 2]
    outline = cv2.convexHull(uv.astype(np.float32)).astype(np.int32)
    expected = np.zeros(frame.depth.shape, np.uint8)
    cv2.fillConvexPoly(expected, outline, 1)
    total = int(expected.sum())
    seen = float((inside & (expected > 0)).sum()) / max(total, 1)
    if seen < tuning.min_seen:
        raise CameraFailure(
            f"The {frame.name} camera has depth on only {seen:.0%} of the table: it is blocked, off, or has moved."
        )


def _fit_table(name: str, points: NDArray[np.float32], tuning: Tuning) -> NDArray[np.float32]:
    """Coefficients (a, b, c) of the table plane z = a x + b y + c, by least squares with shrinking tolerance."""
    plane = np.zeros(3)
    A = np.column_stack([points[:, :2], np.ones(len(points))]).astype(np.float64)
    for tolerance in (tuning.plane_band, tuning.plane_band / 2, 0.005):
        near = np.abs(points[:, 2] - A @ plane) < tolerance
        if near.sum() < 100:
            raise CameraFailure(f"The {name} camera sees no table at the height the calibration says.")
        plane, *_ = np.linalg.lstsq(A[near], points[near, 2].astype(np.float64), rcond=None)
    return plane.astype(np.float32)
