"""Convex collision pieces: MuJoCo primitives placed in an object."""

from __future__ import annotations

from dataclasses import dataclass, replace

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from ...geometry import FloatArray


@dataclass(frozen=True)
class Contact:
    """How a surface holds on to others; MuJoCo's friction coefficients."""

    sliding: float = 0.8
    torsional: float = 0.008
    """m: a soft fingertip resists turning about the contact's normal."""
    rolling: float = 0.0004
    """m: what keeps round things from rolling away."""
    priority: int = 0
    """Of two surfaces in contact the greater priority's values hold; between equals, the greater values."""


@dataclass(frozen=True, eq=False)
class Piece:
    """A convex part of an object that is felt and not seen."""

    shape: mujoco.mjtGeom
    size: FloatArray
    """(3,) m, as MuJoCo reads it: half sizes of a box, radius and half length of a cylinder or capsule."""
    centre: FloatArray
    """(3,) m."""
    rotation: FloatArray
    """(3, 3), piece to object."""
    contact: Contact | None = None
    """Where it differs from the rest of the object."""

    @property
    def volume(self) -> float:
        """m^3."""
        a, b, c = self.size
        if self.shape == mujoco.mjtGeom.mjGEOM_BOX:
            return float(8 * a * b * c)
        if self.shape == mujoco.mjtGeom.mjGEOM_ELLIPSOID:
            return float(4 / 3 * np.pi * a * b * c)
        caps = 4 / 3 * a if self.shape == mujoco.mjtGeom.mjGEOM_CAPSULE else 0.0
        return float(np.pi * a**2 * (2 * b + caps))

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """The least and the greatest corner of the axis-aligned box around this piece, (3,) each."""
        a, b, c = self.size
        R = self.rotation
        if self.shape == mujoco.mjtGeom.mjGEOM_BOX:
            half = np.abs(R) @ self.size
        elif self.shape == mujoco.mjtGeom.mjGEOM_ELLIPSOID:
            half = np.sqrt(R**2 @ np.array([a, b, c]) ** 2)
        elif self.shape == mujoco.mjtGeom.mjGEOM_CAPSULE:
            half = np.abs(R[:, 2]) * b + a
        else:
            half = np.abs(R[:, 2]) * b + a * np.sqrt(np.maximum(0.0, 1.0 - R[:, 2] ** 2))
        return self.centre - half, self.centre + half

    def shifted(self, offset: ArrayLike) -> Piece:
        """The piece moved by `offset` (3,) m."""
        return replace(self, centre=self.centre + np.asarray(offset, float))


def box_piece(size: ArrayLike, centre: ArrayLike, rotation: ArrayLike | None = None) -> Piece:
    """A box of full `size` (3,) m about `centre`."""
    return _piece(mujoco.mjtGeom.mjGEOM_BOX, np.asarray(size, float) / 2, centre, rotation)


def ellipsoid_piece(size: ArrayLike, centre: ArrayLike, rotation: ArrayLike | None = None) -> Piece:
    """An ellipsoid of full `size` (3,) m about `centre`."""
    return _piece(mujoco.mjtGeom.mjGEOM_ELLIPSOID, np.asarray(size, float) / 2, centre, rotation)


def cylinder_piece(radius: float, height: float, centre: ArrayLike) -> Piece:
    """An upright cylinder about `centre`, m."""
    return _piece(mujoco.mjtGeom.mjGEOM_CYLINDER, (radius, height / 2, 0.0), centre, None)


def capsule_piece(start: ArrayLike, end: ArrayLike, radius: float) -> Piece:
    """A capsule of `radius` m about the segment from `start` to `end` (3,)."""
    p, q = np.asarray(start, float), np.asarray(end, float)
    length = float(np.linalg.norm(q - p))
    z = (q - p) / length
    x = np.cross((0.0, 1.0, 0.0) if abs(z[1]) < 0.9 else (1.0, 0.0, 0.0), z)
    x /= np.linalg.norm(x)
    rotation = np.stack([x, np.cross(z, x), z], axis=1)
    return _piece(mujoco.mjtGeom.mjGEOM_CAPSULE, (radius, length / 2, 0.0), (p + q) / 2, rotation)


def _piece(shape: mujoco.mjtGeom, size: ArrayLike, centre: ArrayLike, rotation: ArrayLike | None) -> Piece:
    R = np.eye(3) if rotation is None else np.asarray(rotation, float)
    return Piece(shape, np.asarray(size, float), np.asarray(centre, float), R)
