"""The map from above: topmost surface of all views, small gaps closed, specks gone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maniagent.geometry import FloatArray
from maniagent.perception.heightmap import HeightMap, build_height_map
from maniagent.perception.views import ViewPoints, Workspace

WORKSPACE = Workspace(x=(0.1, 0.3), y=(-0.1, 0.1))
CELL = 0.002


def view(points: FloatArray, colour: tuple[int, int, int] = (200, 30, 30), name: str = "main") -> ViewPoints:
    """Points (N, 3) of one colour, as one view's foreground."""
    colours = np.tile(np.array(colour, np.uint8), (len(points), 1))
    return ViewPoints(
        name, (480, 640), np.arange(len(points)), points.astype(np.float32), colours, np.empty((0, 2), np.float32)
    )


def square(x: float, y: float, z: float, side: float = 0.03, step: float = 0.001) -> FloatArray:
    """(N, 3) a level square of points about (x, y)."""
    offsets = np.arange(-side / 2, side / 2, step) + step / 2
    grid = np.stack(np.meshgrid(offsets, offsets), axis=-1).reshape(-1, 2)
    return np.column_stack([grid + np.array([x, y]), np.full(len(grid), z)])


def build(*views: ViewPoints) -> HeightMap:
    return build_height_map(views, WORKSPACE, CELL)


@pytest.mark.parametrize("views", [(), (view(np.empty((0, 3))),)], ids=["no view", "nothing seen"])
def test_an_empty_table_is_an_empty_map(views: tuple[ViewPoints, ...]) -> None:
    grid = build(*views)
    assert grid.height.shape == (100, 100)
    assert not grid.occupied.any()
    assert not grid.height.any()


def test_a_surface_stands_where_its_points_are() -> None:
    grid = build(view(square(0.2, 0.02, 0.04)))
    xy = grid.positions(*np.nonzero(grid.occupied))
    np.testing.assert_allclose(xy.mean(axis=0), [0.2, 0.02], atol=CELL / 2)
    np.testing.assert_allclose(np.ptp(xy, axis=0) + CELL, 0.03, atol=CELL)
    assert np.median(grid.height[grid.occupied]) == pytest.approx(0.04)
    assert (grid.rgb[grid.occupied] == (200, 30, 30)).all()


def test_a_gap_through_which_the_table_is_seen_parts_two_things() -> None:
    left, right = square(0.19, 0.0, 0.03, side=0.02), square(0.216, 0.0, 0.03, side=0.024)
    between = np.column_stack([np.full(40, 0.202), np.linspace(-0.02, 0.02, 40)])
    both = view(np.concatenate([left, right]))
    seen = replace(both, bare=between.astype(np.float32))
    grid = build_height_map([seen], WORKSPACE, CELL, trust_bare=True)
    row, column = grid.cells(np.array([0.202, 0.0]))
    assert not grid.occupied[row, column]
    assert grid.bare[row, column]
    assert build_height_map([both], WORKSPACE, CELL, trust_bare=True).occupied[row, column], "a hidden gap is closed"
    assert build_height_map([seen], WORKSPACE, CELL).occupied[row, column], "noisy depth isn't trusted"


def test_the_topmost_surface_wins_whichever_view_saw_it_first() -> None:
    low = view(square(0.2, 0.0, 0.01, side=0.06), (20, 20, 200))
    high = view(square(0.2, 0.0, 0.05), (200, 20, 20), "side")
    for grid in (build(low, high), build(high, low)):
        row, column = grid.cells(np.array([0.2, 0.0]))
        assert grid.height[row, column] == pytest.approx(0.05)
        assert tuple(grid.rgb[row, column]) == (200, 20, 20)
        row, column = grid.cells(np.array([0.225, 0.0]))
        assert grid.height[row, column] == pytest.approx(0.01)
        assert tuple(grid.rgb[row, column]) == (20, 20, 200)


def test_gaps_of_a_few_cells_are_closed_from_around_them() -> None:
    points = square(0.2, 0.0, 0.04)
    holed = points[(np.abs(points[:, 0] - 0.2) > 0.004) | (np.abs(points[:, 1]) > 0.002)]
    grid = build(view(holed))
    row, column = grid.cells(np.array([0.2, 0.0]))
    assert grid.occupied[row, column]
    assert grid.height[row, column] == pytest.approx(0.04, abs=1e-4)
    assert tuple(grid.rgb[row, column]) == pytest.approx((200, 30, 30), abs=2)


def test_things_a_finger_apart_do_not_grow_together() -> None:
    grid = build(view(np.concatenate([square(0.2, -0.021, 0.04), square(0.2, 0.021, 0.04)])))
    row, column = grid.cells(np.array([0.2, 0.0]))
    assert not grid.occupied[row, column]


def test_single_wrong_points_leave_no_trace() -> None:
    rng = np.random.default_rng(0)
    specks = np.column_stack([rng.uniform([0.12, -0.08], [0.28, 0.08], (12, 2)), np.full(12, 0.1)])
    assert not build(view(specks)).occupied.any()


def test_one_pixels_peak_is_flattened() -> None:
    peaked = np.concatenate([square(0.2, 0.0, 0.04), [[0.2, 0.0, 0.2]]])
    assert build(view(peaked)).height.max() < 0.05


def test_points_below_the_table_count_as_on_it() -> None:
    assert build(view(square(0.2, 0.0, -0.005))).height.min() == 0.0


@given(st.integers(0, 99), st.integers(0, 99))
def test_cells_and_positions_are_inverse(row: int, column: int) -> None:
    grid = build()
    assert tuple(grid.cells(grid.positions(np.array(row), np.array(column)))) == (row, column)


@given(st.floats(-2, 2), st.floats(-2, 2))
def test_points_off_the_map_belong_to_its_border(x: float, y: float) -> None:
    grid = build()
    row, column = grid.cells(np.array([x, y]))
    assert 0 <= row < 100
    assert 0 <= column < 100
    inside = 0.1 <= x < 0.3 and -0.1 <= y < 0.1
    if inside:
        assert np.abs(grid.positions(row, column) - [x, y]).max() <= CELL / 2 + 1e-9


def test_lab_is_smooth_inside_and_blind_to_the_outside() -> None:
    grid = build(view(square(0.2, 0.0, 0.04)))
    inside = grid.lab[grid.occupied]
    assert np.ptp(inside, axis=0).max() < 1.0  # no dark seam towards the empty cells
