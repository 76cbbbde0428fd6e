"""Closed triangle meshes made of rings of points, and what is needed to draw them well.

Every maker here returns a closed surface whose faces wind counter-clockwise seen from outside. Lengths are metres.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...geometry import FloatArray, transform_points

IntArray = NDArray[np.integer]
CREASE = np.radians(40.0)
"""Edges that turn by more than this stay sharp in `Mesh.normals`."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """A closed triangle mesh with texture coordinates."""

    vertices: FloatArray
    """(N, 3) m."""
    faces: IntArray
    """(M, 3) vertex indices, counter-clockwise seen from outside."""
    uv: FloatArray
    """(M, 3, 2) texture coordinates of the face corners; (0, 0) is the first texel of the first row."""

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """The least and the greatest corner, (3,) each."""
        return self.vertices.min(axis=0), self.vertices.max(axis=0)

    def moved(self, T: FloatArray) -> Mesh:
        """The mesh after the rigid transform `T` (4, 4)."""
        return Mesh(transform_points(T, self.vertices), self.faces, self.uv)

    def shifted(self, offset: ArrayLike) -> Mesh:
        """The mesh moved by `offset` (3,) m."""
        return Mesh(self.vertices + np.asarray(offset, float), self.faces, self.uv)

    def cut_below(self, z: float) -> Mesh:
        """The mesh with whatever lies below `z` pressed up to it: a flat to rest on."""
        vertices = self.vertices.copy()
        vertices[:, 2] = np.maximum(vertices[:, 2], z)
        return _closed(vertices, self.faces, self.uv)

    def tiled(self, u: float, v: float) -> Mesh:
        """The mesh with its texture repeated `u` and `v` times."""
        return Mesh(self.vertices, self.faces, self.uv * [u, v])

    def mapped_from_above(self) -> Mesh:
        """The mesh with the texture laid on from above: u along x, v along y, over its bounding box."""
        low, high = self.bounds
        xy = (self.vertices[:, :2] - low[:2]) / (high[:2] - low[:2])
        return Mesh(self.vertices, self.faces, xy[self.faces])

    def mapped_as_box(self, scale: float) -> Mesh:
        """The mesh with the texture laid on along the axis each face points to most; `scale` m make one repeat."""
        corners = self.vertices[self.faces]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        axis = np.argmax(np.abs(normal), axis=1)
        along = np.array([[1, 2], [0, 2], [0, 1]])[axis]
        uv = np.take_along_axis(corners, along[:, None, :].repeat(3, axis=1), axis=2)
        return Mesh(self.vertices, self.faces, uv / scale + 0.5 + 0.31 * axis[:, None, None])

    def normals(self) -> FloatArray:
        """Unit normals of the face corners (M, 3, 3): smooth, but for edges sharper than `CREASE`."""
        corners = self.vertices[self.faces]
        weighted = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])  # length: twice the area
        unit = weighted / np.linalg.norm(weighted, axis=1, keepdims=True)
        _, welded = np.unique(np.round(self.vertices, 7), axis=0, return_inverse=True)  # the points of a pole are one
        corner_points = welded.reshape(-1)[self.faces].ravel()
        around = _faces_around(corner_points)[corner_points]  # (3M, valence)
        own = np.repeat(np.arange(len(self.faces)), 3)
        close = (around >= 0) & (np.einsum("kj,kvj->kv", unit[own], unit[around]) > np.cos(CREASE))
        summed = np.einsum("kv,kvj->kj", close.astype(float), weighted[around])
        return (summed / np.linalg.norm(summed, axis=1, keepdims=True)).reshape(-1, 3, 3)

    @cached_property
    def with_normals(self) -> tuple[FloatArray, FloatArray, IntArray]:
        """Vertices (K, 3), their unit normals (K, 3) and faces (M, 3): vertices on sharp edges are there repeatedly."""
        corners = np.hstack([self.vertices[self.faces.ravel()], self.normals().reshape(-1, 3)])
        points, faces = np.unique(np.round(corners, 7), axis=0, return_inverse=True)
        return points[:, :3], points[:, 3:], faces.reshape(-1, 3)


def merge(meshes: Sequence[Mesh]) -> Mesh:
    """One mesh that holds all of them."""
    starts = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes])
    return Mesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts[:-1], strict=True)]),
        np.concatenate([mesh.uv for mesh in meshes]),
    )


def loft(rings: FloatArray) -> Mesh:
    """The skin over rings of points (R, S, 3), closed at both ends.

    u runs round a ring and v from ring to ring, both from 0 to 1 in proportion to length.
    """
    count, sides = rings.shape[:2]
    a = np.arange(count - 1)[:, None] * sides + np.arange(sides)[None, :]
    b = np.arange(count - 1)[:, None] * sides + (np.arange(sides) + 1)[None, :] % sides
    quads = np.stack([a, b, b + sides, a + sides], axis=-1).reshape(-1, 4)
    u = _share_of_way(np.linalg.norm(np.roll(rings, -1, axis=1) - rings, axis=2).mean(axis=0))
    v = _share_of_way(np.linalg.norm(np.diff(rings, axis=0), axis=2).mean(axis=1))
    u0, v0 = np.broadcast_arrays(u[None, :-1], v[:-1, None])
    u1, v1 = np.broadcast_arrays(u[None, 1:], v[1:, None])
    quad_uv = np.stack([u0, v0, u1, v0, u1, v1, u0, v1], axis=-1).reshape(-1, 4, 2)
    faces, uv = [quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]], [quad_uv[:, [0, 1, 2]], quad_uv[:, [0, 2, 3]]]
    first, second = np.arange(sides), (np.arange(sides) + 1) % sides
    for ring, centre, (i, j), v_end in (
        (0, count * sides, (second, first), 0.0),
        (count - 1, count * sides + 1, (first, second), 1.0),
    ):
        faces.append(np.stack([ring * sides + i, ring * sides + j, np.full(sides, centre)], axis=-1))
        uv.append(np.stack([np.stack([u[:-1], np.full(sides, v_end)], axis=-1)] * 3, axis=1))
    ends = np.stack([rings[0].mean(axis=0), rings[-1].mean(axis=0)])
    return _closed(np.concatenate([rings.reshape(-1, 3), ends]), np.concatenate(faces), np.concatenate(uv))


def sweep(
    curve: ArrayLike,
    half_sizes: ArrayLike,
    *,
    sides: int = 20,
    up: ArrayLike = (0.0, 0.0, 1.0),
    squareness: float = 2.0,
) -> Mesh:
    """A tube along `curve` (R, 3); `half_sizes` (R,) or (R, 2) are its radii across and along `up`, m.

    `squareness` is the exponent of the superellipse |y|^n + |z|^n = 1 of the section: 2 is round, larger is boxier.
    """
    curve, half = np.asarray(curve, float), np.asarray(half_sizes, float)
    half = np.stack([half, half], axis=-1) if half.ndim == 1 else half
    tangent = np.gradient(curve, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    across = np.cross(np.asarray(up, float), tangent)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    upward = np.cross(tangent, across)
    y, z = superellipse(sides, squareness).T
    rings = (
        curve[:, None, :]
        + (half[:, 0, None] * y)[..., None] * across[:, None, :]
        + (half[:, 1, None] * z)[..., None] * upward[:, None, :]
    )
    return loft(rings)


def lathe(profile: ArrayLike, *, sides: int = 32, oval: tuple[float, float] = (1.0, 1.0), wave: float = 0.0) -> Mesh:
    """A body of revolution about z; `profile` (R, 2) holds radius and height, m. `oval` stretches x and y.

    `wave` > 0 makes petals: the radius of every second side shrinks by that fraction.
    """
    radius, z = np.asarray(profile, float).T
    angle = 2 * np.pi * np.arange(sides) / sides
    petal = 1.0 - wave * (np.arange(sides) % 2)
    x = radius[:, None] * (oval[0] * petal * np.cos(angle))[None, :]
    y = radius[:, None] * (oval[1] * petal * np.sin(angle))[None, :]
    return loft(np.stack([x, y, np.broadcast_to(z[:, None], x.shape)], axis=-1))


def prism(outline: ArrayLike, height: float, bevel: float) -> Mesh:
    """A slab on z = 0 over an `outline` (S, 2) that is star-shaped about its mean; its edges are cut by `bevel` m."""
    xy = np.asarray(outline, float)
    inward = xy.mean(axis=0) - xy
    inset = xy + bevel * inward / np.linalg.norm(inward, axis=1, keepdims=True)
    levels = ((inset, 0.0), (xy, bevel), (xy, height - bevel), (inset, height))
    return loft(np.stack([np.column_stack([ring, np.full(len(ring), z)]) for ring, z in levels]))


def box(size: ArrayLike, bevel: float) -> Mesh:
    """A box of full `size` (3,) on z = 0, about the z axis, its upright and level edges cut by `bevel` m."""
    length, width, height = np.asarray(size, float)
    return prism(rounded_rectangle(length, width, bevel, corner_points=2), height, bevel)


def rounded_rectangle(length: float, width: float, radius: float, corner_points: int = 5) -> FloatArray:
    """The outline (4 * corner_points, 2) of a rectangle about the origin with round corners, counter-clockwise."""
    turn = np.linspace(0.0, np.pi / 2, corner_points)
    corners = []
    for quarter, (sx, sy) in enumerate(((1, 1), (-1, 1), (-1, -1), (1, -1))):
        angle = turn + quarter * np.pi / 2
        centre = np.array([sx * (length / 2 - radius), sy * (width / 2 - radius)])
        corners.append(centre + radius * np.column_stack([np.cos(angle), np.sin(angle)]))
    return np.concatenate(corners)


def superellipse(sides: int, exponent: float) -> FloatArray:
    """Points (sides, 2) of |y|^n + |z|^n = 1, counter-clockwise."""
    angle = 2 * np.pi * np.arange(sides) / sides
    c, s = np.cos(angle), np.sin(angle)
    power = 2.0 / exponent
    return np.column_stack([np.sign(c) * np.abs(c) ** power, np.sign(s) * np.abs(s) ** power])


def _share_of_way(lengths: FloatArray) -> FloatArray:
    """Where each step (K,) begins and the last one ends, (K + 1,), as a share of the whole."""
    way = np.concatenate([[0.0], np.cumsum(lengths)])
    return way / way[-1]


def _closed(vertices: FloatArray, faces: IntArray, uv: FloatArray) -> Mesh:
    """The mesh without faces of no area, turned right side out."""
    corners = vertices[faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    keep = np.linalg.norm(normal, axis=1) > 1e-11
    faces, uv = faces[keep], uv[keep]
    if np.einsum("ij,ij->", corners[keep, 0], normal[keep]) < 0:  # six times the enclosed volume
        faces, uv = faces[:, ::-1], uv[:, ::-1]
    return Mesh(vertices, faces, uv)


def _faces_around(corner_points: IntArray) -> IntArray:
    """Indices of the faces at each point, (points, valence), -1 where there are fewer."""
    order = np.argsort(corner_points, kind="stable")
    count = np.bincount(corner_points)
    start = np.concatenate([[0], np.cumsum(count)[:-1]])
    slot = np.arange(len(order)) - start[corner_points[order]]
    table = np.full((len(count), int(count.max())), -1)
    table[corner_points[order], slot] = order // 3
    return table
