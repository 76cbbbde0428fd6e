"""The tabletop twin: an honest gymnasium environment, calibrated, repeatable, and silent about what it knows."""

from __future__ import annotations

import gc
import warnings
from collections.abc import Iterator
from typing import Any

import mujoco
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from maniagent import tasks
from maniagent.envs.cameras import CameraSpec
from maniagent.envs.scene import REACH_X, REACH_Y, Placement, Scene, place_objects, within_reach
from maniagent.envs.tabletop import TabletopEnv
from maniagent.errors import UsageError
from maniagent.geometry import (
    FloatArray,
    backproject,
    make_transform,
    project,
    rotation_z,
    top_down_rotation,
    transform_points,
)
from maniagent.motion import ArmModel, IKSolver
from maniagent.types import CameraFrame, Observation

SMALL = (CameraSpec("main", (0.74, 0.0, 0.54), (0.26, 0.0, 0.0), focal_length=60.0, width=64, height=48),)
BLOCK = {"name": "block", "kind": "block", "params": {"size": 0.04, "colour": "yellow"}}


def scene(*objects: dict[str, Any]) -> Scene:
    return Scene.model_validate({"objects": objects})


def at(x: float, y: float, yaw: float = 0.0) -> dict[str, Any]:
    return {"place": {"at": [x, y], "yaw": yaw}}


@pytest.fixture
def small() -> Iterator[TabletopEnv]:
    """One block, drawn anywhere, seen by one small camera."""
    env = TabletopEnv(scene(BLOCK), cameras=SMALL)
    yield env
    env.close()


@pytest.fixture(scope="module")
def clean() -> Iterator[TabletopEnv]:
    """One block at a known place, seen by both cameras without noise."""
    env = TabletopEnv(scene(BLOCK | at(0.30, 0.05, yaw=20.0)), noise=None)
    env.reset(seed=0)
    yield env
    env.close()


# gymnasium ----------------------------------------------------------------------------------------------------------


def test_gymnasium_accepts_it(small: TabletopEnv) -> None:
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", ".*Box (action|observation) space.*")  # metres and radians, not [-1, 1]
        check_env(small, skip_render_check=True)


def rollout(env: TabletopEnv, seed: int) -> list[dict[str, Any]]:
    observations = [env.reset(seed=seed)[0]]
    actions = np.array([*env.home, 0.03]) + np.random.default_rng(0).uniform(-0.3, 0.3, (4, 7))
    return [*observations, *(env.step(action)[0] for action in actions)]


def test_one_seed_gives_one_rollout_to_the_bit(small: TabletopEnv) -> None:
    first, again = rollout(small, seed=3), rollout(small, seed=3)
    fresh = TabletopEnv(small.scene, cameras=SMALL)
    elsewhere = rollout(fresh, seed=3)
    fresh.close()
    for one, *others in zip(first, again, elsewhere, strict=True):
        for other in others:
            for key, value in one.items():
                np.testing.assert_array_equal(value, other[key], err_msg=key)


def test_another_seed_gives_another_layout_and_other_noise(small: TabletopEnv) -> None:
    (first, _), (placed,) = small.reset(seed=1), small.layout
    (other, _), (moved,) = small.reset(seed=2), small.layout
    assert np.linalg.norm(placed.xy - moved.xy) > 0.01
    assert not np.array_equal(first["main_depth"], other["main_depth"])


def test_noise_goes_on_while_nothing_moves(small: TabletopEnv) -> None:
    small.reset(seed=0)
    first, second = (small.observe().main_frame.depth for _ in range(2))
    assert not np.array_equal(first, second, equal_nan=True)


def test_a_given_layout_is_set(small: TabletopEnv) -> None:
    (drawn,) = place_objects(small.scene, np.random.default_rng(9))
    chosen = Placement(drawn.name, drawn.model, np.array([0.25, -0.1]), np.radians(40.0), drawn.z)
    _, info = small.reset(options={"layout": (chosen,)})
    assert info["layout"] == (chosen,)
    T = small.truth()["block"].T_base_object
    np.testing.assert_allclose(T, make_transform(rotation_z(chosen.yaw), [0.25, -0.1, 0.02]), atol=1e-3)


def test_a_layout_of_other_objects_is_refused(small: TabletopEnv) -> None:
    (drawn,) = place_objects(small.scene, np.random.default_rng(9))
    stranger = Placement("cup", drawn.model, drawn.xy, drawn.yaw, drawn.z)
    with pytest.raises(UsageError, match="The layout should place block, each once"):
        small.reset(options={"layout": (stranger,)})


def test_objects_may_be_named_as_the_robots_parts() -> None:
    env = TabletopEnv(scene(BLOCK | {"name": "elbow"}, BLOCK | {"name": "left_finger_link"}), cameras=SMALL)
    env.reset(seed=0)
    assert list(env.truth()) == ["elbow", "left_finger_link"]
    np.testing.assert_allclose(env.robot_state().joint_positions, env.home, atol=1e-3)


def test_closing_twice_does_no_harm(small: TabletopEnv) -> None:
    small.reset(seed=0)
    small.close()
    small.close()


# Arm ----------------------------------------------------------------------------------------------------------------


def test_the_arm_follows_joint_targets(clean: TabletopEnv) -> None:
    clean.reset(seed=0)
    target = clean.home + np.array([0.5, 0.2, -0.2, 0.3, 0.3, -0.5])
    for _ in range(50):
        clean.advance(target, 0.02)
    state = clean.robot_state()
    np.testing.assert_allclose(state.joint_positions, target, atol=1e-3)
    assert state.gripper_opening == pytest.approx(0.02, abs=1e-4)
    np.testing.assert_allclose(clean.joint_velocities, 0.0, atol=1e-2)
    assert state.time == pytest.approx(0.6 + 50 * clean.period)


def test_the_tcp_is_where_kinematics_says(clean: TabletopEnv) -> None:
    clean.reset(seed=0)
    state = clean.robot_state()
    np.testing.assert_allclose(state.T_base_tcp, ArmModel().forward(state.joint_positions), atol=1e-6)


def test_actions_outside_the_action_space_are_clipped(small: TabletopEnv) -> None:
    small.reset(seed=0)
    beyond = np.array([*small.home, 1.0])
    beyond[0] = 100.0
    for _ in range(5):
        small.step(beyond)
    bounds = small.action_space
    np.testing.assert_allclose(small.data.ctrl[0], bounds.high[0])  # type: ignore[attr-defined]  # a Box
    assert small.robot_state().gripper_opening == pytest.approx(small.opening_range[1], abs=1e-3)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_actions_that_are_not_finite_move_nothing(small: TabletopEnv, bad: float) -> None:
    small.reset(seed=0)
    before = small.robot_state()
    with pytest.raises(UsageError, match="not finite; nothing moves"):
        small.step(np.array([bad, *small.home[1:], 0.03]))
    assert small.robot_state().time == before.time


def test_everywhere_within_reach_a_top_down_grasp_is_possible(clean: TabletopEnv) -> None:
    solver = IKSolver(ArmModel())
    rng = np.random.default_rng(0)
    spots = [xy for xy in rng.uniform((0.0, -0.42), (0.42, 0.42), (200, 2)) if within_reach(xy)]
    assert len(spots) > 50
    for x, y in spots:
        yaw = rng.uniform(-np.pi / 2, np.pi / 2)
        for z in (0.012, 0.12):
            solver.solve(make_transform(top_down_rotation(yaw), [x, y, z]), near=clean.home, jaw_symmetry=True)


# Pictures -----------------------------------------------------------------------------------------------------------


def yellow(frame: CameraFrame) -> FloatArray:
    """Base-frame points (N, 3) of the pixels that show the yellow block."""
    red, _, blue = np.moveaxis(frame.rgb.astype(int), -1, 0)
    points = backproject(frame.K, frame.depth)[(red > 150) & (blue < 90)]
    return transform_points(frame.T_base_camera, points)


@pytest.mark.parametrize("view", ["main", "side"])
def test_a_known_point_is_seen_where_calibration_says(clean: TabletopEnv, view: str) -> None:
    clean.reset(seed=0)
    frame = clean.observe().frames[view]
    top = transform_points(clean.truth()["block"].T_base_object, np.array([0.0, 0.0, 0.02]))
    point_camera = transform_points(frame.T_camera_base, top)
    u, v = np.round(project(frame.K, point_camera)).astype(int)
    red, green, blue = frame.rgb[v, u].astype(int)
    assert blue + 80 < green < red
    assert frame.depth[v, u] == pytest.approx(point_camera[2], abs=0.003)


@pytest.mark.parametrize("view", ["main", "side"])
def test_the_pictured_block_lies_within_millimetres_of_the_true_one(clean: TabletopEnv, view: str) -> None:
    clean.reset(seed=0)
    points = yellow(clean.observe().frames[view])
    T_base_block = clean.truth()["block"].T_base_object
    points_block = (points - T_base_block[:3, 3]) @ T_base_block[:3, :3]
    on_it = (np.abs(points_block) < 0.020 + 0.003).all(axis=1)
    assert len(points) > 300
    assert on_it.mean() > 0.95
    top = points_block[points_block[:, 2] > 0.018]
    np.testing.assert_allclose(top.mean(axis=0), [0.0, 0.0, 0.02], atol=0.003)


@pytest.mark.parametrize("view", ["main", "side"])
def test_at_home_the_arm_does_not_hide_the_table(clean: TabletopEnv, view: str) -> None:
    clean.reset(seed=0)
    frame = clean.observe().frames[view]
    grid = np.stack(np.meshgrid(np.linspace(*REACH_X, 26), np.linspace(*REACH_Y, 49)), axis=-1).reshape(-1, 2)
    away = [within_reach(xy) and np.hypot(*(xy - [0.30, 0.05])) > 0.1 for xy in grid]
    table = np.column_stack([grid[away], np.zeros(sum(away))])
    table_camera = transform_points(frame.T_camera_base, table)
    u, v = np.round(project(frame.K, table_camera)).astype(int).T
    assert np.mean(np.abs(frame.depth[v, u] - table_camera[:, 2]) < 0.01) > 0.98


def test_missing_depth_is_nan_to_agents_and_zero_to_gymnasium(small: TabletopEnv) -> None:
    observation, _ = small.reset(seed=0)
    lost = np.isnan(small.observe().main_frame.depth)
    assert 0.0 < lost.mean() < 1.0
    assert small.observation_space.contains(observation)
    assert (observation["main_depth"] == 0.0).any()


def test_the_film_is_the_main_view_without_noise(clean: TabletopEnv) -> None:
    clean.reset(seed=0)
    np.testing.assert_array_equal(clean.render(), clean.observe().main_frame.rgb)


# What is known, and to whom -----------------------------------------------------------------------------------------


def reachable(root: object) -> Iterator[object]:
    """Everything that an object refers to, directly or not, leaving out classes and modules."""
    seen: set[int] = set()
    stack = [root]
    while stack:
        thing = stack.pop()
        if id(thing) in seen or isinstance(thing, type) or type(thing).__name__ in ("module", "function"):
            continue
        seen.add(id(thing))
        yield thing
        stack.extend(gc.get_referents(thing))
        if isinstance(thing, np.ndarray) and thing.base is not None:
            stack.append(thing.base)


def test_an_observation_leads_to_nothing_of_the_simulator(clean: TabletopEnv) -> None:
    clean.reset(seed=0)
    found = list(reachable(clean.observe()))
    assert any(isinstance(thing, CameraFrame) for thing in found)
    assert not [thing for thing in found if isinstance(thing, TabletopEnv | mujoco.MjData | mujoco.MjModel)]


def test_an_observation_stays_what_it_was(clean: TabletopEnv) -> None:
    clean.reset(seed=0)
    before: Observation = clean.observe()
    joints, picture = before.robot.joint_positions.copy(), before.main_frame.rgb.copy()
    for _ in range(20):
        clean.advance(clean.home + 0.3, 0.02)
    clean.observe()
    np.testing.assert_array_equal(before.robot.joint_positions, joints)
    np.testing.assert_array_equal(before.main_frame.rgb, picture)


def test_truth_is_at_rest_and_untouched_after_a_reset() -> None:
    env = TabletopEnv(tasks.get("hungry").scene, cameras=SMALL)
    env.reset(seed=0)
    truth = env.truth()
    placed = {placement.name: placement for placement in env.layout}
    assert set(truth) == set(placed)
    for name, thing in truth.items():
        assert not thing.touched
        assert thing.speed < 0.01
        np.testing.assert_allclose(thing.T_base_object[:2, 3], placed[name].xy, atol=0.005)
        assert thing.T_base_object[2, 3] == pytest.approx(placed[name].z, abs=0.003)


def test_truth_tells_what_the_fingers_touch(small: TabletopEnv) -> None:
    small.reset(seed=0)
    T_base_block = small.truth()["block"].T_base_object
    solver = IKSolver(ArmModel())
    yaw = small.layout[0].yaw
    above, around = (
        solver.solve(
            make_transform(top_down_rotation(yaw), T_base_block[:3, 3] + [0, 0, z]), near=small.home, jaw_symmetry=True
        )
        for z in (0.1, 0.0)
    )

    def go(joints: FloatArray, opening: float) -> bool:
        """Whether the block is touched once the arm is there."""
        start = small.robot_state().joint_positions
        for share in [*np.linspace(0.0, 1.0, 60), *np.ones(20)]:
            small.advance(start + share * (joints - start), opening)
        return small.truth()["block"].touched

    open_, closed = small.opening_range[1], 0.036
    assert not go(above, open_)
    assert not go(around, open_)
    assert go(around, closed)
    assert go(above, closed)
    assert small.truth()["block"].T_base_object[2, 3] > 0.08
    go(around, closed)
    assert not go(around, open_)


@pytest.mark.parametrize("part", ["left_finger_link", "gripper_link"])
def test_a_thing_against_any_part_of_the_robot_is_touched(small: TabletopEnv, part: str) -> None:
    small.reset(seed=0)
    small.data.joint("object/block").qpos[:3] = small.data.body(part).xpos
    mujoco.mj_forward(small.model, small.data)
    assert small.truth()["block"].touched
