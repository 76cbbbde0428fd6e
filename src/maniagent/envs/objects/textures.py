"""Procedural textures: small uint8 images (H, W, 3). Rows run along v, columns along u. All are deterministic."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...geometry import FloatArray

Texture = NDArray[np.uint8]


def to_texture(rgb: FloatArray) -> Texture:
    """An image of floats in [0, 1] as uint8."""
    return np.round(255 * np.clip(rgb, 0.0, 1.0)).astype(np.uint8)


def blend(below: ArrayLike, above: ArrayLike, weight: FloatArray) -> FloatArray:
    """(H, W, 3) colours: `below` where `weight` (H, W) is 0, `above` where it is 1."""
    w = np.clip(weight, 0.0, 1.0)[..., None]
    return np.asarray(below, float) * (1.0 - w) + np.asarray(above, float) * w


def grid(height: int, width: int) -> tuple[FloatArray, FloatArray]:
    """The places v (H, 1) and u (1, W) in (0, 1) at the texels' centres."""
    return ((np.arange(height) + 0.5) / height)[:, None], ((np.arange(width) + 0.5) / width)[None, :]


def noise(height: int, width: int, cells: tuple[int, int], seed: int = 0) -> FloatArray:
    """Smooth noise (H, W) in [0, 1] with `cells` bumps along v and u; it tiles."""
    values = np.random.default_rng(seed).random(cells)
    v, u = grid(height, width)
    return _periodic(values, v * cells[0], u * cells[1])


def _periodic(values: FloatArray, y: FloatArray, x: FloatArray) -> FloatArray:
    """Smooth interpolation in a table that repeats."""
    i, j = np.floor(y).astype(int), np.floor(x).astype(int)
    fy, fx = y - i, x - j
    fy, fx = fy * fy * (3 - 2 * fy), fx * fx * (3 - 2 * fx)
    rows, columns = values.shape
    i0, i1, j0, j1 = i % rows, (i + 1) % rows, j % columns, (j + 1) % columns
    above = values[i0, j0] * (1 - fx) + values[i0, j1] * fx
    below = values[i1, j0] * (1 - fx) + values[i1, j1] * fx
    return above * (1 - fy) + below * fy


def wood(colour: ArrayLike, contrast: float = 0.22, size: int = 128) -> Texture:
    """Painted or plain wood: grain along u."""
    grain = 0.6 * noise(size, size, (24, 2), 1) + 0.4 * noise(size, size, (60, 3), 2)
    rings = 0.5 + 0.5 * np.sin(2 * np.pi * (5 * grid(size, size)[0] + 1.2 * noise(size, size, (3, 2), 3)))
    shade = 1.0 - contrast * (0.65 * grain + 0.35 * rings)
    return to_texture(np.asarray(colour, float) * shade[..., None])


def speckled(colour: ArrayLike, spots: ArrayLike, share: float, cells: int = 40, size: int = 128) -> Texture:
    """`colour` with soft `spots` over about `share` of it."""
    field = noise(size, size, (cells, cells), 4)
    return to_texture(blend(colour, spots, (field - (1.0 - share)) * 6.0))


def along(colours: ArrayLike, at: ArrayLike, height: int = 128, width: int = 64, mottle: float = 0.06) -> Texture:
    """Colours (K, 3) that change along v, each reached at its place in `at` (K,), a little mottled."""
    table = np.asarray(colours, float)
    v, _ = grid(height, width)
    rgb = np.stack([np.interp(v[:, 0], np.asarray(at, float), table[:, channel]) for channel in range(3)], axis=-1)
    shade = 1.0 - mottle * (noise(height, width, (10, 6), 5) + noise(height, width, (24, 12), 6) - 1.0)
    return to_texture(rgb[:, None, :] * shade[..., None])


def weave(light: ArrayLike, dark: ArrayLike, strands: tuple[int, int], size: tuple[int, int] = (128, 256)) -> Texture:
    """Basketwork: `strands` (along v, along u) that pass over and under each other, round in their shading."""
    height, width = size
    v, u = grid(height, width)
    row, column = np.floor(v * strands[0]), np.floor(u * strands[1])
    across_v, across_u = v * strands[0] - row - 0.5, u * strands[1] - column - 0.5
    over = (row + column) % 2 == 0
    lying = np.cos(np.pi * across_v) ** 0.7 * (0.55 + 0.45 * np.cos(np.pi * across_u))
    standing = np.cos(np.pi * across_u * 1.15).clip(0.0) ** 0.7 * (0.45 + 0.35 * np.cos(np.pi * across_v))
    shade = np.where(over, lying, np.maximum(standing, 0.55 * lying))
    return to_texture(blend(dark, light, shade * (0.85 + 0.3 * noise(height, width, (30, 40), 7))))


def bands(lengths: ArrayLike, colours: ArrayLike, height: int = 256) -> Texture:
    """Bands of plain colours (K, 3) one after the other along v, their widths in proportion to `lengths` (K,)."""
    edges = np.cumsum(np.asarray(lengths, float))
    v, _ = grid(height, 4)
    band = np.minimum(np.searchsorted(edges / edges[-1], v[:, 0]), len(edges) - 1)
    return to_texture(np.asarray(colours, float)[band][:, None, :].repeat(4, axis=1))


def cloth(base: ArrayLike, stripe: ArrayLike, size: tuple[int, int] = (192, 256)) -> Texture:
    """A woven towel with stripes across its long side (u) near both ends, and a fringe at the ends."""
    height, width = size
    v, u = grid(height, width)
    end = np.minimum(u, 1.0 - u)
    broad = (end > 0.12) & (end < 0.20)
    narrow = ((end > 0.085) & (end < 0.10)) | ((end > 0.22) & (end < 0.235))
    rgb = blend(base, stripe, (broad | narrow) * np.ones((height, 1)))
    waffle = 0.5 + 0.25 * np.cos(2 * np.pi * 32 * u) + 0.25 * np.cos(2 * np.pi * 24 * v)
    rgb = rgb * (0.86 + 0.12 * waffle + 0.04 * noise(height, width, (48, 64), 8))[..., None]
    gaps = (end < 0.035) * (0.5 + 0.5 * np.cos(2 * np.pi * 26 * v))
    return to_texture(blend(rgb, 0.5 * np.asarray(base, float), 0.8 * gaps))
