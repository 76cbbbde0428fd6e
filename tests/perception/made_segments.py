"""Segments made from a shape, a colour and a place: what the words' tests look at."""

from __future__ import annotations

import numpy as np

from maniagent.geometry import rotation_z
from maniagent.perception.segments import Segment

RGB = {
    "red": (176, 28, 24),
    "green": (52, 120, 40),
    "orange": (225, 110, 30),
    "yellow": (230, 195, 40),
    "blue": (28, 50, 150),
    "purple": (70, 22, 78),
    "beige": (222, 184, 145),
    "skin": (224, 172, 148),
    "brown": (125, 84, 45),
    "white": (238, 238, 234),
    "grey": (165, 166, 170),
}


def make(
    shape: str,
    extent: tuple[float, float, float],
    colours: dict[str, float] | str,
    xy: tuple[float, float] = (0.3, 0.0),
    yaw: float = 0.0,
    support_z: float = 0.0,
    light: float = 1.0,
    seed: int = 0,
) -> Segment:
    """The top side of a "box", "disc" (round or oval) or "vessel" (with a rim) as cameras see it.

    `colours` are shares along the long side; `light` scales linear RGB, on top of it comes a shade from top to side
    and pixel noise.
    """
    rng = np.random.default_rng(seed)
    count = 1500
    if shape == "box":
        local = rng.uniform(-1, 1, (count, 2))
    else:
        angle, radius = rng.uniform(0, 2 * np.pi, count), np.sqrt(rng.uniform(0, 1, count))
        local = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
    reach = np.linalg.norm(local, axis=1)
    if shape == "box":
        height = np.ones(count)
    elif shape == "vessel":
        height = np.where(reach > 0.85, 1.0, 0.2)
    else:
        height = np.sqrt(np.clip(1 - reach**2, 0, 1))
    xyz = np.column_stack([local * np.array(extent[:2]) / 2, support_z + height * extent[2]])
    shares = {colours: 1.0} if isinstance(colours, str) else colours
    borders = np.cumsum(list(shares.values())) / sum(shares.values())
    rank = np.argsort(np.argsort(local[:, 0])) / count  # shares of the surface, not of the length
    paint = np.array([RGB[name] for name in shares])[
        np.searchsorted(borders, rank, side="right").clip(max=len(shares) - 1)
    ]
    linear = (paint / 255.0) ** 2.2 * light * (0.6 + 0.4 * height)[:, None]
    rgb = 255 * linear ** (1 / 2.2) + rng.normal(0, 3, (count, 3))
    points = xyz @ rotation_z(yaw).T + np.array([*xy, 0.0])
    return Segment(points.astype(np.float32), rgb.clip(0, 255).astype(np.uint8), support_z)


def pepper(colour: str = "red", **place: object) -> Segment:
    other = "green" if colour == "red" else "red"
    return make("disc", (0.105, 0.026, 0.026), {colour: 0.9, **({other: 0.1} if colour == "red" else {})}, **place)  # type: ignore[arg-type]  # forwarded


def block(colour: str = "red", size: float = 0.03, **place: object) -> Segment:
    return make("box", (size, size, size), colour, **place)  # type: ignore[arg-type]  # forwarded


def plate(**place: object) -> Segment:
    return make("vessel", (0.2, 0.2, 0.02), "white", **place)  # type: ignore[arg-type]  # forwarded


THINGS = {
    "red pepper": ("disc", (0.105, 0.026, 0.026), {"red": 0.9, "green": 0.1}),
    "green pepper": ("disc", (0.105, 0.026, 0.026), "green"),
    "plate": ("vessel", (0.2, 0.2, 0.02), {"white": 0.93, "blue": 0.07}),
    "blue block": ("box", (0.055, 0.055, 0.055), "blue"),
    "yellow block": ("box", (0.03, 0.03, 0.03), "yellow"),
    "carrot": ("disc", (0.115, 0.03, 0.03), {"orange": 0.9, "green": 0.1}),
    "spoon": ("disc", (0.15, 0.033, 0.008), "grey"),
    "towel": ("box", (0.16, 0.12, 0.005), {"white": 0.7, "red": 0.3}),
    "eggplant": ("disc", (0.11, 0.038, 0.038), {"purple": 0.9, "green": 0.1}),
    "basket": ("box", (0.2, 0.14, 0.06), "brown"),
    "banana": ("disc", (0.13, 0.042, 0.032), "yellow"),
    "marker": ("box", (0.12, 0.016, 0.016), {"blue": 0.6, "white": 0.4}),
    "strawberry": ("disc", (0.035, 0.03, 0.03), {"red": 0.8, "green": 0.2}),
    "dish": ("vessel", (0.11, 0.11, 0.027), "blue"),
    "toy": ("disc", (0.055, 0.036, 0.05), "yellow"),
    "egg": ("disc", (0.052, 0.04, 0.04), "beige"),
    "corn": ("disc", (0.12, 0.038, 0.038), {"yellow": 0.6, "green": 0.4}),
    "knife": ("box", (0.15, 0.019, 0.008), "grey"),
    "fork": ("box", (0.15, 0.0245, 0.008), "grey"),
    "hand": ("disc", (0.17, 0.1, 0.025), "skin"),
}
"""What each noun looks like, roughly as in the twin: shape, extent, colours."""
