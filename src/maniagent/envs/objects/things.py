"""Wooden blocks and a marker pen. Everything stands on z = 0, long axis along x; metres."""

from __future__ import annotations

import numpy as np

from ...errors import UsageError
from . import textures
from .mesh import Mesh, box, merge, sweep
from .model import Colour, Finish, ObjectModel, Visual, assemble
from .pieces import Contact, box_piece, capsule_piece
from .shapes import FLAT

BLOCK_COLOURS: dict[str, Colour] = {
    "red": (0.82, 0.10, 0.08),
    "orange": (0.95, 0.47, 0.06),
    "yellow": (0.97, 0.80, 0.08),
    "green": (0.13, 0.56, 0.16),
    "blue": (0.10, 0.30, 0.78),
    "purple": (0.46, 0.18, 0.60),
    "white": (0.93, 0.92, 0.89),
    "black": (0.10, 0.10, 0.11),
    "brown": (0.45, 0.27, 0.13),
    "natural": (0.86, 0.68, 0.44),
}
BLOCK_EDGE = (0.01, 0.20)
WOOD_DENSITY = 600.0
"""kg/m^3, beech or the like."""


def block(size: float | tuple[float, float, float] = 0.04, colour: str = "red") -> ObjectModel:
    """A painted wooden block; `size` is its edge or its full length, width and height, m.

    Raises UsageError for an unknown colour or an edge outside `BLOCK_EDGE`.
    """
    try:
        edges = np.broadcast_to(np.asarray(size, float), (3,)).copy()
    except (TypeError, ValueError):
        raise UsageError(f"A block's size is one edge or three, in metres, not {size!r}.") from None
    if not np.all((edges >= BLOCK_EDGE[0]) & (edges <= BLOCK_EDGE[1])):
        raise UsageError(f"A block's edges must be {BLOCK_EDGE[0]} to {BLOCK_EDGE[1]} m long, not {size}.")
    if colour not in BLOCK_COLOURS:
        raise UsageError(f"No block is {colour!r}. Known colours: {', '.join(BLOCK_COLOURS)}.")
    finish = Finish(texture=textures.wood(BLOCK_COLOURS[colour]), specular=0.15, shininess=0.3)
    return assemble(
        "block",
        f"{colour} block",
        [Visual(box(edges, min(0.0015, 0.06 * edges.min())).mapped_as_box(0.06), finish)],
        [box_piece(edges, (0, 0, edges[2] / 2))],
        mass=float(WOOD_DENSITY * edges.prod()),
        contact=Contact(sliding=0.7, torsional=0.008, rolling=0.0002),
    )


def marker() -> ObjectModel:
    """A marker pen: white barrel with a print, blue cap with a clip towards +x."""
    radius, z = 0.0080, 0.0080 - FLAT
    white, blue = Finish((0.93, 0.93, 0.91), specular=0.5), Finish((0.07, 0.20, 0.72), specular=0.6, shininess=0.6)
    barrel = _rod([-0.0555, -0.0545, 0.0200, 0.0205], [7.0, 7.6, 7.6, 7.0], z)
    label = _rod([-0.036, -0.0359, 0.000, 0.0001], [7.5, 7.8, 7.8, 7.5], z)
    plug = _rod([-0.0600, -0.0590, -0.0555, -0.0550], [4.6, 5.8, 6.2, 6.2], z)
    cap = _rod([0.0150, 0.0155, 0.0480, 0.0575, 0.0600], [7.4, 8.0, 8.0, 6.6, 4.6], z)
    clip = box((0.036, 0.0036, 0.0018), 0.0005).shifted((0.036, 0.0, z + radius - 0.0004))
    pieces = [
        capsule_piece((-0.0515, 0, z), (0.0515, 0, z), z - FLAT / 4),
        box_piece((0.080, 0.0045, 0.006), (0.0, 0.0, 0.003)),
    ]
    return assemble(
        "marker",
        "marker pen",
        [
            Visual(barrel.cut_below(0.0), white),
            Visual(merge([plug, cap, clip]).cut_below(0.0), blue),
            Visual(label.cut_below(0.0), Finish(texture=_label(), specular=0.4)),
        ],
        pieces,
        mass=0.018,
        contact=Contact(sliding=0.9, torsional=0.006, rolling=0.0006),
    )


def _rod(x: list[float], radii: list[float], z: float) -> Mesh:
    """A turned rod along x at height `z`, m, with radii in millimetres."""
    return sweep(np.column_stack([x, np.zeros(len(x)), np.full(len(x), z)]), np.array(radii) / 1000, sides=20)


def _label() -> textures.Texture:
    """A blue print with pale strokes, as on a pen's barrel."""
    v, u = textures.grid(64, 64)
    edge = (np.abs(v - 0.5) > 0.42) * np.ones_like(u)
    strokes = (np.sin(2 * np.pi * 9 * v) > 0.1) * (np.abs((u * 2) % 1.0 - 0.5) < 0.16) * (np.abs(v - 0.5) < 0.34)
    return textures.to_texture(textures.blend((0.16, 0.34, 0.80), (0.93, 0.93, 0.91), np.maximum(edge, strokes)))
