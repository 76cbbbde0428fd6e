"""Curves, profiles and collision chains that several objects share. Lengths are metres."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from ...geometry import FloatArray
from .mesh import Mesh, sweep
from .pieces import Piece, capsule_piece

FLAT = 0.0005
"""m, how deep the underside of round things is flattened, so that they lie still."""

STUB = 0.001
"""m, the shortest capsule's straight part."""


def bow(length: float, sagitta: float, count: int = 24) -> FloatArray:
    """Points (count, 2) of a parabola along x whose middle lies `sagitta` to the left (+y) of its ends."""
    x = np.linspace(-length / 2, length / 2, count)
    return np.column_stack([x, sagitta * (1.0 - (2.0 * x / length) ** 2)])


def straight(start: float, length: float, at: FloatArray) -> FloatArray:
    """Points (count, 2) on the x axis, at the places `at` (count,) in [0, 1] of the way from `start`."""
    return np.column_stack([start + length * at, np.zeros_like(at)])


def stations(count: int) -> FloatArray:
    """(count,) places from 0 to 1, denser at both ends, where bodies round off."""
    return 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, count))


def profile(at: ArrayLike, radii: ArrayLike, count: int = 24) -> tuple[FloatArray, FloatArray]:
    """Places (count,) in [0, 1] and radii there, through the given ones; both ends round off to almost nothing."""
    t = stations(count)
    radius = np.interp(t, np.asarray(at, float), np.asarray(radii, float))
    kernel = np.array([0.25, 0.5, 0.25])
    smooth = np.convolve(np.pad(radius, 1, mode="edge"), kernel, mode="valid")
    smooth[[0, -1]] = 1e-4
    return t, smooth


def resting(xy: FloatArray, radius: FloatArray, *, sides: int = 20, flatness: float = 1.0) -> Mesh:
    """A round body lying on z = 0 along `xy` (R, 2), with `radius` (R,) there; its underside slightly flat.

    `flatness` scales the height against the width.
    """
    height = radius * flatness
    centre = np.column_stack([xy, np.full(len(xy), 0.0)])
    centre[:, 2] = height.max() - FLAT
    return sweep(centre, np.column_stack([radius, height]), sides=sides).cut_below(0.0)


def lying(xy: FloatArray, radius: FloatArray, *, sides: int = 20) -> Mesh:
    """As `resting`, but the whole underside touches z = 0: the axis sinks where the body thins."""
    return sweep(np.column_stack([xy, radius - FLAT]), radius, sides=sides).cut_below(0.0)


def capsules_along(xy: FloatArray, radius: FloatArray, edges: ArrayLike, axis_z: float | None = None) -> list[Piece]:
    """Level capsules that fill a round body along `xy` (R, 2) with `radius` (R,), one between each two `edges`.

    `edges` are shares of the body's length, from 0 to 1. With `axis_z` the axes are at that height and the undersides
    just above the table: the body rests on another piece, its flat. Without it each capsule lies on z = 0.
    """
    steps = np.linalg.norm(np.diff(xy, axis=0), axis=1)
    s = np.concatenate([[0.0], np.cumsum(steps)])

    def point(at: float) -> FloatArray:
        return np.array([np.interp(at, s, xy[:, 0]), np.interp(at, s, xy[:, 1])])

    pairs = list(pairwise(np.asarray(edges, float) * s[-1]))
    pieces = []
    for index, (low, high) in enumerate(pairs):
        r = float(np.interp((low + high) / 2, s, radius)) - FLAT / 2
        if axis_z is not None:
            r = min(r, axis_z - FLAT / 4)
        start, end = (low + r if index == 0 else low), (high - r if index == len(pairs) - 1 else high)
        if end - start < STUB:  # the end of a thick body: all but a sphere
            start, end = (start, start + STUB) if index == 0 else (end - STUB, end)
        z = r if axis_z is None else axis_z
        pieces.append(capsule_piece([*point(start), z], [*point(end), z], r))
    return pieces
