"""The measurements of a segment turn and move with its points."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tables import turned

from maniagent.geometry import FloatArray, rotation_z
from maniagent.perception.segments import Segment
from maniagent.types import GraspPose

ANGLES = st.floats(-np.pi, np.pi)
SHIFTS = st.tuples(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3))


def slab(length: float = 0.1, width: float = 0.04, height: float = 0.03, support_z: float = 0.0) -> FloatArray:
    """(N, 3) the top of an upright box about the origin, its long side along x."""
    x, y = np.meshgrid(np.linspace(-length / 2, length / 2, 51), np.linspace(-width / 2, width / 2, 21))
    return np.column_stack([x.ravel(), y.ravel(), np.full(x.size, support_z + height)])


def segment(points: FloatArray, support_z: float = 0.0) -> Segment:
    return Segment(points.astype(np.float32), np.full((len(points), 3), 90, np.uint8), support_z)


@given(ANGLES, SHIFTS)
def test_yaw_turns_and_the_centre_moves_with_the_points(angle: float, shift: tuple[float, float]) -> None:
    moved = segment(slab() @ rotation_z(angle).T + [*shift, 0.0])
    assert turned(moved.yaw, angle) < 1e-3
    np.testing.assert_allclose(moved.centre, [*shift, 0.015], atol=1e-4)
    np.testing.assert_allclose(moved.extent, [0.1, 0.04, 0.03], atol=1e-3)


@given(ANGLES)
def test_yaw_is_that_of_an_undirected_line(angle: float) -> None:
    assert -np.pi / 2 < segment(slab() @ rotation_z(angle).T).yaw <= np.pi / 2


@given(ANGLES, st.floats(0.01, 0.2), st.floats(0.01, 0.2))
def test_the_longer_side_comes_first(angle: float, a: float, b: float) -> None:
    extent = segment(slab(a, b) @ rotation_z(angle).T).extent
    assert extent[0] >= extent[1] - 1e-6
    np.testing.assert_allclose(extent[:2], sorted([a, b], reverse=True), rtol=0.02)


@given(st.floats(0.0, 0.2), st.floats(0.005, 0.2))
def test_height_counts_from_what_it_stands_on(support_z: float, height: float) -> None:
    raised = segment(slab(height=height, support_z=support_z), support_z)
    assert raised.extent[2] == pytest.approx(height, abs=1e-5)
    assert raised.centre[2] == pytest.approx(support_z + height / 2, abs=1e-5)
    assert raised.surface_z == pytest.approx(support_z + height, abs=1e-5)


def test_a_stray_point_stretches_nothing() -> None:
    points = np.concatenate([slab(), [[0.0, 0.2, 0.3]]])
    stretched = segment(points)
    assert stretched.extent[1] < 0.06
    assert stretched.extent[2] == pytest.approx(0.03, abs=1e-5)


def test_things_rest_on_a_vessels_bottom_not_its_rim() -> None:
    points = slab(0.1, 0.1)
    points[:, 2] = np.where(np.abs(points[:, :2]).max(axis=1) > 0.04, 0.03, 0.005)
    assert segment(points).surface_z == pytest.approx(0.005, abs=1e-6)
    assert segment(points).top_z == pytest.approx(0.03, abs=1e-6)


def test_what_is_flat_still_has_a_height() -> None:
    assert segment(slab(height=0.0)).extent[2] > 0.0


def test_colour_is_the_median_not_the_mean() -> None:
    colours = np.array([[200, 10, 10]] * 700 + [[0, 0, 0]] * 371, np.uint8)
    points = slab().astype(np.float32)
    assert Segment(points, colours).colour == (200, 10, 10)


def test_a_named_object_carries_all_measurements() -> None:
    made = segment(slab())
    grasp = GraspPose(np.eye(4), 0.03, 0.5)
    thing = made.to_object(3, "slab", (grasp,))
    assert (thing.index, thing.name, thing.grasps, thing.colour) == (3, "slab", (grasp,), made.colour)
    np.testing.assert_array_equal(thing.centre, made.centre)
    np.testing.assert_array_equal(thing.extent, made.extent)
    assert (thing.yaw, thing.surface_z, thing.free_spot) == (made.yaw, made.surface_z, None)


@given(ANGLES, st.floats(0.03, 0.2))
def test_a_round_thing_points_nowhere_and_is_as_wide_as_it_is(angle: float, diameter: float) -> None:
    x, y = np.meshgrid(*[np.linspace(-diameter / 2, diameter / 2, 61)] * 2)
    within = np.hypot(x, y) <= diameter / 2
    disc = np.column_stack([x[within], y[within], np.full(within.sum(), 0.02)])
    seen = segment(disc @ rotation_z(angle).T)
    assert min(abs(seen.yaw), abs(abs(seen.yaw) - np.pi / 2)) < 1e-9
    np.testing.assert_allclose(seen.extent[:2], diameter, rtol=0.06)
