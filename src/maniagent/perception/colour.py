"""Colour words as regions of a space in which light and shade change little.

In CIE L*a*b* (CIE 15:2018, section 8.2) a surface lit k times as strongly has L* + 16, a* and b* all scaled by the
cube root of k. So the hue angle and the ratio of chroma to L* + 16 belong to the surface, and lightness alone says
how it is lit: hue and that ratio tell red from orange, lightness is left for black, grey and white.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from ..geometry import FloatArray

HUE_SOFTNESS = 6.0
"""Degrees beyond its range over which a colour word fades out."""
SATURATION_SOFTNESS = 0.08
LIGHTNESS_SOFTNESS = 8.0


def hue_saturation_lightness(colours: NDArray[np.uint8]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Hue (degrees in [0, 360)), chroma / (L* + 16), and L* (0 to 100) of sRGB colours (N, 3); each (N,)."""
    lab = cv2.cvtColor(colours[None].astype(np.float32) / 255, cv2.COLOR_RGB2LAB)[0]
    hue = np.degrees(np.arctan2(lab[:, 2], lab[:, 1])) % 360
    return hue, np.hypot(lab[:, 1], lab[:, 2]) / (lab[:, 0] + 16), lab[:, 0]


def within(values: FloatArray, low: float, high: float, softness: float) -> FloatArray:
    """Membership in [0, 1] of a range: 1 inside, falling linearly to 0 over `softness` to either side."""
    return np.clip(1 - np.maximum(low - values, values - high) / softness, 0, 1)


def within_hue(hue: FloatArray, low: float, high: float) -> FloatArray:
    """Membership of a range of hues, degrees; `low` may be negative where red lies in the range."""
    middle, half = (low + high) / 2, (high - low) / 2
    off = np.abs((hue - middle + 180) % 360 - 180)
    return np.clip(1 - (off - half) / HUE_SOFTNESS, 0, 1)
