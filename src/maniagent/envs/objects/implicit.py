"""Organic shapes as signed distances that melt into each other, and the mesh of their zero surface.

A distance function takes points (..., 3) m and gives metres, negative inside. The mesh is made by surface nets
(Gibson, "Constrained Elastic Surface Nets", MICCAI 1998): one vertex in every cell that the surface crosses, at the
mean of the crossings of the cell's edges.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import product

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...geometry import FloatArray
from .mesh import IntArray, Mesh

BoolArray = NDArray[np.bool_]
Distance = Callable[[FloatArray], FloatArray]


def ball(size: ArrayLike, centre: ArrayLike) -> Distance:
    """An ellipsoid of full `size` (3,) m about `centre`; the distance is a first-order estimate."""
    half, middle = np.asarray(size, float) / 2, np.asarray(centre, float)

    def distance(points: FloatArray) -> FloatArray:
        scaled = (points - middle) / half
        k0 = np.linalg.norm(scaled, axis=-1)
        k1 = np.linalg.norm(scaled / half, axis=-1)
        return k0 * (k0 - 1.0) / np.maximum(k1, 1e-9)

    return distance


def limb(start: ArrayLike, end: ArrayLike, start_radius: float, end_radius: float) -> Distance:
    """A capsule whose radius changes evenly from one end to the other, m."""
    p, axis = np.asarray(start, float), np.asarray(end, float) - np.asarray(start, float)

    def distance(points: FloatArray) -> FloatArray:
        t = np.clip((points - p) @ axis / (axis @ axis), 0.0, 1.0)
        radius = start_radius + (end_radius - start_radius) * t
        return np.linalg.norm(points - p - t[..., None] * axis, axis=-1) - radius

    return distance


def slab(size: ArrayLike, centre: ArrayLike, rounding: float) -> Distance:
    """A box of full `size` (3,) m about `centre` with round edges."""
    half, middle = np.asarray(size, float) / 2 - rounding, np.asarray(centre, float)

    def distance(points: FloatArray) -> FloatArray:
        q = np.abs(points - middle) - half
        return np.linalg.norm(np.maximum(q, 0.0), axis=-1) + np.minimum(q.max(axis=-1), 0.0) - rounding

    return distance


def melt(parts: Sequence[Distance], reach: float) -> Distance:
    """The union of `parts`, smoothed where two surfaces come within about `reach` m of each other."""

    def distance(points: FloatArray) -> FloatArray:
        total = parts[0](points)
        for part in parts[1:]:
            other = part(points)
            overlap = np.maximum(reach - np.abs(total - other), 0.0) / reach
            total = np.minimum(total, other) - overlap**2 * reach / 4.0
        return total

    return distance


def surface(distance: Distance, low: ArrayLike, high: ArrayLike, cell: float) -> Mesh:
    """The zero surface within the box from `low` to `high` (3,), which must hold all of it; cells of `cell` m."""
    low = np.asarray(low, float)
    count = np.ceil((np.asarray(high, float) - low) / cell).astype(int) + 1
    lattice = np.stack(np.meshgrid(*(np.arange(n) for n in count), indexing="ij"), axis=-1)
    value = distance(low + cell * lattice)
    inside = value < 0.0
    total = np.zeros((*(count - 1), 3))
    crossings = np.zeros(count - 1)
    for axis in range(3):
        crossed, place = _crossings(value, axis)
        for shift in product((0, 1), repeat=2):
            window = [slice(0, n - 1) for n in count]
            for other, step in zip((a for a in range(3) if a != axis), shift, strict=True):
                window[other] = slice(step, step + count[other] - 1)
            offset = np.zeros(3)
            offset[[a for a in range(3) if a != axis]] = shift
            hit = crossed[tuple(window)]
            at = offset + place[tuple(window)][..., None] * np.eye(3)[axis]
            total += np.where(hit[..., None], at, 0.0)
            crossings += hit
    used = crossings > 0
    index = np.full(used.shape, -1)
    index[used] = np.arange(used.sum())
    vertices = low + cell * (lattice[:-1, :-1, :-1][used] + total[used] / crossings[used][:, None])
    faces = np.concatenate([_quads(inside, index, axis) for axis in range(3)])
    return Mesh(vertices, faces, np.zeros((len(faces), 3, 2)))


def _crossings(value: FloatArray, axis: int) -> tuple[BoolArray, FloatArray]:
    """For the lattice edges along `axis`: whether the surface crosses, and where between 0 and 1."""
    first, second = (
        np.take(value, range(value.shape[axis] - 1), axis),
        np.take(value, range(1, value.shape[axis]), axis),
    )
    crossed = (first < 0.0) != (second < 0.0)
    place = np.where(crossed, first / np.where(crossed, first - second, 1.0), 0.0)
    return crossed, place


def _quads(inside: BoolArray, index: IntArray, axis: int) -> IntArray:
    """Two triangles round every lattice edge along `axis` that the surface crosses."""
    a, b = (axis + 1) % 3, (axis + 2) % 3
    window: list[slice] = [slice(1, -1)] * 3
    window[axis] = slice(0, -1)
    following = list(window)
    following[axis] = slice(1, None)
    leaves = inside[tuple(window)] & ~inside[tuple(following)]
    enters = ~inside[tuple(window)] & inside[tuple(following)]
    faces = []
    for edges, turn in ((leaves, 1), (enters, -1)):
        at = np.argwhere(edges)
        at[:, a] += 1
        at[:, b] += 1
        corners = []
        for da, db in ((-1, -1), (0, -1), (0, 0), (-1, 0)):
            cell = at.copy()
            cell[:, a] += da
            cell[:, b] += db
            corners.append(index[tuple(cell.T)])
        quad = np.stack(corners[::turn], axis=-1)
        faces += [quad[:, [0, 1, 2]], quad[:, [0, 2, 3]]]
    return np.concatenate(faces)
