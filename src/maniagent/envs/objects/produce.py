"""Fruit, vegetables and an egg. Everything lies on z = 0, long axis along x, as `assemble` wants it; metres."""

from __future__ import annotations

import numpy as np

from ...geometry import FloatArray
from . import textures
from .mesh import Mesh, lathe, loft, merge, sweep
from .model import Finish, ObjectModel, Visual, assemble
from .pieces import Contact, box_piece, capsule_piece, ellipsoid_piece
from .shapes import FLAT, bow, capsules_along, lying, profile, resting, straight

ROUND = Contact(sliding=0.9, torsional=0.008, rolling=0.001)


def chili(colour: str) -> ObjectModel:
    """A curved chili pepper, "red" or "green", stem towards -x."""
    skin, stem = {
        "red": ((0.80, 0.05, 0.04), (0.25, 0.48, 0.10)),
        "green": ((0.22, 0.50, 0.07), (0.36, 0.42, 0.14)),
    }[colour]
    t, radius = profile(
        [0, 0.02, 0.06, 0.15, 0.35, 0.6, 0.8, 0.95, 1], np.array([0.5, 8, 11.4, 12.6, 12.2, 9.6, 6.6, 3.4, 1.0]) / 1000
    )
    curve = bow(0.106, 0.014, 60)
    xy = np.column_stack([np.interp(0.19 + 0.81 * t, np.linspace(0, 1, 60), curve[:, axis]) for axis in (0, 1)])
    neck, out = xy[0], (curve[0] - xy[0]) / np.linalg.norm(curve[0] - xy[0])
    root_z = 0.0105
    s = np.linspace(-0.004, 0.021, 9)
    stem_curve = np.column_stack([neck + s[:, None] * out, root_z + 6.0 * np.maximum(s, 0) ** 2])
    stalk = sweep(stem_curve, np.interp(s, [0, 0.004, 0.017, 0.021], [0.0034, 0.0025, 0.0026, 0.0034]), sides=10)
    shoulder = np.searchsorted(t, 0.11)
    calyx = sweep(
        np.concatenate([stem_curve[[2, 1]], np.column_stack([xy, radius - FLAT])[2:shoulder]]),
        np.concatenate([[0.0030, 0.0050], radius[2:shoulder] + np.linspace(0.001, 0.0003, shoulder - 2)]),
        sides=14,
    )
    pieces = capsules_along(xy, radius, (0, 0.27, 0.52, 0.66, 0.79, 0.9, 1))
    pieces.append(capsule_piece(stem_curve[2], stem_curve[-1] - [*(0.002 * out), 0.0], 0.0028))
    return assemble(
        f"{colour}_chili",
        f"{colour} chili pepper",
        [
            Visual(lying(xy, radius), Finish(skin, specular=0.7, shininess=0.75)),
            Visual(merge([stalk, calyx]).cut_below(0.0), Finish(stem, specular=0.15)),
        ],
        pieces,
        mass=0.030,
        contact=ROUND,
    )


def carrot() -> ObjectModel:
    """A carrot, leaves cut to a stub, towards -x."""
    t, radius = profile(
        [0, 0.02, 0.06, 0.2, 0.55, 0.85, 0.97, 1], np.array([0.5, 9, 13.2, 14.4, 11.4, 7.4, 4.0, 1.5]) / 1000, 28
    )
    xy = straight(-0.035, 0.096, t)
    stubs = [
        _leaf(np.array([-0.034, 0.0, 0.0142]), yaw, pitch, length)
        for yaw, pitch, length in (
            (0.0, 0.12, 0.025),
            (0.32, 0.02, 0.023),
            (-0.34, 0.0, 0.022),
            (0.15, 0.36, 0.021),
            (-0.2, -0.2, 0.021),
        )
    ]
    pieces = capsules_along(xy, radius, (0, 0.25, 0.48, 0.66, 0.83, 1))
    pieces.append(box_piece((0.020, 0.011, 0.007), (-0.047, 0.0, 0.0145)))
    pieces.append(box_piece((0.070, 0.005, 0.004), (0.010, 0.0, 0.002)))
    return assemble(
        "carrot",
        "carrot",
        [
            Visual(lying(xy, radius), Finish(texture=_carrot_skin(), specular=0.15)),
            Visual(merge(stubs), Finish((0.20, 0.50, 0.10), specular=0.1)),
        ],
        pieces,
        mass=0.060,
        contact=ROUND,
    )


def _carrot_skin() -> textures.Texture:
    """Orange with darker rings round the root, greenish at the crown."""
    height, width = 256, 32
    v, _ = textures.grid(height, width)
    rings = textures.noise(height, width, (44, 3), 11) ** 3
    shade = 0.5 * textures.noise(height, width, (8, 6), 12)
    skin = textures.blend((0.96, 0.46, 0.07), (0.90, 0.36, 0.03), shade)
    skin = textures.blend(skin, (0.62, 0.24, 0.03), 0.75 * rings)
    crown = (0.03 - v) * 30 * np.ones((1, width))
    return textures.to_texture(textures.blend(skin, (0.45, 0.40, 0.10), crown))


def _leaf(root: FloatArray, yaw: float, pitch: float, length: float) -> Mesh:
    """A leaf stalk that leaves `root` towards -x, turned by `yaw` and raised by `pitch` (rad)."""
    direction = np.array([-np.cos(yaw) * np.cos(pitch), np.sin(yaw) * np.cos(pitch), np.sin(pitch)])
    s = np.linspace(0.0, length, 5)
    return sweep(root + s[:, None] * direction, [0.0026, 0.0024, 0.0023, 0.0028, 0.0024], sides=7)


def eggplant() -> ObjectModel:
    """A small eggplant; its calyx and stem towards -x."""
    t, radius = profile(
        [0, 0.03, 0.12, 0.35, 0.6, 0.78, 0.9, 0.97, 1],
        np.array([1, 9.5, 13.4, 16.4, 18.3, 18.8, 16.2, 10.5, 3]) / 1000,
        28,
    )
    xy = straight(-0.041, 0.096, t)
    axis_z = float(radius.max()) - FLAT
    sepals = _sepals(xy, radius, axis_z)
    stem_x = np.linspace(-0.055, -0.038, 6)
    stem = sweep(
        np.column_stack([stem_x, np.zeros(6), axis_z + 16.0 * (stem_x + 0.038) ** 2]),
        np.array([4.2, 3.8, 3.6, 3.8, 4.6, 7.0]) / 1000,
        sides=10,
    )
    pieces = capsules_along(xy, radius, (0, 0.2, 0.4, 0.6, 0.8, 1), axis_z)
    pieces.append(capsule_piece((-0.051, 0, axis_z + 0.002), (-0.040, 0, axis_z), 0.0042))
    pieces.append(box_piece((0.034, 0.007, 0.010), (0.026, 0.0, 0.005)))
    return assemble(
        "eggplant",
        "eggplant",
        [
            Visual(resting(xy, radius, sides=24), Finish((0.27, 0.06, 0.30), specular=0.9, shininess=0.85)),
            Visual(merge([sepals, stem]), Finish((0.36, 0.52, 0.16), specular=0.1)),
        ],
        pieces,
        mass=0.090,
        contact=ROUND,
    )


def _sepals(xy: FloatArray, radius: FloatArray, axis_z: float) -> Mesh:
    """A star of five sepals that hugs the shoulder of a body along x."""
    angle = 2 * np.pi * np.arange(20) / 20
    tooth = (np.arange(20) % 4 == 0).astype(float) + 0.45 * (np.arange(20) % 2)
    rings = []
    for depth in (0.0, 0.35, 0.7, 1.0):
        x = xy[0, 0] - 0.0005 + 0.006 * depth + 0.022 * depth * tooth
        r = np.interp(x, xy[:, 0], radius) * (0.3 + 0.7 * min(1.0, 1.6 * depth)) + 0.0011
        rings.append(np.column_stack([np.broadcast_to(x, 20), r * np.cos(angle), axis_z + r * np.sin(angle)]))
    return loft(np.stack(rings))


def banana() -> ObjectModel:
    """A banana that lies on its side, bowed towards +y, stem towards -x."""
    t, radius = profile(
        [0, 0.03, 0.12, 0.24, 0.5, 0.78, 0.92, 0.97, 1], np.array([4, 4.2, 5.5, 12, 16, 14.6, 8, 4.2, 3]) / 1000, 30
    )
    curve = bow(0.126, 0.030, 80)
    steps = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=1))])
    xy = np.column_stack([np.interp(t * steps[-1], steps, curve[:, axis]) for axis in (0, 1)])
    yellow, green, brown = (0.98, 0.80, 0.10), (0.72, 0.74, 0.16), (0.25, 0.16, 0.06)
    skin = textures.along(
        [brown, brown, green, yellow, yellow, green, brown, brown], [0, 0.03, 0.06, 0.2, 0.87, 0.92, 0.945, 1]
    )
    body = sweep(np.column_stack([xy, radius - FLAT + 0.15 * (0.016 - radius)]), radius, sides=20, squareness=2.0)
    return assemble(
        "banana",
        "banana",
        [Visual(body.cut_below(0.0), Finish(texture=skin, specular=0.2))],
        capsules_along(xy, radius, (0, 0.1, 0.18, 0.29, 0.43, 0.57, 0.71, 0.83, 0.92, 1)),
        mass=0.110,
        contact=ROUND,
    )


def strawberry() -> ObjectModel:
    """A strawberry on its side, leaves towards -x."""
    t, radius = profile([0, 0.05, 0.2, 0.4, 0.7, 0.9, 1], np.array([2, 10, 13.6, 14.0, 10.2, 5.6, 1.5]) / 1000, 22)
    xy = straight(-0.0145, 0.032, t)
    axis_z = float(radius.max()) - FLAT
    crown = lathe(
        [(0.0, 0.004), (0.004, 0.0035), (0.013, 0.0), (0.0145, -0.0022), (0.006, 0.0012), (0, 0.001)],
        sides=12,
        wave=0.55,
    )
    turned = crown.vertices[:, [2, 0, 1]] * [-1.0, 1.0, 1.0] + [-0.0135, 0.0, axis_z]
    leaves = Mesh(turned, crown.faces[:, ::-1], crown.uv[:, ::-1]).cut_below(0.0)
    pieces = [
        capsule_piece((-0.0025, 0, axis_z), (0.0, 0, axis_z), axis_z - FLAT / 4),
        capsule_piece((0.002, 0, axis_z), (0.005, 0, axis_z), 0.0108),
        capsule_piece((0.007, 0, axis_z), (0.0105, 0, axis_z), 0.0066),
        box_piece((0.012, 0.007, 0.006), (-0.001, 0.0, 0.003)),
    ]
    return assemble(
        "strawberry",
        "strawberry",
        [
            Visual(resting(xy, radius), Finish(texture=_strawberry_skin(), specular=0.45, shininess=0.6)),
            Visual(leaves, Finish((0.20, 0.52, 0.12), specular=0.1)),
        ],
        pieces,
        mass=0.018,
        contact=ROUND,
    )


def _strawberry_skin() -> textures.Texture:
    """Red with rows of pale seeds, each in its pit."""
    height, width = 128, 128
    v, u = textures.grid(height, width)
    row = np.floor(v * 9)
    du = (u * 12 + 0.5 * (row % 2)) % 1.0 - 0.5
    dv = (v * 9) % 1.0 - 0.5
    seeds = np.exp(-((du / 0.13) ** 2) - (dv / 0.2) ** 2)
    pits = np.exp(-((du / 0.26) ** 2) - (dv / 0.34) ** 2)
    skin = textures.blend((0.86, 0.07, 0.08), (0.55, 0.02, 0.04), 0.7 * pits)
    return textures.to_texture(textures.blend(skin, (0.97, 0.82, 0.38), 1.2 * seeds))


def egg() -> ObjectModel:
    """A brown hen's egg on its side, blunt end towards -x."""
    t = (1 - np.cos(np.linspace(0, np.pi, 25))) / 2
    x = 0.052 * (t - 0.5)
    radius = 0.020 * np.sqrt(np.maximum(4 * t * (1 - t), 1e-5)) * (1.0 - 0.16 * (t - 0.42) / 0.5)
    radius *= 0.020 / radius.max()
    xy = np.column_stack([x, np.zeros_like(x)])
    axis_z = float(radius.max()) - FLAT
    shell = textures.speckled((0.89, 0.68, 0.50), (0.80, 0.57, 0.41), 0.12, cells=40)
    pieces = [
        ellipsoid_piece((0.052, 0.0388, 0.0388), (-0.0005, 0.0, axis_z)),
        box_piece((0.012, 0.008, 0.006), (-0.002, 0.0, 0.003)),
    ]
    return assemble(
        "egg",
        "egg",
        [Visual(resting(xy, radius, sides=28), Finish(texture=shell, specular=0.25, shininess=0.5))],
        pieces,
        mass=0.055,
        contact=ROUND,
    )


def corn() -> ObjectModel:
    """A corn cob, husk leaves peeled back towards -x."""
    t, radius = profile(
        [0, 0.04, 0.15, 0.4, 0.7, 0.88, 0.97, 1], np.array([9, 13.5, 16.2, 17.4, 16, 12.2, 7, 2.5]) / 1000, 28
    )
    xy = straight(-0.046, 0.103, t)
    axis_z = 0.0185
    pieces = capsules_along(xy, radius, (0, 0.35, 0.7, 0.88, 1), axis_z)
    pieces.append(capsule_piece((-0.0525, 0, axis_z), (-0.045, 0, axis_z), 0.0085))
    pieces.append(box_piece((0.060, 0.010, 0.008), (-0.008, 0.0, 0.004)))
    body = sweep(np.column_stack([xy, np.full(len(t), axis_z)]), radius, sides=28).cut_below(0.0004)
    return assemble(
        "corn",
        "corn cob",
        [
            Visual(body, Finish(texture=_kernels(), specular=0.45, shininess=0.6)),
            Visual(_husk(axis_z), Finish((0.45, 0.64, 0.20), specular=0.1)),
        ],
        pieces,
        mass=0.120,
        contact=ROUND,
    )


def _kernels() -> textures.Texture:
    """Rows of kernels, each round in its shading; rows run along the cob."""
    height, width = 256, 256
    v, u = textures.grid(height, width)
    column = np.floor(u * 14)
    du = (u * 14) % 1.0 - 0.5
    dv = (v * 22 + 0.5 * (column % 2)) % 1.0 - 0.5
    round_off = np.clip(1.0 - (np.abs(2 * du) ** 3.0 + np.abs(2 * dv) ** 3.0), 0.0, 1.0) ** 0.5
    hue = textures.noise(height, width, (22, 14), 21)
    kernel = textures.blend((0.99, 0.80, 0.16), (0.93, 0.64, 0.08), hue)
    return textures.to_texture(textures.blend((0.55, 0.36, 0.04), kernel, 0.15 + 0.85 * round_off))


def _husk(axis_z: float) -> Mesh:
    """A stalk and leaves that hug the lower part of the cob."""
    s = np.linspace(0.0, 1.0, 10)
    leaves = []
    for turn, length in ((0.35, 0.062), (2.0, 0.054), (3.4, 0.058), (4.9, 0.050)):
        x = -0.052 + length * s
        r = np.interp(x, [-0.053, -0.043, -0.030, 0.012], [0.006, 0.0142, 0.0176, 0.0184])
        half_width = 0.0125 * np.sin(np.pi * np.clip(0.16 + 0.84 * s, 0, 1)) ** 0.8 + 2e-4
        centre = np.column_stack([x, r * np.cos(turn), axis_z + r * np.sin(turn)])
        out = np.array([0.0, np.cos(turn), np.sin(turn)])
        leaf = sweep(centre, np.column_stack([half_width, np.full(10, 0.0009)]), sides=8, up=out)
        offset = leaf.vertices[:, 1:] - [0.0, axis_z]
        side = np.array([-np.sin(turn), np.cos(turn)])
        curl = 0.5 * (offset @ side) ** 2 / 0.018  # bends the leaf round the cob
        leaves.append(Mesh(leaf.vertices - curl[:, None] * out, leaf.faces, leaf.uv).cut_below(0.0))
    stalk_x = np.array([-0.061, -0.060, -0.052, -0.044, -0.040])
    stalk = sweep(
        np.column_stack([stalk_x, np.zeros(5), np.full(5, axis_z)]),
        np.array([6.5, 7.5, 8.2, 12.5, 13.0]) / 1000,
        sides=14,
    )
    return merge([stalk, *leaves])
