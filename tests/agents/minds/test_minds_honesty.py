"""From agents on models, too, no way leads to the twin's true state."""

import pytest
from test_minds import PUT, Words, act, end, seen

from maniagent import tasks
from maniagent.agents.events import EventLog
from maniagent.agents.loop import AgentLoop
from maniagent.agents.minds import minds_agents
from maniagent.envs.tabletop import TabletopEnv
from maniagent.robots.simulated import SimulatedRobot
from maniagent.testing import ScriptedModel
from maniagent.types import RunVerdict
from test_honesty import true_state_among


@pytest.mark.slow
def test_after_a_whole_run_nothing_true_is_in_reach_of_the_agents() -> None:
    env = TabletopEnv(tasks.get("pepper-on-plate").scene)
    env.reset(seed=0)
    robot = SimulatedRobot(env)
    steps = [act("put the red pepper on the plate", "red pepper", "plate"), end("done")]
    model = ScriptedModel({"scene": [seen("red pepper", "plate")], "reasoning": steps, "controller": [PUT]})
    agents = minds_agents(robot.rig, model, model, Words())
    assert AgentLoop(robot, agents, EventLog()).run("put it there").verdict is RunVerdict.ACHIEVED
    assert true_state_among([agents], env) == []
    assert true_state_among([robot], env)  # the search does find what is there
    env.close()
