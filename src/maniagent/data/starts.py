"""Where the object stands at the beginning of each episode: planned before the first one."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import StrEnum
from itertools import islice

import numpy as np
from scipy.stats import qmc

from ..errors import UsageError
from ..geometry import FloatArray, rotation_z, wrap_angle
from ..perception.views import Workspace
from ..types import BoolArray, OrientedBox
from .reach import Reach

GAP = 0.03
"""m between the object and what it is kept clear of, at least: room for an open finger."""
_DISCS = 7
"""That stand for an object."""
_VAIN = 4000
"""Draws for each place that will do; where it takes more, the region is given up."""
_BLOCK = 8
"""log2 of the points first taken from the Sobol sequence."""
_GRID_BLOCKS = 9
"""Blocks of it that give a grid its yaws: 65536, and so many points a grid may have, in reach or not."""
_AT_LARGE = "Give a larger region, or free the table."

Interval = tuple[float, float]


class Pattern(StrEnum):
    """How the starts of a plan follow each other."""

    SOBOL = "sobol"
    """Low discrepancy: evenly spread wherever the collection stops. A longer plan begins with the shorter one."""
    RANDOM = "random"
    """Independent and uniform. A longer plan begins with the shorter one."""
    GRID = "grid"
    """A square grid, to and fro, row by row: the next start is near the last."""
    SHUFFLED_GRID = "shuffled-grid"
    """The same grid in an order drawn by the seed."""


@dataclass(frozen=True)
class Start:
    """Where the object begins."""

    index: int
    """Place in the plan, from 0."""
    xy: tuple[float, float]
    """m, base frame: the middle of its footprint."""
    yaw: float
    """rad in (-pi, pi]: the direction of its long side, counter-clockwise from base x."""


@dataclass(frozen=True)
class Region:
    """The places at which an object may begin: it can be picked, it is seen, it is clear of what must stay free.

    Raises UsageError for bounds the wrong way round and for a width that is none.
    """

    reach: Reach
    workspace: Workspace = field(default_factory=Workspace)
    """What the cameras see of the table."""
    x: Interval | None = None
    """m, base frame: bounds on the object's middle; None for no more than reach and sight impose."""
    y: Interval | None = None
    width: float | None = None
    """m, of the object's footprint across its yaw; None: as wide as it is long."""
    kept_free: tuple[OrientedBox, ...] = ()
    """What the object must not touch when an episode begins, such as the plate that it goes to."""

    def __post_init__(self) -> None:
        for name, given in (("x", self.x), ("y", self.y)):
            if given is not None and not given[0] <= given[1]:
                raise UsageError(f"The region's {name} is {given[0]:g} to {given[1]:g} m: give the smaller one first.")
        if self.width is not None and not self.width > 0:
            raise UsageError(f"An object {self.width:g} m wide is none: give its width in metres, more than 0.")

    @property
    def bounds(self) -> FloatArray:
        """(2, 2) m: lower and upper corner of a rectangle that holds the region; empty where low is above high."""
        (x0, x1), (y0, y1), margin = self.workspace.x, self.workspace.y, self.reach.radius
        low = np.maximum(self.reach.low, (x0 + margin, y0 + margin))
        high = np.minimum(self.reach.high, (x1 - margin, y1 - margin))
        for axis, given in enumerate((self.x, self.y)):
            if given is not None:
                low[axis], high[axis] = max(low[axis], given[0]), min(high[axis], given[1])
        return np.stack([low, high])

    def contains(self, xy: FloatArray, yaw: FloatArray) -> BoolArray:
        """Which starts will do, (...,) bool; `xy` (..., 2) m, base frame, `yaw` (...,) rad."""
        low, high = self.bounds
        inside = np.all((xy >= low) & (xy <= high), axis=-1) & self.reach.contains(xy, yaw)
        for box in self.kept_free:
            inside &= self._clear_of(box, xy, yaw)
        return inside

    def _clear_of(self, box: OrientedBox, xy: FloatArray, yaw: FloatArray) -> BoolArray:
        """Whether discs along the object's length keep their distance from a box."""
        long = 2 * self.reach.radius
        wide = long if self.width is None else min(self.width, long)
        along = np.stack([np.cos(yaw), np.sin(yaw)], axis=-1)
        offsets = np.linspace(-0.5, 0.5, _DISCS) * (long - wide)
        return np.all([_distance(xy + d * along, box) >= wide / 2 + GAP for d in offsets], axis=0)


def plan_starts(
    region: Region, count: int, pattern: Pattern = Pattern.SOBOL, seed: int = 0, yaw: float | None = None
) -> tuple[Start, ...]:
    """The starts of a collection: the same for the same arguments.

    `count` of them, from the Sobol sequence or at random; of a grid, the widest one that has at least `count`.
    Object yaws follow the same pattern unless `yaw` (rad) fixes them.

    Raises
    ------
    UsageError
        Where `count` or `seed` makes no sense, or (nearly) no place of the region will do.

    """
    if count < 1 or seed < 0:
        raise UsageError(f"A plan needs 1 start or more and a seed of 0 or more, not {count} and {seed}.")
    if yaw is not None and not np.isfinite(yaw):
        raise UsageError(f"The yaw is {yaw}; it should be an angle in radians.")
    if np.any(region.bounds[0] > region.bounds[1]):
        raise UsageError(_nowhere(region))
    if pattern in (Pattern.GRID, Pattern.SHUFFLED_GRID):
        poses = _grid(region, count, seed, yaw)
        if pattern is Pattern.SHUFFLED_GRID:
            poses = np.random.default_rng(seed).permutation(poses)
    else:
        stream = _sobol(3, seed) if pattern is Pattern.SOBOL else _random(3, seed)
        poses = np.array(list(islice(_possible(region, stream, yaw), count)))
    return tuple(Start(index, (float(x), float(y)), wrap_angle(turn)) for index, (x, y, turn) in enumerate(poses))


def _sobol(dimensions: int, seed: int) -> Iterator[FloatArray]:
    """The points of one scrambled Sobol sequence in the unit cube, one block after the other."""
    sequence = qmc.Sobol(dimensions, rng=np.random.default_rng(seed))
    yield sequence.random_base2(_BLOCK)
    for log2_drawn in range(_BLOCK, 30):  # doubled each time: whole nets, and the same points however many are used
        yield sequence.random_base2(log2_drawn)


def _random(dimensions: int, seed: int) -> Iterator[FloatArray]:
    rng = np.random.default_rng(seed)
    while True:
        yield rng.random((2**_BLOCK, dimensions))


def _possible(region: Region, stream: Iterator[FloatArray], fixed_yaw: float | None) -> Iterator[FloatArray]:
    """Poses (3,) of the region, in the order of the points (N, 3) of the unit cube that they come from.

    Leaving out what lies outside takes little from the evenness inside: a sequence that fills every part of the
    rectangle in proportion to its size so fills every part of the region.
    """
    low, high = region.bounds
    drawn = found = 0
    for block in stream:
        poses = np.concatenate([low + block[:, :2] * (high - low), 2 * np.pi * block[:, 2:] - np.pi], axis=1)
        if fixed_yaw is not None:
            poses[:, 2] = fixed_yaw
        good = region.contains(poses[:, :2], poses[:, 2])
        yield from poses[good]
        drawn, found = drawn + len(block), found + int(good.sum())
        if drawn > _VAIN * (found + 1):
            raise UsageError(_nowhere(region))


def _grid(region: Region, count: int, seed: int, fixed_yaw: float | None) -> FloatArray:
    """Poses (N >= count, 3) on the widest square grid that has so many in the region, to and fro."""
    low, high = region.bounds
    next(_possible(region, _sobol(3, seed), fixed_yaw))  # raises where there is no place at all
    yaws = np.concatenate(list(islice(_sobol(1, seed), _GRID_BLOCKS)))[:, 0] * 2 * np.pi - np.pi

    def poses(pitch: float) -> FloatArray:
        xy = _serpentine(low, high, pitch)
        if len(xy) > len(yaws):
            raise UsageError(f"{count} starts are more than a grid over this region can have. {_AT_LARGE}")
        turns = yaws[: len(xy)] if fixed_yaw is None else np.full(len(xy), fixed_yaw)
        return np.column_stack([xy, turns])[region.contains(xy, turns)]

    wide = narrow = float(np.ptp(region.bounds, axis=0).max()) or 1.0
    while len(poses(narrow)) < count:
        wide, narrow = narrow, 0.7 * narrow
    for _ in range(12):  # bisected to a ten-thousandth
        middle = (wide + narrow) / 2
        wide, narrow = (wide, middle) if len(poses(middle)) >= count else (middle, narrow)
    return poses(narrow)


def _serpentine(low: FloatArray, high: FloatArray, pitch: float) -> FloatArray:
    """Points (N, 2) of a square grid, in the middle of a rectangle; rows along y, every other one backwards."""
    steps = ((high - low) / pitch + 1e-9).astype(int)
    rows, columns = ((low + high)[axis] / 2 + pitch * (np.arange(n + 1) - n / 2) for axis, n in enumerate(steps))
    x, y = np.meshgrid(rows, columns, indexing="ij")
    y[1::2] = y[1::2, ::-1].copy()
    return np.column_stack([x.ravel(), y.ravel()])


def _distance(xy: FloatArray, box: OrientedBox) -> FloatArray:
    """m, in the plane, from points (..., 2) to a box; 0 inside."""
    beyond = np.abs((xy - box.centre[:2]) @ rotation_z(box.yaw)[:2, :2]) - box.extent[:2] / 2
    return np.linalg.norm(np.maximum(beyond, 0.0), axis=-1)


def _nowhere(region: Region) -> str:
    (x0, y0), (x1, y1) = region.bounds
    return (
        f"No place to begin at: nothing in x {x0:.2f} to {x1:.2f} m, y {y0:.2f} to {y1:.2f} m can be reached, is seen, "
        f"and is clear of what must stay free. {_AT_LARGE}"
    )
