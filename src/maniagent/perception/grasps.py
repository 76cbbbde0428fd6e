"""Antipodal grasps for a parallel gripper that comes from above, sampled on what the cameras saw.

A candidate is a place on the object, a direction in which the fingers close, and how deep the fingertips go. Its
cross-section - what of the object stands between the pads there - decides: it must fit between the fingers, both of
its flanks must face the pads within the friction cone, and nothing (of this object or another) may stand where
fingers, knuckles or palm go. The same test finds a grasp across a carrot and one on the rim of a plate.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..geometry import FloatArray, make_transform, top_down_rotation, wrap_angle
from ..types import BoolArray, GraspPose
from .heightmap import HeightMap
from .segments import Segment

LARGE = 2000
"""Cells of an upper surface from which on every other row and column is enough."""


@dataclass(frozen=True)
class GripperShape:
    """The gripper as a grasp sees it; lengths in m. The defaults are the WidowX-250s's (assets/wx250s.xml)."""

    max_opening: float = 0.048
    min_opening: float = 0.004
    """To which the fingers open at least: `max_opening` where they are open or closed and nothing between."""
    closed_gap: float = 0.0
    """Between the pads of the closed fingers."""
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

    centres: int = 36
    yaws: int = 12
    friction: float = 0.6
    """Coefficient of friction counted on: flanks steeper than its cone squeeze out."""
    tip_clearance: float = 0.004
    """m between fingertips and what the object stands on; half of it for flat things."""
    finger_clearance: float = 0.003
    """m that the open fingers keep from the object on either side, at least."""
    spread: float = 0.010
    """m by which the fingers open further than that, where there is room."""
    firm: float = 0.0
    """m of width beyond the closed fingers' gap at which the grip is firm: springy fingers press the harder, the
    further they are held apart."""
    min_overlap: float = 0.0045
    """m of pad that must reach below the object's top."""
    strip: float = 0.007
    """m, half-width of the strip of the object that counts as between the pads."""
    window: float = 0.045
    """m to either side within which the cross-section is looked for."""
    count: int = 8
    """Grasps kept per object."""


STRETCH = 0.025
"""m around a grasp over which the direction of what is grasped is measured."""
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
    found = _sections(centres, surface, segment, gripper, tuning)
    found = found.take(_closes(found, gripper, tuning))
    roomy = _with_room(found, grid, gripper, tuning)
    if not _below_middle(roomy, segment).any():  # beside a wall one finger goes close by and pushes it to the other
        aside = _with_room(_moved_aside(found, grid, gripper, tuning), grid, gripper, tuning)
        roomy = _Candidates.concatenate([roomy, aside])
    return _best(roomy, surface, segment, gripper, tuning)


@dataclass(frozen=True)
class _Candidates:
    """Candidates as arrays (N, ...)."""

    origin: FloatArray
    """(N, 2) m, base frame: the middle of the cross-section."""
    tip: FloatArray
    """(N,) m, height of the fingertips."""
    yaw: FloatArray
    """(N,) rad."""
    width: FloatArray
    """(N,) m, of the cross-section along the closing axis; not finite where there is none."""
    slope: FloatArray
    """(N,) tangent of the larger angle between a flank's normal and the closing axis, seen from above."""
    overlap: FloatArray
    """(N,) m, from the fingertips up to the object's top."""

    def take(self, index: NDArray[np.intp] | BoolArray) -> _Candidates:
        """Some of them."""
        return _Candidates(*(array[index] for array in vars(self).values()))

    @staticmethod
    def concatenate(parts: Sequence[_Candidates]) -> _Candidates:
        """All of several."""
        return _Candidates(*(np.concatenate(arrays) for arrays in zip(*(vars(p).values() for p in parts), strict=True)))

    @property
    def axes(self) -> tuple[FloatArray, FloatArray]:
        """(N, 2) unit vectors each: across the fingers (u), along the closing axis (v)."""
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        return np.stack([c, s], axis=-1), np.stack([-s, c], axis=-1)

    def opening(self, gripper: GripperShape, tuning: GraspTuning) -> FloatArray:
        """(N,) m, how far the fingers are opened on the way down."""
        wanted = self.width + 2 * (tuning.finger_clearance + tuning.spread)
        return np.clip(wanted, gripper.min_opening, gripper.max_opening)


def _surface(segment: Segment, grid: HeightMap) -> FloatArray:
    """(N, 3) the segment's upper surface, one point a cell; every other one of a large object."""
    seen = np.zeros(grid.height.shape, bool)
    seen[tuple(grid.cells(segment.points).T)] = True
    rows, columns = np.nonzero(seen)
    if len(rows) >= LARGE:
        coarse = (rows % 2 == 0) & (columns % 2 == 0)
        rows, columns = rows[coarse], columns[coarse]
    heights = grid.height[rows, columns]
    keep = heights > segment.support_z + 0.002
    return np.column_stack([grid.positions(rows, columns), heights])[keep]


def _spread_out(surface: FloatArray, count: int) -> FloatArray:
    """(<= count, 3) points spread evenly over a surface: each the farthest from those before."""
    xy = surface[:, :2]
    distance = np.linalg.norm(xy - xy.mean(axis=0), axis=1)
    chosen = [int(distance.argmin())]
    distance = np.full(len(surface), np.inf)
    while len(chosen) < min(count, len(surface)):
        offset = xy - xy[chosen[-1]]
        distance = np.minimum(distance, np.einsum("ij,ij->i", offset, offset))
        chosen.append(int(distance.argmax()))
    return surface[chosen]


def _sections(
    centres: FloatArray, surface: FloatArray, segment: Segment, gripper: GripperShape, tuning: GraspTuning
) -> _Candidates:
    """The cross-sections at every centre for every closing direction, at one or two depths each."""
    # At yaw 0 the closing axis is base +y, which lies across an object whose long side is along base +x.
    yaws = segment.yaw + np.arange(tuning.yaws) * np.pi / tuning.yaws
    owner, du, dv, z = _strips(yaws, centres, surface, tuning)
    yaw, middle = np.repeat(yaws, len(centres)), np.tile(centres[:, :2], (len(yaws), 1))
    top = _largest(z, owner, len(yaw), np.abs(dv) < tuning.strip)
    clearance = np.where(top - segment.support_z < 0.014, tuning.tip_clearance / 2, tuning.tip_clearance)
    deep = np.maximum(segment.support_z + clearance, top - gripper.palm_height + 0.003)
    # As deep as table and palm allow; and, for walls and rims, just over the edge.
    shallow = np.maximum(deep, top - 0.014)
    parts = []
    for tip in [deep] if (shallow - deep).max() < 0.0015 else [deep, shallow]:
        low, high, slope = _flanks(du, dv, owner, len(yaw), z > tip[owner] + 0.001, tuning)
        with np.errstate(invalid="ignore"):
            off = ((low + high) / 2)[:, None] * np.stack([-np.sin(yaw), np.cos(yaw)], axis=-1)
        parts.append(_Candidates(middle + off, tip, yaw, high - low, slope, top - tip))
    return _Candidates.concatenate(parts)


def _strips(
    yaws: FloatArray, centres: FloatArray, surface: FloatArray, tuning: GraspTuning
) -> tuple[NDArray[np.intp], FloatArray, FloatArray, FloatArray]:
    """What of the surface lies between the pads: a pair (section, point) an entry.

    Returns (P,) each: the section, numbered closing direction by closing direction, and the point's offset from the
    section's centre across the fingers (u) and along the closing axis (v), and its height, m.
    """
    c, s = np.cos(yaws).astype(np.float32), np.sin(yaws).astype(np.float32)
    xy, middles = surface[:, :2].T.astype(np.float32), centres[:, :2].T.astype(np.float32)

    def offsets(axes: NDArray[np.float32]) -> NDArray[np.float32]:
        """(yaws, centres, points)."""
        return (axes @ xy)[:, None, :] - (axes @ middles)[:, :, None]

    du, dv = offsets(np.stack([c, s], axis=-1)), offsets(np.stack([-s, c], axis=-1))
    between = (np.abs(du) < tuning.strip) & (np.abs(dv) < tuning.window)
    section, point = np.nonzero(between.reshape(-1, len(surface)))
    return section, du[between], dv[between], surface[point, 2]


def _flanks(
    du: FloatArray, dv: FloatArray, owner: NDArray[np.intp], count: int, inside: BoolArray, tuning: GraspTuning
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Lowest and highest v of each cross-section, and the slope of its flanks, from the strip's two halves.

    Nothing is finite where a half is empty: the fingers would close on a corner.
    """
    first, second = inside & (du < 0), inside & (du >= 0)
    low_a, high_a = -_largest(-dv, owner, count, first), _largest(dv, owner, count, first)
    low_b, high_b = -_largest(-dv, owner, count, second), _largest(dv, owner, count, second)
    with np.errstate(invalid="ignore"):
        slope = np.maximum(np.abs(low_a - low_b), np.abs(high_a - high_b)) / tuning.strip
    return np.minimum(low_a, low_b), np.maximum(high_a, high_b), slope


def _largest(values: FloatArray, owner: NDArray[np.intp], count: int, where: BoolArray) -> FloatArray:
    """(count,) the largest value of each owner (ascending) where asked for; minus infinity where it has none."""
    bounds = np.searchsorted(owner, np.arange(count + 1))
    some = bounds[1:] > bounds[:-1]
    out = np.full(count, -np.inf)
    out[some] = np.maximum.reduceat(np.where(where, values, -np.inf), bounds[:-1][some])
    return out


def _closes(found: _Candidates, gripper: GripperShape, tuning: GraspTuning) -> BoolArray:
    """(N,) whether the cross-section fits between the pads, squarely and deep enough."""
    with np.errstate(invalid="ignore"):
        fits = found.width + 2 * tuning.finger_clearance <= gripper.max_opening
        return (
            fits
            & (found.width > gripper.closed_gap)
            & (found.slope < tuning.friction)
            & (found.overlap >= tuning.min_overlap)
        )


def _with_room(found: _Candidates, grid: HeightMap, gripper: GripperShape, tuning: GraspTuning) -> _Candidates:
    """Those for which nothing stands where the open fingers, their knuckles and the palm go."""
    for thickness, half_width, height in (
        (gripper.finger_thickness, gripper.finger_half_width, 0.0),
        (gripper.knuckle_thickness, gripper.knuckle_half_width, gripper.knuckle_height),
    ):
        v = found.opening(gripper, tuning)[:, None] / 2 + np.linspace(0.001, thickness, 4)
        both = np.concatenate([-v, v], axis=1)
        found = found.take(_highest(found, both, half_width, grid) < found.tip + height)
    span = np.linspace(-gripper.palm_half_span, gripper.palm_half_span, 12)
    palm = np.broadcast_to(span, (len(found.tip), len(span)))
    return found.take(_highest(found, palm, gripper.palm_half_width, grid) < found.tip + gripper.palm_height)


def _moved_aside(found: _Candidates, grid: HeightMap, gripper: GripperShape, tuning: GraspTuning) -> _Candidates:
    """The same with the hand to either side until one open finger just passes the object, and nothing between."""
    opening = found.opening(gripper, tuning)
    slack = np.maximum((opening - found.width - tuning.finger_clearance) / 2, 0.0)
    parts = []
    for side in (1.0, -1.0):
        gap = side * np.linspace(found.width / 2 + tuning.finger_clearance, opening / 2 + slack, 5, axis=-1)
        free = _highest(found, gap, gripper.finger_half_width, grid) < found.tip
        moved = replace(found, origin=found.origin + side * slack[:, None] * found.axes[1])
        parts.append(moved.take(free))
    return _Candidates.concatenate(parts)


def _highest(found: _Candidates, v: FloatArray, half_width: float, grid: HeightMap) -> NDArray[np.floating]:
    """(N,) the highest cell under sample points at v (N, K) along the closing axis, across the width."""
    across, along = found.axes
    u = np.linspace(-half_width, half_width, 5)
    offsets = v[:, :, None, None] * along[:, None, None, :] + u[:, None] * across[:, None, None, :]  # (N, K, 5, 2)
    cells = grid.cells(found.origin[:, None, None, :] + offsets)
    return grid.height[cells[..., 0], cells[..., 1]].max(axis=(1, 2), initial=0.0)


def _below_middle(found: _Candidates, segment: Segment) -> BoolArray:
    """(N,) whether the fingertips reach below half the object's height."""
    return found.tip < segment.support_z + segment.extent[2] / 2


def _squareness(found: _Candidates, surface: FloatArray) -> FloatArray:
    """(N,) in [0, 1]: how well the fingers close across what runs through the grasp: a wall, a rim, a handle.

    Cells are too coarse to tell a flank's direction within a pad's width. Over a longer stretch the principal axes of
    what is as high as the fingertips do; the longer they are than wide, the more they count. A rim that is taken at an
    angle turns the whole plate when the fingers close.
    """
    middle = surface[:, :2].mean(axis=0)
    (x, y), at = (surface[:, :2] - middle).T, found.origin - middle
    near = (x - at[:, :1]) ** 2 + (y - at[:, 1:]) ** 2 < STRETCH**2  # (N, M)
    near &= surface[:, 2] > found.tip[:, None] + 0.001
    moments = near @ np.column_stack([np.ones_like(x), x, y, x * x, x * y, y * y]).astype(np.float32)
    mx, my, xx, xy, yy = (moments[:, 1:] / np.maximum(moments[:, :1], 1.0)).T
    xx, xy, yy = xx - mx * mx, xy - mx * my, yy - my * my
    # Half the difference of the principal variances, and how much of it lies along the closing axis.
    difference = np.hypot((xx - yy) / 2, xy)
    turned = (xx - yy) / 2 * np.cos(2 * found.yaw) + xy * np.sin(2 * found.yaw)
    return 1.0 - (difference - turned) / np.maximum((xx + yy) / 2 + difference, 1e-9)


def _scores(
    found: _Candidates, surface: FloatArray, segment: Segment, gripper: GripperShape, tuning: GraspTuning
) -> FloatArray:
    """(N,) in [0, 1]: square to the flanks, deep, near the middle (its weight turns it less), firm, not at
    full stretch.
    """
    length = max(float(segment.extent[0]), 0.02)
    off_centre = np.linalg.norm(found.origin - segment.centre[:2], axis=1) / (length / 2)
    depth = np.clip(found.overlap / min(0.02, max(float(segment.extent[2]), 0.005)), 0.0, 1.0)
    stretch = np.clip((gripper.max_opening - found.width) / 0.012, 0.0, 1.0)
    # The slope gives the squared cosine of the flanks' angle next to the pads. The two flanks of a block's corner rise
    # and fall alike, so that corners look square, too; but there the block is wider than across its sides.
    narrow = np.clip(float(segment.extent[1]) / np.maximum(found.width, 1e-3), 0.0, 1.0)
    square = _squareness(found, surface) * narrow**2 / (1.0 + found.slope**2)
    firm = np.clip((found.width - gripper.closed_gap) / max(tuning.firm, 1e-6), 0.0, 1.0)
    # What is round slips out below fingertips that stay above its middle.
    low = np.where(_below_middle(found, segment), 1.0, 0.5)
    held = low * firm * square
    return held * (0.4 + 0.6 * depth) * (1.0 - 0.7 * np.clip(off_centre, 0.0, 1.0)) * (0.8 + 0.2 * stretch)


def _best(
    found: _Candidates, surface: FloatArray, segment: Segment, gripper: GripperShape, tuning: GraspTuning
) -> tuple[GraspPose, ...]:
    """The best candidates, none within 12 mm and 25 degrees of a better one."""
    tcp = np.column_stack([found.origin, found.tip + gripper.tip])
    score, opening = _scores(found, surface, segment, gripper, tuning), found.opening(gripper, tuning)
    left = np.argsort(-score, kind="stable")
    kept: list[int] = []
    while len(left) and len(kept) < tuning.count:
        best = int(left[0])
        kept.append(best)
        turned = np.abs(np.mod(found.yaw[left] - found.yaw[best] + np.pi / 2, np.pi) - np.pi / 2)
        away = np.linalg.norm(tcp[left] - tcp[best], axis=1)
        left = left[(away >= 0.012) | (turned >= np.radians(25))]
    return tuple(
        GraspPose(
            make_transform(top_down_rotation(_upright_yaw(found.yaw[i], tcp[i])), tcp[i]),
            float(opening[i]),
            float(score[i]),
        )
        for i in kept
    )


def _upright_yaw(yaw: float, tcp: FloatArray) -> float:
    """`yaw` or its opposite, whichever turns the wrist less: the jaws are alike, the wrist's range is not endless."""
    radial = float(np.arctan2(tcp[1], tcp[0]))
    return radial + wrap_angle(yaw - radial, np.pi)
