"""A toy duck and an open hand, melted together from balls and limbs. They stand on z = 0; metres."""

from __future__ import annotations

import numpy as np

from . import textures
from .implicit import ball, limb, melt, slab, surface
from .mesh import Mesh, merge, sweep
from .model import Finish, ObjectModel, Visual, assemble
from .pieces import Contact, box_piece, capsule_piece, ellipsoid_piece


def toy() -> ObjectModel:
    """A yellow toy duck that looks towards +x."""
    body = melt(
        [
            ball((0.046, 0.036, 0.028), (-0.003, 0, 0.0155)),
            limb((-0.018, 0, 0.018), (-0.026, 0, 0.028), 0.008, 0.0025),
            limb((0.010, 0, 0.026), (0.011, 0, 0.034), 0.010, 0.010),
            ball((0.026, 0.026, 0.026), (0.0110, 0, 0.0390)),
            ball((0.025, 0.006, 0.015), (-0.007, 0.0160, 0.0190)),
            ball((0.025, 0.006, 0.015), (-0.007, -0.0160, 0.0190)),
        ],
        0.005,
    )
    duck = surface(body, (-0.034, -0.026, -0.003), (0.030, 0.026, 0.056), 0.0028)
    beak = melt(
        [ball((0.014, 0.015, 0.0050), (0.0250, 0, 0.0372)), ball((0.010, 0.011, 0.004), (0.0240, 0, 0.0347))], 0.002
    )
    bill = surface(beak, (0.014, -0.011, 0.029), (0.036, 0.011, 0.043), 0.0018)
    eyes = merge([_bead((0.0195, side * 0.0090, 0.0440), 0.0026) for side in (-1, 1)])
    pieces = [
        ellipsoid_piece((0.046, 0.0385, 0.0274), (-0.003, 0, 0.0156)),
        ellipsoid_piece((0.026, 0.026, 0.026), (0.0110, 0, 0.0390)),
        capsule_piece((-0.018, 0, 0.018), (-0.0240, 0, 0.0255), 0.0042),
        ellipsoid_piece((0.016, 0.015, 0.006), (0.0240, 0, 0.0365)),
        capsule_piece((0.010, 0, 0.020), (0.011, 0, 0.036), 0.0105),
        box_piece((0.026, 0.018, 0.008), (-0.003, 0, 0.0056)),
    ]
    return assemble(
        "toy",
        "toy duck",
        [
            Visual(duck.cut_below(0.0016), Finish((0.99, 0.78, 0.06), specular=0.4, shininess=0.5)),
            Visual(bill, Finish((0.95, 0.40, 0.04), specular=0.3)),
            Visual(eyes, Finish((0.03, 0.03, 0.04), specular=0.8)),
        ],
        pieces,
        mass=0.030,
        contact=Contact(sliding=0.9, torsional=0.008, rolling=0.0006),
    )


def _bead(centre: tuple[float, float, float], radius: float) -> Mesh:
    angle = np.linspace(0.0, np.pi, 7)
    x = -radius * np.cos(angle)
    curve = np.column_stack([x, np.zeros(7), np.zeros(7)]) + centre
    return sweep(curve, np.maximum(radius * np.sin(angle), 1e-5), sides=10)


def hand() -> ObjectModel:
    """A right hand that lies open, palm up, fingers towards +x and the thumb towards -y; its palm is hollow."""
    fingers = [  # y of the knuckle, x and y of the tip, radius
        (-0.0300, 0.0650, -0.0395, 0.0080),
        (-0.0105, 0.0740, -0.0125, 0.0083),
        (0.0100, 0.0690, 0.0140, 0.0080),
        (0.0285, 0.0540, 0.0385, 0.0070),
    ]
    thenar, hypothenar = (
        ((-0.058, -0.016, 0.0130), (-0.028, -0.034, 0.0130)),
        ((-0.058, 0.021, 0.0115), (-0.020, 0.031, 0.0115)),
    )
    ridge = ((0.000, -0.030, 0.0102), (0.000, 0.029, 0.0102))
    parts = [
        slab((0.076, 0.072, 0.016), (-0.030, 0.0, 0.008), 0.0075),
        limb(*thenar, 0.0130, 0.0115),
        limb(*hypothenar, 0.0115, 0.0105),
        limb(*ridge, 0.0102, 0.0098),
        slab((0.034, 0.054, 0.025), (-0.080, 0.001, 0.0125), 0.0110),
    ]
    pieces = [
        box_piece((0.076, 0.070, 0.016), (-0.030, 0.0, 0.008)),
        capsule_piece(*thenar, 0.0122),
        capsule_piece(*hypothenar, 0.0110),
        capsule_piece(*ridge, 0.0100),
        box_piece((0.032, 0.049, 0.024), (-0.080, 0.001, 0.0125)),
    ]
    for y, tip_x, tip_y, r in fingers:
        knuckle = (0.006, y, 0.0105)
        middle = (0.006 + 0.52 * (tip_x - 0.006), y + 0.5 * (tip_y - y), r + 0.0012)
        tip = (tip_x, tip_y, r + 0.0045)
        parts += [limb(knuckle, middle, r + 0.0010, r), limb(middle, tip, r, r - 0.0010)]
        pieces += [capsule_piece(knuckle, middle, r + 0.0004), capsule_piece(middle, tip, r - 0.0010)]
    root, joint, end = (-0.044, -0.032, 0.0125), (-0.014, -0.054, 0.0125), (0.011, -0.061, 0.0145)
    parts += [limb(root, joint, 0.0120, 0.0098), limb(joint, end, 0.0098, 0.0080)]
    pieces += [capsule_piece(root, joint, 0.0106), capsule_piece(joint, end, 0.0080)]
    skin = surface(melt(parts, 0.006), (-0.105, -0.078, -0.006), (0.090, 0.056, 0.036), 0.0040)
    return assemble(
        "hand",
        "open hand",
        [Visual(skin.cut_below(0.0).mapped_from_above(), Finish(texture=_palm(), specular=0.1))],
        pieces,
        mass=2.5,
        surface_z=0.016,
        fixed=True,
        contact=Contact(sliding=1.0),
    )


def _palm() -> textures.Texture:
    """Skin from above, with the lines of the palm."""
    shade = 0.5 * textures.noise(128, 160, (14, 18), 31)
    rgb = textures.blend((0.91, 0.67, 0.54), (0.86, 0.55, 0.44), shade)
    return textures.to_texture(rgb)
