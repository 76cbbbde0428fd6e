from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest
from arms import top_down
from hypothesis import given
from hypothesis import strategies as st

from maniagent.assets import WX250S_XML
from maniagent.errors import MotionRejected
from maniagent.geometry import FloatArray, rotation_angle
from maniagent.motion import ArmModel, IKSolver
from maniagent.motion.closed_form import ArmDimensions, postures

MODEL = ArmModel()
SOLVER = IKSolver(MODEL)
POSTURES = st.lists(st.floats(0.0, 1.0), min_size=6, max_size=6).map(
    lambda shares: MODEL.lower + np.array(shares) * (MODEL.upper - MODEL.lower)
)


def errors(model: ArmModel, q: FloatArray, T: FloatArray) -> tuple[float, float]:
    """m and rad."""
    reached = model.forward(q)
    return float(np.linalg.norm(reached[:3, 3] - T[:3, 3])), rotation_angle(reached[:3, :3].T @ T[:3, :3])


@given(POSTURES)
def test_every_posture_of_the_closed_form_that_is_within_reach_reaches_the_pose(q: FloatArray) -> None:
    T = MODEL.forward(q)
    for other in postures(ArmDimensions.of(MODEL), T, roll_if_free=q[3]):
        metres, radians = errors(MODEL, other, T)
        assert metres < 1e-6
        assert radians < 2e-6


@given(POSTURES)
def test_a_pose_reached_by_a_posture_is_solved_to_a_posture_no_further_away(q: FloatArray) -> None:
    T = MODEL.forward(q)
    found = SOLVER.solve(T, near=q)
    metres, radians = errors(MODEL, found, T)
    assert metres < 1e-3
    assert radians < np.radians(0.5)
    assert np.abs(found - q).max() < 1e-3
    assert MODEL.within_limits(found)


def test_thousand_reachable_top_down_poses_are_solved() -> None:
    rng, tried, solved = np.random.default_rng(0), 0, 0
    while tried < 1000:
        x, y, z, yaw = rng.uniform([0.05, -0.36, -0.005, -np.pi], [0.5, 0.36, 0.3, np.pi])
        reach = np.hypot(np.hypot(x, y), z + 0.158575 - 0.11065)
        if not 0.15 < reach < 0.5:
            continue
        tried += 1
        q = SOLVER.solutions(top_down(x, y, z, yaw), MODEL.home)
        solved += bool(q) and errors(MODEL, q[0], top_down(x, y, z, yaw))[0] < 1e-3
    assert solved >= 995


def test_jaw_symmetry_takes_the_shorter_way() -> None:
    T = top_down(0.3, 0.0, 0.1, yaw=np.pi - 0.1)
    plain = SOLVER.solve(T, MODEL.home)
    short = SOLVER.solve(T, MODEL.home, jaw_symmetry=True)
    assert abs(short[5]) < 0.2 < abs(plain[5])
    np.testing.assert_allclose(MODEL.forward(short)[:3, 3], T[:3, 3], atol=1e-3)
    np.testing.assert_allclose(np.abs(MODEL.forward(short)[:3, 1]), np.abs(T[:3, 1]), atol=1e-3)


@pytest.mark.parametrize(
    ("T", "reason"),
    [
        (top_down(0.5, 0.36, 0.1), r"cm beyond the arm's reach"),
        (top_down(0.0, 0.0, -0.047), r"cm too close|past its limit"),
        (np.full((4, 4), np.nan), r"not finite"),
    ],
)
def test_says_why_a_pose_is_out_of_reach(T: FloatArray, reason: str) -> None:
    with pytest.raises(MotionRejected, match=reason):
        SOLVER.solve(T, MODEL.home)


def test_names_the_joint_whose_limit_is_in_the_way() -> None:
    upside_down = top_down(0.3, 0.0, 0.1)
    upside_down[:3, 0] *= -1
    upside_down[:3, 1] *= -1
    with pytest.raises(MotionRejected, match=r"At \(0.300, 0.000, 0.100\) m the \w+ joint would be \d+ degrees past"):
        SOLVER.solve(upside_down, MODEL.home)


def test_joint_margin_is_kept(model: ArmModel) -> None:
    careful = IKSolver(model, joint_margin=0.2)
    q = np.array([0.0, 0.0, 0.0, 0.0, 0.5, model.upper[5] - 0.1])
    assert not any(np.abs(found[5] - q[5]) < 1e-3 for found in careful.solutions(model.forward(q), q))


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory: pytest.TempPathFactory) -> ArmModel:
    """An arm as a calibration might describe it: links a little longer, axes a little off."""
    spec = mujoco.MjSpec.from_file(str(WX250S_XML))
    for name, offset in (
        ("upper_forearm_link", [0.0015, 0.001, -0.002]),
        ("wrist_link", [0.001, -0.001, 0.0015]),
        ("gripper_link", [0.0, 0.0012, 0.0008]),
    ):
        body = spec.body(name)
        body.pos = np.asarray(body.pos) + offset
    spec.joint("wrist_angle").axis = [0.01, 1.0, 0.006]
    path: Path = tmp_path_factory.mktemp("calibrated") / "arm.xml"
    path.write_text(spec.to_xml())
    return ArmModel(path)


def test_calibrated_arm_is_solved_where_the_closed_form_is_not_exact(calibrated: ArmModel) -> None:
    solver, rng, solved = IKSolver(calibrated), np.random.default_rng(1), 0
    for _ in range(60):
        T = top_down(*rng.uniform([0.2, -0.2, 0.02, -np.pi], [0.35, 0.2, 0.2, np.pi]))
        assert errors(calibrated, next(iter(postures(ArmDimensions.of(calibrated), T))), T)[0] > 5e-4
        found = solver.solutions(T, calibrated.home)
        if found:
            metres, radians = errors(calibrated, found[0], T)
            solved += metres < 1e-3 and radians < np.radians(0.5)
    assert solved >= 59
