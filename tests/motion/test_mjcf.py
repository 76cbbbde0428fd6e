"""The MJCF against the published figures, and its servos against the real arm's behaviour."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from arms import PhysicsArm, top_down

from maniagent.assets import WX250S_XML
from maniagent.motion import ArmModel, IKSolver
from maniagent.types import OrientedBox


@pytest.fixture(scope="module")
def mjcf() -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_path(str(WX250S_XML))


def test_links_are_as_long_as_published(mjcf: mujoco.MjModel) -> None:
    offsets = {
        "shoulder_link": [0, 0, 0.072],
        "upper_arm_link": [0, 0, 0.03865],
        "upper_forearm_link": [0.04975, 0, 0.25],
        "lower_forearm_link": [0.175, 0, 0],
        "wrist_link": [0.075, 0, 0],
        "gripper_link": [0.065, 0, 0],
    }
    for body, offset in offsets.items():
        np.testing.assert_allclose(mjcf.body(body).pos, offset)
    np.testing.assert_allclose(mjcf.site("tcp").pos, [0.043 + 0.023 + 0.027575, 0, 0])


def test_weighs_what_is_published(mjcf: mujoco.MjModel) -> None:
    assert mjcf.body_mass.sum() == pytest.approx(2.135, abs=0.005)


def test_is_made_of_primitives_and_includes_no_scene(mjcf: mujoco.MjModel) -> None:
    assert mjcf.nmesh == mjcf.nlight == mjcf.ncam == mjcf.ntex == 0
    assert not np.isin(mujoco.mjtGeom.mjGEOM_PLANE, mjcf.geom_type)


def test_looks_never_collide_and_collision_shapes_have_a_group_of_their_own(mjcf: mujoco.MjModel) -> None:
    looks = mjcf.geom_contype == 0
    assert set(mjcf.geom_group[looks]) == {1}
    assert set(mjcf.geom_group[~looks]) == {3}


@pytest.mark.parametrize("q", [0.015, 0.02, 0.037])
def test_pad_gap_follows_the_finger_joint(mjcf: mujoco.MjModel, q: float) -> None:
    data = mujoco.MjData(mjcf)
    data.qpos[6:8] = q
    mujoco.mj_kinematics(mjcf, data)
    left, right = mjcf.geom("left_pad"), mjcf.geom("right_pad")
    gap = data.geom("left_pad").xpos[1] - left.size[1] - data.geom("right_pad").xpos[1] - right.size[1]
    assert gap == pytest.approx(2 * (q - 0.013), abs=1e-9)
    np.testing.assert_allclose(data.geom("left_pad").xpos[[0, 2]], data.site("tcp").xpos[[0, 2]], atol=1e-6)


def test_home_is_compact_and_free_of_contact(mjcf: mujoco.MjModel) -> None:
    data = mujoco.MjData(mjcf)
    mujoco.mj_resetDataKeyframe(mjcf, data, mjcf.key("home").id)
    mujoco.mj_forward(mjcf, data)
    np.testing.assert_allclose(data.site("tcp").xpos, [0.2, 0.0, 0.24], atol=1e-3)
    assert data.ncon == 0


def test_attaches_to_a_larger_scene() -> None:
    scene = mujoco.MjSpec()
    scene.option.integrator, scene.option.cone = mujoco.mjtIntegrator.mjINT_IMPLICITFAST, mujoco.mjtCone.mjCONE_ELLIPTIC
    scene.option.impratio = 10
    frame = scene.worldbody.add_frame(pos=[1.0, 0.0, 0.5])
    scene.attach(mujoco.MjSpec.from_file(str(WX250S_XML)), prefix="arm/", frame=frame)
    model = scene.compile()
    np.testing.assert_allclose(model.body("arm/base_link").pos, [1.0, 0.0, 0.5])


def test_servos_follow_with_a_short_lag_and_no_overshoot(model: ArmModel) -> None:
    arm, step = PhysicsArm(), np.array([0.3, 0.2, 0.2, 0.3, -0.2, 0.4])
    goal, start = model.home + step, model.home
    progress = []
    for _ in range(60):
        arm.command(goal, 0.048)
        progress.append((arm.read().joint_positions - start) / step)
    time_constant = np.argmax(np.array(progress) > 1 - np.exp(-1), axis=0) * arm.period
    assert np.all((time_constant >= 0.04) & (time_constant <= 0.12)), time_constant
    assert np.max(progress) < 1.02
    np.testing.assert_allclose(arm.read().joint_positions, goal, atol=2e-3)


@pytest.mark.parametrize(("width", "depth"), [(0.006, 0.02), (0.03, 0.03), (0.045, 0.03)])
def test_grip_lifts_thin_and_wide_boxes(model: ArmModel, width: float, depth: float) -> None:
    arm = PhysicsArm([OrientedBox(np.array([0.3, 0.0, depth / 2]), np.array([0.04, width, depth]), 0.0)])
    solver = IKSolver(model)
    down, up = (solver.solve(top_down(0.3, 0.0, z), model.home) for z in (0.016, 0.12))
    arm.data.qpos[:6] = down
    for _ in range(50):
        arm.command(down, model.min_opening)
    opening = arm.read().gripper_opening
    assert opening == pytest.approx(width, abs=0.0012)
    for share in np.linspace(0, 1, 100):
        arm.command((1 - share) * down + share * up, model.min_opening)
    for _ in range(50):
        arm.command(up, model.min_opening)
    assert arm.box_position(0)[2] == pytest.approx(depth / 2 + 0.104, abs=0.004)


def test_force_at_the_pads_is_capped_and_shows_what_is_held(model: ArmModel) -> None:
    empty, full = PhysicsArm(), PhysicsArm([OrientedBox(np.array([0.3, 0.0, 0.015]), np.array([0.03] * 3), 0.0)])
    full.data.qpos[:6] = down = IKSolver(model).solve(top_down(0.3, 0.0, 0.016), model.home)
    for _ in range(50):
        empty.command(model.home, model.min_opening)
        full.command(down, model.min_opening)
    assert empty.read().gripper_opening == pytest.approx(model.min_opening, abs=1e-4)
    assert empty.read().gripper_effort < 0.2
    assert full.read().gripper_effort == pytest.approx(12.0)
