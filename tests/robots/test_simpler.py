"""The benchmark's robot: the laws of its steps anywhere, the real benchmark where it is installed."""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maniagent.agents.events import EventLog
from maniagent.agents.loop import AgentLoop
from maniagent.agents.rules import rules_agents
from maniagent.envs.simpler import LAYOUTS, SimplerEnv
from maniagent.errors import UsageError
from maniagent.geometry import make_transform, rotation_angle, top_down_rotation
from maniagent.robots.simpler import STEP_ANGLE, STEP_LENGTH, SimplerRobot, waypoints
from maniagent.types import RunVerdict
from simplerenv import make

metres = st.floats(-0.3, 0.3)
angles = st.floats(-np.pi, np.pi)


@given(st.tuples(metres, metres, metres), st.tuples(metres, metres, metres), angles, angles)
def test_no_step_is_longer_than_the_arm_follows_and_the_last_is_the_goal(
    start: tuple[float, float, float], goal: tuple[float, float, float], yaw: float, turned: float
) -> None:
    T_start, T_goal = make_transform(top_down_rotation(yaw), start), make_transform(top_down_rotation(turned), goal)
    way = [T_start, *waypoints(T_start, T_goal)]
    for a, b in pairwise(way):
        assert np.linalg.norm(b[:3, 3] - a[:3, 3]) <= STEP_LENGTH + 1e-9
        assert rotation_angle(a[:3, :3].T @ b[:3, :3]) <= STEP_ANGLE + 1e-6
    np.testing.assert_allclose(way[-1], T_goal, atol=1e-6)


@pytest.fixture(scope="module")
def env() -> Iterator[SimplerEnv]:
    made = make("simpler-stack")
    yield made
    made.close()


@pytest.mark.slow
def test_the_benchmark_and_our_kinematics_agree_on_where_the_fingers_are(env: SimplerEnv) -> None:
    env.reset(3)
    robot = SimplerRobot(env, 60)
    link = next(x for x in env._env.agent.robot.get_links() if x.name == "ee_gripper_link")
    base = env._env.agent.robot.pose
    T_base_link = (base.inv() * link.pose).to_transformation_matrix()[0].numpy()
    np.testing.assert_allclose(robot.state().T_base_tcp, T_base_link, atol=1e-4)


@pytest.mark.slow
def test_what_the_robot_observes_is_pictures_and_encoders(env: SimplerEnv) -> None:
    env.reset(3)
    observation = SimplerRobot(env, 60).observe()
    frame = observation.main_frame
    assert frame.rgb.shape == (480, 640, 3)
    assert 0.2 < float(np.nanmedian(frame.depth)) < 2.0
    assert env.steps == 0


@pytest.mark.slow
def test_a_layout_that_does_not_exist_is_refused(env: SimplerEnv) -> None:
    with pytest.raises(UsageError, match=f"0 to {LAYOUTS - 1}"):
        env.reset(LAYOUTS)


@pytest.mark.slow
def test_the_steps_commanded_are_the_steps_counted_and_the_budget_is_kept(env: SimplerEnv) -> None:
    env.reset(0)
    robot = SimplerRobot(env, 10)
    robot.rest()
    assert env.steps == 10
    assert robot.go_home().completed
    assert env.steps == 10


@pytest.mark.slow
def test_the_rules_stack_the_block_in_the_benchmark_within_its_steps(env: SimplerEnv) -> None:
    env.reset(3)
    robot = SimplerRobot(env, env.task.steps)
    result = AgentLoop(robot, rules_agents(robot.rig), EventLog()).run(env.instruction)
    robot.rest()
    assert result.verdict is RunVerdict.ACHIEVED
    assert env.info["success"]
    assert env.steps == env.task.steps
