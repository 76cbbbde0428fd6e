"""Plate, dish, basket, towel. They stand on z = 0, long axis along x, as `assemble` wants it; metres."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...geometry import FloatArray, rotation_z
from . import textures
from .mesh import lathe, loft, prism, rounded_rectangle
from .model import Colour, Finish, ObjectModel, Visual, assemble
from .pieces import Contact, Piece, box_piece, cylinder_piece

SLIPPERY = Contact(sliding=0.3, torsional=0.005, rolling=0.001, priority=1)
"""The underside of what a gripper drags over the table, whatever the table is made of."""
GLAZED = Contact(sliding=0.5, torsional=0.005, rolling=0.0002)


def plate() -> ObjectModel:
    """A dinner plate with a steep rim that a gripper can take; near-white, a blue ring on the rim's inside."""
    outer, well, height, floor, wall = 0.100, 0.0900, 0.020, 0.0050, 0.0060
    foot = 0.0935
    walls = [
        (0.0, 0.0),
        (foot - 0.0015, 0.0),
        (foot, 0.0012),
        (outer, height - 0.002),
        (outer - 0.0008, height - 0.0006),
        (outer - wall / 2, height),
        (outer - wall + 0.0008, height - 0.0006),
        (outer - wall, height - 0.002),
        (outer - wall - 0.0022, height - 0.010),
        (well - 0.0012, floor + 0.0016),
        (well - 0.003, floor),
        (0.030, floor),
        (0.0, floor),
    ]
    white, blue = (0.95, 0.945, 0.92), (0.12, 0.30, 0.62)
    colours = [white] * 7 + [white, blue, white, white, white]
    pieces = [*_round_floor(well, floor), *_rim(foot, outer, wall, floor / 2, height, count=24)]
    return assemble(
        "plate",
        "plate",
        [Visual(lathe(walls, sides=48), _glazed(walls, colours))],
        pieces,
        mass=0.180,
        surface_z=floor,
        contact=GLAZED,
    )


def dish() -> ObjectModel:
    """A small round dish, straight-sided, teal."""
    outer, well, height, floor, wall = 0.0550, 0.0460, 0.026, 0.0050, 0.0045
    foot = 0.0500
    walls = [
        (0.0, 0.0),
        (foot - 0.0015, 0.0),
        (foot, 0.0012),
        (outer, height - 0.0015),
        (outer - wall / 2, height),
        (outer - wall, height - 0.0015),
        (well, floor + 0.0020),
        (well - 0.0022, floor),
        (0.0, floor),
    ]
    out, inside, lip = (0.10, 0.48, 0.52), (0.55, 0.80, 0.79), (0.07, 0.36, 0.42)
    colours = [out, out, out, lip, lip, inside, inside, inside]
    pieces = [*_round_floor(well, floor), *_rim(foot, outer, wall, floor / 2, height, count=16)]
    return assemble(
        "dish",
        "small dish",
        [Visual(lathe(walls, sides=40), _glazed(walls, colours))],
        pieces,
        mass=0.080,
        surface_z=floor,
        contact=GLAZED,
    )


def basket() -> ObjectModel:
    """An open wicker basket."""
    length, width, height, wall, floor, corner = 0.200, 0.140, 0.060, 0.006, 0.005, 0.020
    levels = [  # (how far inside the outline, height): outside up, over the rim, inside down
        (0.0015, 0.0),
        (0.0005, 0.003),
        (0.0005, height - 0.009),
        (-0.0010, height - 0.007),
        (-0.0012, height - 0.002),
        (0.0010, height),
        (wall - 0.0010, height),
        (wall + 0.0012, height - 0.002),
        (wall + 0.0010, height - 0.007),
        (wall - 0.0005, height - 0.009),
        (wall, floor - 0.001),
    ]
    rings = [
        np.column_stack([(xy := rounded_rectangle(length - 2 * d, width - 2 * d, corner - d)), np.full(len(xy), z)])
        for d, z in levels
    ]
    weave = textures.weave((0.80, 0.58, 0.32), (0.34, 0.20, 0.08), (4, 4), (128, 128))
    straw = Finish(texture=weave, specular=0.1)
    shell = loft(np.stack(rings)).tiled(13, 6)
    bottom = prism(rounded_rectangle(length - 2 * wall, width - 2 * wall, corner - wall), floor, 0.0005).mapped_as_box(
        0.045
    )
    return assemble(
        "basket",
        "basket",
        [Visual(shell, straw), Visual(bottom, straw)],
        _basket_pieces(length, width, height, wall, floor, corner),
        mass=0.120,
        surface_z=floor,
        contact=Contact(sliding=0.6),
    )


def _basket_pieces(length: float, width: float, height: float, wall: float, floor: float, corner: float) -> list[Piece]:
    """A floor, four walls, and a slanted post across each corner."""
    bottom = box_piece((length - 2 * wall, width - 2 * wall, floor), (0, 0, floor / 2))
    pieces = [replace(bottom, contact=SLIPPERY)]
    rise, middle = height - floor / 2, (height + floor / 2) / 2
    for sign in (-1, 1):
        pieces.append(box_piece((length - 2 * corner + 0.006, wall, rise), (0, sign * (width - wall) / 2, middle)))
        pieces.append(box_piece((wall, width - 2 * corner + 0.006, rise), (sign * (length - wall) / 2, 0, middle)))
    inset = corner - (corner - wall / 2) * np.cos(np.pi / 4) + 0.0008
    for sx, sy in ((1, 1), (-1, 1), (-1, -1), (1, -1)):
        at = (sx * (length / 2 - inset), sy * (width / 2 - inset), middle)
        pieces.append(box_piece((wall, 0.020, rise), at, rotation_z(np.arctan2(sy, sx))))
    return pieces


def towel() -> ObjectModel:
    """A small tea towel spread flat, heavy enough to stay where it is."""
    length, width, height = 0.160, 0.120, 0.004
    outline = _edge_points(rounded_rectangle(length, width, 0.004, corner_points=3), 0.008)
    ripple = 0.0005 * np.sin(2 * np.pi * 11 * np.arange(len(outline)) / len(outline))
    outline = outline * (1.0 + ripple / np.linalg.norm(outline, axis=1))[:, None]
    texture = textures.cloth((0.93, 0.90, 0.83), (0.74, 0.20, 0.18))
    return assemble(
        "towel",
        "towel",
        [
            Visual(
                prism(outline, height, 0.0012).mapped_from_above(),
                Finish(texture=texture, specular=0.02, shininess=0.05),
            )
        ],
        [box_piece((length, width, height), (0, 0, height / 2))],
        mass=0.40,
        fixed=True,
        contact=Contact(sliding=1.0),
    )


def _edge_points(outline: FloatArray, step: float) -> FloatArray:
    """A closed outline (S, 2) with points added so that none are more than `step` m apart."""
    points = []
    for start, end in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        parts = max(1, int(np.ceil(np.linalg.norm(end - start) / step)))
        points.append(start + (end - start) * (np.arange(parts) / parts)[:, None])
    return np.concatenate(points)


def _glazed(profile: list[tuple[float, float]], colours: list[Colour]) -> Finish:
    """A glaze with one colour for each stretch of a lathed `profile`."""
    lengths = np.linalg.norm(np.diff(np.asarray(profile), axis=0), axis=1)
    return Finish(texture=textures.bands(lengths, colours), specular=0.5, shininess=0.6)


def _round_floor(radius: float, height: float) -> list[Piece]:
    """The floor of a round vessel: a square slab, and a disc a hair lower that reaches the wall.

    The slab alone touches the table and bears what lies in the middle: boxes have few and exact contacts.
    """
    side = np.sqrt(2.0) * radius
    slab = box_piece((side, side, height), (0.0, 0.0, height / 2))
    return [
        replace(slab, contact=SLIPPERY),
        cylinder_piece(radius, height - 0.0012, (0.0, 0.0, height / 2)),
    ]


def _rim(foot: float, outer: float, wall: float, low: float, high: float, count: int) -> list[Piece]:
    """A ring of `count` boxes: a wall that leans out from radius `foot` at z = 0 to `outer` at z = `high`, m."""
    lean = np.arctan2(outer - foot, high)
    middle = (low + high) / 2
    along_z, thickness = (high - low) / np.cos(lean), wall * np.cos(lean)
    radius = foot + (outer - foot) * middle / high - wall / 2
    width = 2 * (radius + wall / 2) * np.tan(np.pi / count)
    c, s = np.cos(lean), np.sin(lean)
    leaning = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])  # turns +z towards +x
    pieces = []
    for yaw in 2 * np.pi * np.arange(count) / count:
        R = rotation_z(yaw)
        pieces.append(box_piece((thickness, width, along_z), R @ [radius, 0.0, middle], R @ leaning))
    return pieces
