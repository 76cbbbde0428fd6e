"""Colour words hold in light and in shade."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maniagent.perception.colour import hue_saturation_lightness, within, within_hue


def shaded(rgb: np.ndarray, light: float) -> np.ndarray:
    """The sRGB colour (float, 0 to 1) of a surface lit `light` times as strongly."""
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4) * light
    return np.where(linear <= 0.0031308, linear * 12.92, 1.055 * linear ** (1 / 2.4) - 0.055)


@given(st.tuples(*[st.integers(60, 255)] * 3), st.floats(0.3, 1.0))
def test_hue_and_saturation_belong_to_the_surface_not_to_the_light(rgb: tuple[int, int, int], light: float) -> None:
    bright = np.array([rgb], np.uint8)
    dark = np.round(255 * shaded(bright / 255, light)).astype(np.uint8)
    hues, saturations, _ = hue_saturation_lightness(np.concatenate([bright, dark]))
    assert saturations[0] == pytest.approx(saturations[1], abs=0.06)
    if saturations[0] > 0.3:
        assert abs((hues[0] - hues[1] + 180) % 360 - 180) < 5


@given(st.floats(0, 360), st.floats(-40, 300), st.floats(1, 60))
def test_hue_ranges_go_round(hue: float, low: float, width: float) -> None:
    once, again = within_hue(np.array([hue, hue + 360]), low, low + width)
    assert once == pytest.approx(again)
    assert within_hue(np.array([low + width / 2]), low, low + width)[0] == 1.0


def test_membership_fades_over_the_softness() -> None:
    values = np.array([0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0])
    np.testing.assert_allclose(within(values, 1.0, 2.0, 1.0), [0, 0.5, 1, 1, 1, 0.5, 0])
