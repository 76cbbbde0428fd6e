"""Antipodal grasps for a parallel gripper that comes from above, sampled on what the cameras saw.

A candidate is a place on the object, a direction in which the fingers close, and how deep the fingertips go. Its
cross-section - what of the object stands between the pads there - decides: it must fit between the fingers, both of
its flanks must face the pads within the friction cone, and nothing (of this object or another) may stand where
fingers, knuckles or palm go. The same test finds a grasp across a carrot and one on the rim of a plate.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..geometry import FloatArray, make_transform, rotation_z, top_down_rotation, wrap_angle
from ..types import BoolArray, GraspPose
from .heightmap import HeightMap
from .segments import Segment


@dataclass(frozen=True)
class GripperShape:
    """The gripper as a grasp sees it; lengths in m. The defaults are the WidowX-250s's (assets/wx250s.xml)."""

    max_opening: float = 0.048
    min_opening: float = 0.004
    tip: float = 0.012
    """From the TCP to the fingertips, along the approach."""
    finger_thickness: float = 0.010
    finger_half_width: float = 0.008
    knuckle_thickness: float = 0.018
    knuckle_half_width: float = 0.0145
    knuckle_height: float = 0.0246
    """From the fingertips to where the fingers get thicker."""
    palm_half_span: float = 0.052
    palm_half_width: float = 0.010
    palm_height: float = 0.0346
    """From the fingertips to the palm."""


@dataclass(frozen=True)
class GraspTuning:
    """How candidates are drawn and judged."""

    centres: int = 40
    yaws: int = 18
    friction: float = 0.6
    """Coefficient of friction counted on: flanks steeper than its cone squeeze out."""
    tip_clearance: float = 0.004
    """m between fingertips and what the object stands on; half of it for flat things."""
    finger_clearance: float = 0.003
    """m that the open fingers keep from the object on either side, at least."""
    spread: float = 0.010
    """m by which the fingers open further than that, where there is room."""
    min_overlap: float = 0.0045
    """m of pad that must reach below the object's top."""
    strip: float = 0.007
    """m, half-width of the strip of the object that counts as between the pads."""
    window: float = 0.045
    """m to either side within which the cross-section is looked for."""
    count: int = 8
    """Grasps kept per object."""


GRIPPER = GripperShape()
TUNING = GraspTuning()


def propose_grasps(
    segment: Segment, grid: HeightMap, gripper: GripperShape = GRIPPER, tuning: GraspTuning = TUNING
) -> tuple[GraspPose, ...]:
    """Grasps on one segment, best first, no two alike; empty where the gripper can't take it."""
    surface = _surface(segment, grid)
    if len(surface) < 4:
        return ()
    centres = _spread_out(surface, tuning.centres)
    candidates = [_at_yaw(yaw, centres, surface, segment, grid, gripper, tuning) for yaw in _yaws(segment, tuning)]
    found = _Candidates.concatenate(candidates)
    return _best(found, segment, gripper, tuning)


@dataclass(frozen=True)
class _Candidates:
    """Grasps as arrays (N, ...): TCP positions, closing directions, openings, scores."""

    tcp: FloatArray
    yaw: FloatArray
    opening: FloatArray
    score: FloatArray

    @staticmethod
    def concatenate(parts: list[_Candidates]) -> _Candidates:
        return _Candidates(
            *(np.concatenate([getattr(part, name) for part in parts]) for name in ("tcp", "yaw", "opening", "score"))
        )


def _surface(segment: Segment, grid: HeightMap) -> FloatArray:
    """(N, 3) the segment's upper surface, one point a cell; every other one of a large object."""
    cells = np.unique(grid.cells(segment.points), axis=0)
    stride = 1 if len(cells) < 900 else 2
    cells = cells[(cells % stride == 0).all(axis=1)]
    heights = grid.height[cells[:, 0], cells[:, 1]]
    keep = heights > segment.support_z + 0.002
    return np.column_stack([grid.positions(cells[:, 0], cells[:, 1]), heights])[keep]


def _spread_out(surface: FloatArray, count: int) -> FloatArray:
    """(<= count, 3) points spread evenly over a surface: each the farthest from those before."""
    chosen = [int(np.argmin(np.linalg.norm(surface[:, :2] - surface[:, :2].mean(axis=0), axis=1)))]
    distance = np.full(len(surface), np.inf)
    while len(chosen) < min(count, len(surface)):
        distance = np.minimum(distance, np.linalg.norm(surface[:, :2] - surface[chosen[-1], :2], axis=1))
        chosen.append(int(distance.argmax()))
    return surface[chosen]


def _yaws(segment: Segment, tuning: GraspTuning) -> FloatArray:
    """Closing directions: evenly spread, beginning with the one straight across the object."""
    # At yaw 0 the closing axis is base +y, which lies across an object whose long side is along base +x.
    return segment.yaw + np.arange(tuning.yaws) * np.pi / tuning.yaws


def _at_yaw(
    yaw: float,
    centres: FloatArray,
    surface: FloatArray,
    segment: Segment,
    grid: HeightMap,
    gripper: GripperShape,
    tuning: GraspTuning,
) -> _Candidates:
    """All candidates with one closing direction."""
    to_gripper = rotation_z(yaw)[:2, :2]  # columns: across the fingers (u), along the closing axis (v)
    du = surface[None, :, 0:2] @ to_gripper[:, 0] - (centres[:, :2] @ to_gripper[:, 0])[:, None]  # (C, N)
    dv = surface[None, :, 0:2] @ to_gripper[:, 1] - (centres[:, :2] @ to_gripper[:, 1])[:, None]
    z = surface[None, :, 2]
    between = (np.abs(du) < tuning.strip) & (np.abs(dv) < tuning.window)
    top = np.max(np.where(between & (np.abs(dv) < tuning.strip), z, -np.inf), axis=1)  # (C,)
    flat = top - segment.support_z < 0.014
    floor = segment.support_z + np.where(flat, tuning.tip_clearance / 2, tuning.tip_clearance)
    parts = []
    # As deep as table and palm allow; and just over the edge, for walls and rims.
    for depth in (gripper.palm_height - 0.003, 0.014):
        tip = np.maximum(floor, top - depth)
        section = between & (z > tip[:, None] + 0.001)
        low, high = _bounds(dv, section)
        closure = _closure(du, dv, section, tuning)
        middle = (low + high) / 2
        width = high - low
        origin = centres[:, :2] + middle[:, None] * to_gripper[:, 1]
        opening = np.minimum(width + 2 * (tuning.finger_clearance + tuning.spread), gripper.max_opening)
        good = np.isfinite(width) & (width + 2 * tuning.finger_clearance <= gripper.max_opening)
        good &= (closure > np.cos(np.arctan(tuning.friction))) & (top - tip >= tuning.min_overlap)
        index = np.flatnonzero(good)
        room = _has_room(origin[index], tip[index], opening[index], to_gripper, grid, gripper)
        index = index[room]
        tcp = np.column_stack([origin[index], tip[index] + gripper.tip])
        score = _score(tcp, width[index], closure[index], (top - tip)[index], segment, gripper)
        parts.append(_Candidates(tcp, np.full(len(index), yaw), opening[index], score))
    return _Candidates.concatenate(parts)


def _bounds(dv: FloatArray, section: BoolArray) -> tuple[FloatArray, FloatArray]:
    """(C,) lowest and highest v of each cross-section; infinite where it is empty."""
    low = np.min(np.where(section, dv, np.inf), axis=1)
    high = np.max(np.where(section, dv, -np.inf), axis=1)
    return np.where(np.isfinite(low), low, np.inf), np.where(np.isfinite(high), high, -np.inf)


def _closure(du: FloatArray, dv: FloatArray, section: BoolArray, tuning: GraspTuning) -> FloatArray:
    """(C,) cosine of the larger angle between a flank's normal and the closing axis, seen from above.

    The flanks' directions come from the cross-section's bounds in the strip's two halves. Zero where a half is empty:
    the fingers would close on a corner.
    """
    with np.errstate(invalid="ignore"):
        low_a, high_a = _bounds(dv, section & (du < 0))
        low_b, high_b = _bounds(dv, section & (du >= 0))
        slope = np.maximum(np.abs(low_a - low_b), np.abs(high_a - high_b)) / tuning.strip
    return np.where(np.isfinite(slope), np.cos(np.arctan(slope)), 0.0)


def _has_room(
    origin: FloatArray,
    tip: FloatArray,
    opening: FloatArray,
    to_gripper: FloatArray,
    grid: HeightMap,
    gripper: GripperShape,
) -> BoolArray:
    """(C,) whether nothing stands where the open fingers, their knuckles and the palm go."""
    free = np.ones(len(origin), bool)
    for thickness, half_width, height in (
        (gripper.finger_thickness, gripper.finger_half_width, 0.0),
        (gripper.knuckle_thickness, gripper.knuckle_half_width, gripper.knuckle_height),
    ):
        v = opening[:, None] / 2 + np.linspace(0.001, thickness, 4)  # (C, 4)
        for side in (-1.0, 1.0):
            free &= _highest(origin, side * v, half_width, to_gripper, grid) < tip + height
    span = np.broadcast_to(np.linspace(-gripper.palm_half_span, gripper.palm_half_span, 12), (len(origin), 12))
    return free & (_highest(origin, span, gripper.palm_half_width, to_gripper, grid) < tip + gripper.palm_height)


def _highest(
    origin: FloatArray, v: FloatArray, half_width: float, to_gripper: FloatArray, grid: HeightMap
) -> NDArray[np.floating]:
    """(C,) the highest cell under a grid of sample points at v (C, K) along the closing axis, across the width."""
    u = np.linspace(-half_width, half_width, 5)
    offsets = v[:, :, None, None] * to_gripper[:, 1] + u[None, None, :, None] * to_gripper[:, 0]  # (C, K, 5, 2)
    cells = grid.cells(origin[:, None, None, :] + offsets)
    return grid.height[cells[..., 0], cells[..., 1]].max(axis=(1, 2), initial=0.0)


def _score(
    tcp: FloatArray,
    width: FloatArray,
    closure: FloatArray,
    overlap: FloatArray,
    segment: Segment,
    gripper: GripperShape,
) -> FloatArray:
    """(C,) in [0, 1]: square to the flanks, deep, near the middle (its weight turns it less), not at full stretch."""
    length = max(float(segment.extent[0]), 0.02)
    off_centre = np.linalg.norm(tcp[:, :2] - segment.centre[:2], axis=1) / (length / 2)
    depth = np.clip(overlap / min(0.02, max(float(segment.extent[2]), 0.005)), 0.0, 1.0)
    stretch = np.clip((gripper.max_opening - width) / 0.012, 0.0, 1.0)
    return closure**2 * (0.4 + 0.6 * depth) * (1.0 - 0.7 * np.clip(off_centre, 0.0, 1.0)) * (0.8 + 0.2 * stretch)


def _best(found: _Candidates, segment: Segment, gripper: GripperShape, tuning: GraspTuning) -> tuple[GraspPose, ...]:
    """The best candidates, none within 12 mm and 25 degrees of a better one."""
    kept: list[int] = []
    for i in np.argsort(-found.score, kind="stable"):
        alike = any(
            np.linalg.norm(found.tcp[i] - found.tcp[k]) < 0.012
            and abs(wrap_angle(found.yaw[i] - found.yaw[k], np.pi)) < np.radians(25)
            for k in kept
        )
        if not alike:
            kept.append(int(i))
        if len(kept) == tuning.count:
            break
    return tuple(
        GraspPose(
            make_transform(top_down_rotation(_upright_yaw(found.yaw[i], found.tcp[i])), found.tcp[i]),
            float(max(found.opening[i], gripper.min_opening)),
            float(found.score[i]),
        )
        for i in kept
    )


def _upright_yaw(yaw: float, tcp: FloatArray) -> float:
    """`yaw` or its opposite, whichever turns the wrist less: the jaws are alike, the wrist's range is not endless."""
    radial = float(np.arctan2(tcp[1], tcp[0]))
    return radial + wrap_angle(yaw - radial, np.pi)
