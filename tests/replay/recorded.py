"""Runs of scripted agents on a robot without a body, recorded as any run is."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from maniagent.agents.cache import Cache, with_cache
from maniagent.agents.events import EventLog
from maniagent.agents.loop import AgentLoop, Budget
from maniagent.agents.protocols import Agents, Located
from maniagent.console.recorder import Recorder
from maniagent.errors import CameraFailure, DetectionFailure
from maniagent.motion import ArmModel
from maniagent.perception.rig import Rig
from maniagent.robots.body_filter import BodyFilter
from maniagent.testing import FakeRobot, ScriptedAgents, made_object, made_observation
from maniagent.types import (
    ActionSequence,
    ActionStep,
    ExecutionReport,
    Gripper,
    ObjectAnchor,
    Orientation,
    Part,
    RunResult,
    Subtask,
    Verdict,
)

PEPPER, PLATE = made_object(0, "pepper", (1 / 3, 0.1), grasps=3), made_object(1, "plate", (0.3, 0.2), grasps=0)
FOUND = Located((PEPPER, PLATE), ())
TRY = Subtask(previous=Verdict.INITIAL, reason="first", text="take the pepper", objects=("pepper", "plate"))
AGAIN = TRY.model_copy(update={"previous": Verdict.FAILURE, "reason": "it isn't there"})
DONE = Subtask(previous=Verdict.SUCCESS, reason="it is there", done=True)
CANNOT = Subtask(previous=Verdict.FAILURE, reason="it never will", cannot=True)
TAKE = ActionSequence(
    skill="take",
    steps=(
        ActionStep(
            description="Take it",
            anchor=ObjectAnchor(index=0, part=Part.GRASP),
            orientation=Orientation(kind="grasp", index=0),
            gripper=Gripper.CLOSE,
        ),
    ),
)
HIGHER = TAKE.model_copy(update={"skill": "take higher"})
SLIPPED = ExecutionReport(completed=False, reached=1, reason="It slipped.", stage="grasp")
STUCK = ExecutionReport(completed=False, reached=0, reason="The arm is blocked.", stage="control")
HOME = ExecutionReport(completed=True, reached=1)


@dataclass
class Scenario:
    """What agents say, and what a robot answers."""

    subtasks: list[Any]
    located: list[Any] = field(default_factory=lambda: [FOUND])
    sequences: list[Any] = field(default_factory=lambda: [TAKE])
    robot: Callable[[], FakeRobot] = FakeRobot
    budget: Budget = field(default_factory=lambda: Budget(turns=6))

    def agents(self, *_: object) -> Agents:
        return ScriptedAgents(self.subtasks, self.located, self.sequences).as_agents()


def refuse_first(count: int) -> Callable[[object], str]:
    left = [count]

    def refuse(keypoints: object) -> str:
        left[0] -= 1
        return "It is out of reach." if left[0] >= 0 else ""

    return refuse


SCENARIOS = {
    "at once": Scenario([TRY, DONE]),
    "slips once": Scenario([TRY, AGAIN, DONE], robot=lambda: FakeRobot(reports=[SLIPPED, HOME])),
    "other grasps": Scenario([TRY, DONE], robot=lambda: FakeRobot(refuse=refuse_first(2))),
    "written anew": Scenario([TRY, DONE], sequences=[TAKE, HIGHER], robot=lambda: FakeRobot(refuse=refuse_first(3))),
    "blind once": Scenario(
        [TRY, DONE], robot=lambda: FakeRobot(observations=[CameraFailure("Blocked."), made_observation()])
    ),
    "always blind": Scenario([], robot=lambda: FakeRobot(observations=[CameraFailure("Blocked.")])),
    "not found": Scenario([TRY, CANNOT], located=[DetectionFailure("No pepper.")]),
    "out of turns": Scenario([TRY, AGAIN], budget=Budget(turns=3)),
    "never home": Scenario([TRY, AGAIN, CANNOT], robot=lambda: FakeRobot(way_home=[HOME, STUCK])),
}


def record(folder: Path, scenario: Scenario, cache: Cache | None = None) -> RunResult:
    """Carry a scenario out and record it, as `maniagent.app.run` does."""
    robot = scenario.robot()
    robot.rig = Rig(BodyFilter(ArmModel()))
    with Recorder(folder) as recorder:
        log = EventLog([recorder])
        agents = scenario.agents() if cache is None else with_cache(scenario.agents(), cache, log)
        log.emit("run_started", instruction="take it", task=None, seed=0, agents=agents.name)
        result = AgentLoop(robot, agents, log, scenario.budget).run("take it")
        log.emit("run_finished", result=result, achieved=None)
    return result
