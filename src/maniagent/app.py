"""One run from end to end: the twin, the robot, the agents, the recorder. What the command line and Python call."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .agents.events import EventLog, Observer
from .agents.loop import AgentLoop
from .agents.protocols import Agents
from .console.recorder import Recorder
from .crew import Crew, MakeAgents, RulesCrew
from .envs.tabletop import TabletopEnv
from .errors import UsageError
from .robots.robot import Robot
from .robots.simulated import SimulatedRobot
from .tasks import Task, get, load_task
from .types import RunResult, RunVerdict

RULES = RulesCrew()
REST_SECONDS = 1.0
"""Robot time between the arm's coming home and the verdict on true state: whatever rolls has come to rest."""


@dataclass(frozen=True)
class RunOutcome:
    """What a run came to: what the agents believe, and what is true."""

    task: str | None
    seed: int
    instruction: str
    result: RunResult
    achieved: bool | None
    """By the task's or scene file's own predicate on the true state, whatever the instruction; None without one."""
    out: Path | None


def run(
    instruction: str | None = None,
    *,
    task: str | None = None,
    scene: str | Path | None = None,
    seed: int = 0,
    out: str | Path | None = None,
    view: bool = False,
    observers: Sequence[Observer] = (),
    crew: Crew = RULES,
    agents: MakeAgents | None = None,
) -> RunOutcome:
    """Carry out an instruction in the tabletop twin, with `crew`'s agents, or with those that `agents` makes.

    Give a task by name, or a scene file (docs/scenes.md). Without an instruction the task's own is carried out.
    `seed` draws the layout and the sensors' noise: the same seed gives the same run. With `out` the run leaves a
    folder with log, pictures, video and report. `view` opens MuJoCo's viewer.

    Raises
    ------
    UsageError
        For an unknown task, a bad scene file, a negative seed, or nothing to do; for a crew that is named wrongly.
    SetupError
        Where nothing renders offscreen, or something that the crew needs is missing.

    """
    if seed < 0:
        raise UsageError(f"The seed is {seed}; it should be 0 or more.")
    chosen = _choose(task, scene)
    name = chosen.name if task is not None else None
    folder = Path(out) if out is not None else None
    with ExitStack() as stack:
        env = TabletopEnv(chosen.scene, render_mode="human" if view else "rgb_array")
        stack.callback(env.close)
        env.reset(seed=seed)
        episode = chosen.episode(env.layout, np.random.default_rng([seed, 1]))
        said = (episode.instruction if instruction is None else instruction).strip()
        if not said:
            raise UsageError("There is no instruction: say one, or write one into the scene file.")
        recorders = [] if folder is None else [stack.enter_context(Recorder(folder))]
        log = EventLog([*recorders, *observers])
        robot = SimulatedRobot(env, on_frame=_film(log) if folder is not None else None)

        def achieved_now() -> bool | None:
            env.settle(REST_SECONDS)
            return episode.achieved(env.truth())

        make = stack.enter_context(crew.ready(log, folder)) if agents is None else agents
        result, achieved = _carry_out(robot, make(robot.rig), said, name, seed, log, achieved_now)
    return RunOutcome(name, seed, said, result, achieved, folder)


def _choose(task: str | None, scene: str | Path | None) -> Task:
    if (task is None) == (scene is None):
        raise UsageError("Give either a task (`maniagent tasks` lists them) or a scene file, and not both.")
    return get(task) if task is not None else load_task(Path(str(scene)))


def _film(log: EventLog) -> Callable[[NDArray[np.uint8], float], None]:
    return lambda rgb, robot_time: log.emit("frame", rgb=rgb, robot_time=robot_time)


def _carry_out(
    robot: Robot,
    agents: Agents,
    instruction: str,
    task: str | None,
    seed: int,
    log: EventLog,
    achieved_now: Callable[[], bool | None],
) -> tuple[RunResult, bool | None]:
    """Run the loop; what is true is asked only when the agents are through."""
    log.emit("run_started", instruction=instruction, task=task, seed=seed, agents=agents.name)
    try:
        result = AgentLoop(robot, agents, log).run(instruction)
    except KeyboardInterrupt:
        aborted = RunResult(instruction, RunVerdict.ABORTED, "Stopped by hand; the arm stands still.", (), {})
        log.emit("run_finished", result=aborted, achieved=None)
        raise
    achieved = achieved_now()
    log.emit("run_finished", result=result, achieved=achieved)
    return result, achieved
