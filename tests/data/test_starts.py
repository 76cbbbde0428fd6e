"""Plans of starts: repeatable, extendable, evenly spread, and never where an object may not begin."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from maniagent.data.reach import Reach
from maniagent.data.starts import GAP, Pattern, Region, Start, plan_starts
from maniagent.errors import UsageError
from maniagent.geometry import rotation_z
from maniagent.motion import ArmModel, MotionLimits
from maniagent.perception.views import Workspace
from maniagent.types import OrientedBox

PLATE = OrientedBox(np.array([0.3, 0.1, 0.01]), np.array([0.2, 0.16, 0.02]), 0.4)
SEEDS = st.integers(0, 2**32)


@pytest.fixture(scope="module")
def reach() -> Reach:
    return Reach(ArmModel(), MotionLimits())


@pytest.fixture(scope="module")
def region(reach: Reach) -> Region:
    return Region(reach, kept_free=(PLATE,))


def poses(starts: tuple[Start, ...]) -> tuple[np.ndarray, np.ndarray]:
    return np.array([start.xy for start in starts]), np.array([start.yaw for start in starts])


def shares(xy: np.ndarray) -> np.ndarray:
    """The share of points (N, 2) in each of many rectangles that begin at the table's corner."""
    corners = np.stack(np.meshgrid(*np.linspace([0.05, -0.35], [0.5, 0.35], 24).T), -1).reshape(-1, 1, 2)
    return np.all(xy <= corners, axis=-1).mean(axis=1)


@pytest.mark.parametrize("pattern", Pattern)
@given(seed=SEEDS, count=st.integers(1, 80))
@settings(max_examples=12)
def test_a_plan_is_the_same_every_time(region: Region, pattern: Pattern, seed: int, count: int) -> None:
    plan = plan_starts(region, count, pattern, seed)
    assert plan == plan_starts(region, count, pattern, seed)
    assert [start.index for start in plan] == list(range(len(plan)))


@pytest.mark.parametrize("pattern", [Pattern.SOBOL, Pattern.RANDOM])
@given(seed=SEEDS, n=st.integers(1, 400), more=st.integers(0, 400))
@settings(max_examples=20)
def test_a_plan_is_the_beginning_of_a_longer_one(
    region: Region, pattern: Pattern, seed: int, n: int, more: int
) -> None:
    assert plan_starts(region, n, pattern, seed) == plan_starts(region, n + more, pattern, seed)[:n]


@pytest.mark.parametrize("pattern", Pattern)
@pytest.mark.parametrize("width", [None, 0.03])
def test_every_start_can_be_picked_is_seen_whole_and_is_clear_of_what_is_kept_free(
    region: Region, pattern: Pattern, width: float | None
) -> None:
    region = replace(region, width=width)
    radius = region.reach.radius
    xy, yaw = poses(plan_starts(region, 150, pattern, seed=5))
    assert region.reach.contains(xy, yaw).all()
    seen = region.workspace
    assert np.all(xy >= np.array([seen.x[0], seen.y[0]]) + radius)
    assert np.all(xy <= np.array([seen.x[1], seen.y[1]]) - radius)
    side = np.stack(np.meshgrid(np.linspace(-1, 1, 31), np.linspace(-1, 1, 31)), -1).reshape(-1, 2)
    plate = (side * PLATE.extent[:2] / 2) @ rotation_z(PLATE.yaw)[:2, :2].T + PLATE.centre[:2]
    for place, turn in zip(xy, yaw, strict=True):
        axis = np.linspace(-1, 1, 30)[:, None] * (radius - (width or 2 * radius) / 2) * [np.cos(turn), np.sin(turn)]
        between = np.linalg.norm((place + axis)[:, None] - plate, axis=-1).min() - (width or 2 * radius) / 2
        assert between >= GAP - 0.003
    assert np.all((yaw > -math.pi) & (yaw <= math.pi))


def test_a_narrow_thing_may_lie_nearer_to_what_is_kept_free(region: Region) -> None:
    narrow = replace(region, width=0.03)
    xy, yaw = poses(plan_starts(replace(region, kept_free=()), 3000, Pattern.SOBOL))
    assert np.all(narrow.contains(xy, yaw) >= region.contains(xy, yaw))
    assert narrow.contains(xy, yaw).sum() > 1.1 * region.contains(xy, yaw).sum()


def test_sobol_is_more_even_than_random_also_after_what_is_out_of_reach_is_left_out(region: Region) -> None:
    of_area = shares(poses(plan_starts(region, 20_000, Pattern.RANDOM, seed=99))[0])

    def discrepancy(count: int, pattern: Pattern, seed: int) -> float:
        """The star discrepancy relative to the region: how far any rectangle's share of starts is from its area's."""
        return np.abs(shares(poses(plan_starts(region, count, pattern, seed))[0]) - of_area).max()

    for count in (50, 300):
        sobol, random = (
            np.median([discrepancy(count, pattern, seed) for seed in range(9)])
            for pattern in (Pattern.SOBOL, Pattern.RANDOM)
        )
        assert sobol < 0.6 * random, (count, sobol, random)


def test_yaws_are_as_even_as_places(region: Region) -> None:
    for pattern in (Pattern.SOBOL, Pattern.GRID):
        _, yaw = poses(plan_starts(region, 300, pattern))
        counts, _ = np.histogram(yaw, bins=12, range=(-math.pi, math.pi))
        assert counts.min() >= 0.75 * len(yaw) / 12
        assert counts.max() <= 1.25 * len(yaw) / 12


@pytest.mark.parametrize("pattern", Pattern)
def test_a_fixed_yaw_leaves_the_pattern_of_places(region: Region, pattern: Pattern) -> None:
    xy, yaw = poses(plan_starts(region, 100, pattern, yaw=0.3 + 2 * math.pi))
    assert np.allclose(yaw, 0.3)
    assert len(np.unique(xy, axis=0)) == len(xy)


def test_a_grid_has_at_least_what_was_asked_for_and_hardly_more(region: Region) -> None:
    for count in (1, 10, 100, 777):
        assert count <= len(plan_starts(region, count, Pattern.GRID)) <= 1.15 * count + 6


def test_a_grid_goes_to_and_fro_and_a_shuffled_one_holds_the_same_starts_in_another_order(region: Region) -> None:
    grid, shuffled = (
        np.column_stack(poses(plan_starts(region, 200, pattern, seed=3)))
        for pattern in (Pattern.GRID, Pattern.SHUFFLED_GRID)
    )
    assert sorted(map(tuple, grid)) == sorted(map(tuple, shuffled))
    step = [np.median(np.linalg.norm(np.diff(plan[:, :2], axis=0), axis=1)) for plan in (grid, shuffled)]
    pitch = np.diff(np.unique(grid[:, 0].round(6)))
    assert np.allclose(pitch, pitch[0], atol=1e-5)
    assert step[0] == pytest.approx(pitch[0], abs=1e-5)
    assert step[1] > 4 * step[0]


def test_a_rectangle_bounds_the_plan(reach: Reach) -> None:
    small = Region(reach, x=(0.2, 0.3), y=(-0.15, -0.05))
    for pattern in Pattern:
        xy, _ = poses(plan_starts(small, 60, pattern))
        assert np.all((xy >= [0.2, -0.15]) & (xy <= [0.3, -0.05]))


def test_a_line_and_a_point_are_regions_too(reach: Reach) -> None:
    line, _ = poses(plan_starts(Region(reach, x=(0.3, 0.3)), 20, Pattern.SOBOL))
    assert np.all(line[:, 0] == 0.3)
    assert np.ptp(line[:, 1]) > 0.2
    assert plan_starts(Region(reach, x=(0.3, 0.3), y=(0.0, 0.0)), 2, Pattern.SOBOL, yaw=0.0)[1].xy == (0.3, 0.0)


@pytest.mark.parametrize("pattern", Pattern)
@pytest.mark.parametrize(
    "where",
    [
        {"x": (0.46, 0.5), "y": (0.25, 0.3)},
        {"x": (0.6, 0.7)},
        {"workspace": Workspace(x=(0.6, 0.9))},
        {"kept_free": (OrientedBox(np.array([0.3, 0.0, 0.0]), np.array([2.0, 2.0, 0.1]), 0.0),)},
    ],
)
def test_a_region_without_a_place_is_refused_in_one_sentence(reach: Reach, pattern: Pattern, where: dict) -> None:
    with pytest.raises(UsageError, match="No place to begin at"):
        plan_starts(Region(reach, **where), 3, pattern)


def test_senseless_arguments_are_refused(region: Region, reach: Reach) -> None:
    for count, seed in ((0, 0), (-1, 0), (5, -1)):
        with pytest.raises(UsageError, match="seed of 0 or more"):
            plan_starts(region, count, Pattern.RANDOM, seed)
    with pytest.raises(UsageError, match="smaller one first"):
        Region(reach, x=(0.3, 0.2))
    for width in (0.0, -0.1, math.nan):
        with pytest.raises(UsageError, match="width"):
            Region(reach, width=width)
    with pytest.raises(UsageError, match="radians"):
        plan_starts(region, 3, yaw=math.inf)
