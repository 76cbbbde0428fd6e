"""Segments of rendered tables, with sensor noise, against what is true."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from tables import (
    BULGING,
    RIG,
    Look,
    again,
    arrange,
    block,
    draw,
    look,
    make_env,
    miscalibrated,
    true_yaw,
    turned,
    with_depth,
)

from maniagent.envs.objects import object_names
from maniagent.errors import CameraFailure
from maniagent.geometry import make_transform, top_down_rotation
from maniagent.motion import ArmModel, IKSolver
from maniagent.perception.heightmap import HeightMap
from maniagent.perception.rig import Rig
from maniagent.perception.segmentation import TableView, find_supports, segment

ELONGATED = ("red_chili", "green_chili", "carrot", "eggplant", "banana", "corn", "knife", "fork", "spoon", "marker")


# One thing, one segment, in the right place ---------------------------------------------------------------------------


def test_every_kind_of_object_is_one_segment(tables: list[Look]) -> None:
    assert {kind for seen in tables for kind in seen.truth} == set(object_names())
    for seen in tables:
        assert len(seen.view.segments) == len(seen.truth), f"{list(seen.truth)}: {_sizes(seen.view)}"


def test_segments_are_where_the_things_are(tables: list[Look]) -> None:
    for seen in tables:
        for kind in seen.truth:
            assert seen.offset(kind) < (0.009 if kind in BULGING else 0.006), kind


def test_extents_are_true_to_an_eighth_or_eight_millimetres(tables: list[Look]) -> None:
    for seen in tables:
        for kind, thing in seen.truth.items():
            error = np.abs(seen.segment_of(kind).extent - thing.model.extent)
            slack = 0.012 if kind in BULGING else 0.008
            assert (error < np.maximum(0.125 * np.asarray(thing.model.extent), slack)).all(), (kind, error)


def test_long_things_are_seen_to_lie_as_they_do(tables: list[Look]) -> None:
    for seen in tables:
        for kind in set(seen.truth) & set(ELONGATED):
            assert turned(seen.segment_of(kind).yaw, true_yaw(seen.truth[kind])) < np.radians(10), kind


def test_what_stands_on_the_table_rests_at_zero(tables: list[Look]) -> None:
    assert all(s.support_z == 0.0 and s.free_spot is None for seen in tables for s in seen.view.segments)


def test_segments_are_numbered_from_the_viewers_left(tables: list[Look]) -> None:
    for seen in tables:
        ys = [s.centre[1] for s in seen.view.segments]  # the main camera looks at the robot: its left is base -y
        assert ys == sorted(ys)


def test_masks_show_the_object_in_every_view(tables: list[Look]) -> None:
    seen = tables[0]
    for kind in seen.truth:
        masks = seen.segment_of(kind).masks
        assert set(masks) == set(seen.observation.frames)
        for name, mask in masks.items():
            frame = seen.observation.frames[name]
            assert mask.shape == frame.depth.shape
            uv = frame.K @ (frame.T_camera_base @ [*seen.segment_of(kind).centre, 1.0])[:3]
            rows, columns = np.nonzero(mask)
            assert np.hypot(columns.mean() - uv[0] / uv[2], rows.mean() - uv[1] / uv[2]) < 12


# Touching, and on top of one another ----------------------------------------------------------------------------------


@pytest.mark.parametrize("height", [0.03, 0.045])
def test_touching_blocks_of_different_colours_come_apart(height: float) -> None:
    seen = arrange(
        {
            "red": (block("red"), 0.25, 0.0, 0.0),
            "yellow": (block("yellow", (0.03, 0.03, height)), 0.25, 0.0302, 0.0),
            "blue": (block("blue"), 0.2802, 0.0, 0.0),
        }
    )
    assert len(seen.view.segments) == 3
    assert all(seen.offset(name) < 0.006 for name in seen.truth)


@pytest.mark.parametrize(
    ("top", "base", "level"),
    [
        ("carrot", "plate", 0.005),
        ("strawberry", "dish", 0.005),
        ("eggplant", "basket", 0.005),
        ("spoon", "towel", 0.004),
        ("knife", "plate", 0.005),
        (block("yellow"), block("blue", 0.055), 0.055),
    ],
    ids=str,
)
def test_what_lies_on_something_is_its_own_segment_and_rests_on_it(top: Any, base: Any, level: float) -> None:
    upper = (top if isinstance(top, dict) else {"kind": top}) | {"place": {"on": "base"}}
    for seen in draw({"base": base, "top": upper}, seeds=(0, 1, 2)):
        assert len(seen.view.segments) == 2, _sizes(seen.view)
        small, large = sorted(seen.view.segments, key=lambda s: float(np.prod(s.extent[:2])))
        assert np.linalg.norm(small.centre[:2] - seen.truth["top"].T_base_object[:2, 3]) < 0.010
        assert small.support_z == pytest.approx(level, abs=0.005)
        assert large.support_z == 0.0


def test_what_is_free_of_a_plate_is_away_from_what_lies_on_it() -> None:
    for seen in draw({"plate": "plate", "egg": {"kind": "egg", "place": {"on": "plate"}}}, seeds=(0, 1)):
        large = max(seen.view.segments, key=lambda s: float(s.extent[0]))
        assert large.free_spot is not None
        away = np.linalg.norm(large.free_spot - seen.truth["plate"].T_base_object[:2, 3])
        assert 0.04 < away < 0.08  # between the egg and the rim


# The robot, shadows, cameras ------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def lowered() -> Iterator[Look]:
    """The gripper pointing down, 5 cm above the table, a block and a fork beside it."""
    env = make_env({"block": block("red") | _at(0.28, -0.15), "fork": {"kind": "fork"} | _at(0.28, 0.15)})
    env.reset(seed=0)
    T = make_transform(top_down_rotation(0.3), [0.27, 0.0, 0.05])
    goal = IKSolver(ArmModel()).solve(T, env.home, jaw_symmetry=True)
    for fraction in np.linspace(0.0, 1.0, 60):
        env.advance(env.home + fraction * (goal - env.home), 0.04)
    env.settle(0.3)
    assert np.linalg.norm(env.robot_state().T_base_tcp[:3, 3] - T[:3, 3]) < 0.02
    yield look(env)
    env.close()


def test_neither_the_lowered_arm_nor_its_shadow_is_a_thing(lowered: Look) -> None:
    assert len(lowered.view.segments) == 2, _sizes(lowered.view)
    assert all(lowered.offset(name) < 0.006 for name in lowered.truth)


def test_without_its_kinematics_the_arm_would_be_seen(lowered: Look) -> None:
    blind = segment(lowered.observation, Rig(lambda points, state: np.zeros(len(points), bool)))
    assert len(blind.segments) > 2


def test_one_view_is_enough(tables: list[Look]) -> None:
    for seen in tables[::2]:
        if "basket" in seen.truth:  # from one side, its wall hides its bottom: they come apart
            continue
        frames = {seen.observation.main: seen.observation.main_frame}
        alone = again(seen, replace(seen.observation, frames=frames))
        assert len(alone.view.segments) == len(seen.truth), (list(seen.truth), _sizes(alone.view))
        assert all(alone.offset(kind) < 0.015 for kind in seen.truth)


@pytest.mark.parametrize("depth", [np.nan, 0.0, np.inf, 9.0])
def test_a_dead_side_camera_is_left_out(tables: list[Look], depth: float) -> None:
    found = segment(with_depth(tables[0].observation, "side", depth), RIG)
    assert len(found.segments) == len(tables[0].truth)
    assert all(set(s.masks) == {"main"} for s in found.segments)


@pytest.mark.parametrize("depth", [np.nan, 0.0, np.inf, 9.0])
def test_a_dead_main_camera_is_a_camera_failure(tables: list[Look], depth: float) -> None:
    with pytest.raises(CameraFailure, match="main camera"):
        segment(with_depth(tables[0].observation, "main", depth), RIG)


@pytest.mark.parametrize(
    ("height", "tilt"), [(0.005, 0.0), (-0.005, 0.0), (0.0, 0.5), (0.0, -0.5), (0.003, 0.3)], ids=str
)
def test_a_table_a_little_off_the_calibration_changes_nothing(tables: list[Look], height: float, tilt: float) -> None:
    c, s = np.cos(np.radians(tilt)), np.sin(np.radians(tilt))
    about_y = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    middle = np.array([0.27, 0.0, 0.0])
    T_error = make_transform(about_y, middle - about_y @ middle + [0.0, 0.0, height])
    for seen in tables[2:6]:
        off = again(seen, miscalibrated(seen.observation, T_error))
        assert len(off.view.segments) == len(seen.truth), _sizes(off.view)
        for kind, thing in seen.truth.items():
            assert off.offset(kind) < 0.012
            assert off.segment_of(kind).extent[2] == pytest.approx(thing.model.extent[2], abs=0.005)


def test_an_empty_table_has_no_segments(tables: list[Look]) -> None:
    seen = tables[0]
    everything = segment(seen.observation, Rig(lambda points, state: np.ones(len(points), bool)))
    assert everything.segments == ()


def test_noise_alone_changes_little() -> None:
    env = make_env({"block": block("red") | _at(0.28, 0.0), "banana": {"kind": "banana"} | _at(0.3, 0.15)})
    env.reset(seed=0)
    looks = [look(env) for _ in range(4)]
    env.close()
    for name in looks[0].truth:
        centres = np.array([seen.segment_of(name).centre for seen in looks])
        assert np.ptp(centres, axis=0).max() < 0.004


def _at(x: float, y: float) -> dict[str, Any]:
    return {"place": {"at": [x, y], "yaw": 20.0}}


def _sizes(view: TableView) -> list[list[float]]:
    return [(s.extent * 1000).round().tolist() for s in view.segments]


# What a thing rests on ------------------------------------------------------------------------------------------------


def made_grid(height: np.ndarray, hidden: np.ndarray | None = None) -> HeightMap:
    """A height map (X, Y) with the bare table wherever nothing stands and nothing hides it."""
    occupied = height > 0
    bare = ~occupied if hidden is None else ~occupied & ~hidden
    rgb = np.full((*height.shape, 3), 128, np.uint8)
    return HeightMap((0.1, -0.1), 0.002, height.astype(np.float32), rgb, occupied, bare)


def sink() -> tuple[np.ndarray, np.ndarray]:
    """Heights and labels of a tub (1: the rim, 2 and 3: two halves of its bottom) with a thing in its middle (4)."""
    height, labels = np.full((100, 100), 0.12), np.ones((100, 100), np.int32)
    for number, columns in ((2, slice(10, 50)), (3, slice(50, 90))):
        height[10:90, columns], labels[10:90, columns] = 0.07, number
    height[40:60, 35:65], labels[40:60, 35:65] = 0.10, 4
    return height, labels


def test_what_lies_across_two_regions_rests_at_their_height() -> None:
    height, labels = sink()
    level, below = find_supports(labels, made_grid(height))[4]
    assert (level, below in (2, 3)) == (pytest.approx(0.07), True)


def test_what_is_hidden_beside_a_thing_says_nothing_about_what_it_rests_on() -> None:
    height, labels = sink()
    hidden = np.zeros(height.shape, bool)
    hidden[30:40, 30:70] = hidden[40:60, 65:75] = True  # the thing's shadow in the camera's eyes
    height[hidden], labels[hidden] = 0.0, 0
    assert find_supports(labels, made_grid(height, hidden))[4][0] == pytest.approx(0.07)
    assert find_supports(labels, made_grid(height))[4] == (0.0, 0), "bare table there would say: it stands beside"


def test_neither_a_bottom_nor_a_rim_rests_on_the_other() -> None:
    height, labels = sink()
    supports = find_supports(labels, made_grid(height))
    assert [supports[region] for region in (1, 2, 3)] == [(0.0, 0)] * 3
