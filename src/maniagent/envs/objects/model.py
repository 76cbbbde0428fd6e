"""What an object is to the simulator: looks, convex collision pieces, mass."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ...geometry import FloatArray
from .mesh import Mesh
from .pieces import Contact, Piece

Colour = tuple[float, float, float]
"""Red, green, blue in [0, 1]."""


@dataclass(frozen=True, eq=False)
class Finish:
    """How a surface looks: one colour or a texture, and how it shines."""

    colour: Colour = (1.0, 1.0, 1.0)
    """Multiplies the texture, if there is one."""
    texture: NDArray[np.uint8] | None = None
    """(H, W, 3) uint8; rows run along v, columns along u."""
    specular: float = 0.2
    shininess: float = 0.3


@dataclass(frozen=True, eq=False)
class Visual:
    """A part of an object that is seen and not felt."""

    mesh: Mesh
    finish: Finish


@dataclass(frozen=True, eq=False)
class ObjectModel:
    """One kind of object, ready to be put into a scene. The body's origin is the middle of its bounding box."""

    kind: str
    title: str
    """For a person: "red chili pepper"."""
    extent: FloatArray
    """(3,) m, full size at rest, upright, along the body's x (the long axis), y and z."""
    radius: float
    """m, of the circle about the body's origin that covers what the object covers of the table."""
    rest_z: float
    """m, height of the body's origin above the table at rest, upright."""
    surface_z: float
    """m, height above the table at the object's middle on which a thing put there comes to rest."""
    mass: float
    """kg."""
    fixed: bool
    """Too heavy for the arm to move; still a free body, so that scenes place all objects alike."""
    visuals: tuple[Visual, ...]
    pieces: tuple[Piece, ...]
    contact: Contact = field(default_factory=Contact)
    """Of the pieces that have none of their own."""


def assemble(
    kind: str,
    title: str,
    visuals: Sequence[Visual],
    pieces: Sequence[Piece],
    *,
    mass: float,
    surface_z: float | None = None,
    fixed: bool = False,
    contact: Contact | None = None,
) -> ObjectModel:
    """The model of an object given as it lies on the table z = 0; `surface_z` is its top unless told."""
    every = [visual.mesh.bounds for visual in visuals]
    low = np.min([bounds[0] for bounds in every], axis=0)
    high = np.max([bounds[1] for bounds in every], axis=0)
    origin = (low + high) / 2
    outline = np.concatenate([visual.mesh.vertices[:, :2] for visual in visuals]) - origin[:2]
    extent = high - low
    extent.setflags(write=False)
    return ObjectModel(
        kind=kind,
        title=title,
        extent=extent,
        radius=float(np.linalg.norm(outline, axis=1).max()),
        rest_z=float(extent[2] / 2),
        surface_z=float(high[2]) if surface_z is None else surface_z,
        mass=mass,
        fixed=fixed,
        visuals=tuple(Visual(visual.mesh.shifted(-origin), visual.finish) for visual in visuals),
        pieces=tuple(piece.shifted(-origin) for piece in pieces),
        contact=contact or Contact(),
    )
