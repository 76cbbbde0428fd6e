"""Episodes of SimplerEnv: the agents over the benchmark's own step, judged by the benchmark's own success."""

from __future__ import annotations

import shlex
import time
from collections.abc import Mapping
from contextlib import ExitStack
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ..agents.events import EventLog
from ..agents.loop import AgentLoop
from ..console.recorder import Recorder
from ..crew import crew_of
from ..envs.simpler import HORIZON, PERIOD, TASKS, SimplerEnv, draw_start
from ..errors import UnknownNameError
from ..robots.simpler import SimplerRobot
from ..types import Event, RunResult, RunVerdict
from . import strict
from .episode import FINAL_PICTURE, EpisodeResult, Job
from .poses import ON_GRID, Poses
from .tally import Tally

LATE = "late"
"""Stage of a failure that is a success at the last of all steps, after the registered budget."""


def run_episode(
    task: str, seed: int, episode: int, actor: str, out: Path | None, poses: Poses = ON_GRID
) -> EpisodeResult:
    """Play one episode: layout `episode`, or the start that `poses` draws for it.

    It is always played on for HORIZON steps, with the arm at rest once the actor is through; the true state after each
    step tells all measures of success. `seed` changes nothing by itself: physics and pictures repeat exactly.
    """
    start = time.monotonic()
    env = _environment(task)
    spent = {"start-up": time.monotonic() - start}
    tally = Tally()
    with ExitStack() as stack:
        recorder = None if out is None else _Timed(stack.enter_context(Recorder(out)))
        log = EventLog([tally] if recorder is None else [recorder, tally])
        env.film = None if recorder is None else lambda rgb, now: log.emit("frame", rgb=rgb, robot_time=now)
        env.reset(episode if poses.on_grid else draw_start(*env.layouts, poses.generator(task, episode)))
        robot = SimplerRobot(env, HORIZON)
        agents = stack.enter_context(crew_of(actor).ready(log, out))(robot.rig)
        log.emit("run_started", instruction=env.instruction, task=task, seed=seed, agents=agents.name)
        before = dict(env.seconds)
        result = AgentLoop(robot, agents, log).run(env.instruction)
        spent |= _shares(tally.seconds_by_kind(result), before, env.seconds)
        steps = env.steps
        env.film = None  # from here on the arm stands still
        robot.rest()
        if out is not None:
            _save(env.picture(), out / FINAL_PICTURE)
        log.emit("run_finished", result=result, achieved=strict.last(env.history, env.task.steps))
    spent["simulator"] = sum(env.seconds[name] for name in ("reset", "step", "render"))
    if recorder is not None:
        spent["recording"] = recorder.seconds + env.seconds["film"]
    return _judged(Job(task, seed, episode), env, result, tally, steps).model_copy(update={"seconds": spent})


def _judged(job: Job, env: SimplerEnv, result: RunResult, tally: Tally, steps: int) -> EpisodeResult:
    """What became of an episode of HORIZON steps, of which the actor used `steps`."""
    success, late = (strict.last(env.history, budget) for budget in (env.task.steps, HORIZON))
    return EpisodeResult(
        task=job.task,
        seed=job.seed,
        episode=job.episode,
        success=success,
        criteria=strict.criteria(env.history, env.task.steps),
        believed=result.verdict is RunVerdict.ACHIEVED,
        stage="" if success else LATE if late else tally.failure_stage(result),
        reason=result.reason,
        failed_turns=dict(tally.failed_turns),
        turns=tally.turns,
        model_calls=tally.model_calls,
        tokens=tally.tokens,
        steps=steps,
        robot_seconds=round(steps * PERIOD, 2),
    )


def play(
    task: str, episode: int, *, actor: str = "rules", out: Path | None = None, poses: Poses = ON_GRID
) -> EpisodeResult:
    """Play a single episode in this process.

    Raises UsageError for names and numbers that don't exist, SetupError where the benchmark can't run here.
    """
    if task not in TASKS:
        raise UnknownNameError("SimplerEnv task", task, TASKS)
    crew_of(actor)
    return run_episode(task, 0, episode, actor, out, poses)


def repeat(job: Job, actor: str, poses: Poses = ON_GRID) -> str:
    """The command that plays the episode again, with a run folder."""
    who = "" if actor == "rules" else f" --actor {shlex.quote(actor)}"
    return f"maniagent simpler play {job.task} --episode {job.episode}{poses.options}{who}"


@cache
def _environment(task: str) -> SimplerEnv:
    """The task's environment in this process: making one costs as much as an episode."""
    return SimplerEnv(TASKS[task])


def _shares(kinds: dict[str, float], before: Mapping[str, float], after: Mapping[str, float]) -> dict[str, float]:
    """The run's wall seconds without what of them the simulator and the film took."""

    def taken(name: str) -> float:
        return after.get(name, 0.0) - before.get(name, 0.0)

    observing, executing = kinds.pop("observe"), kinds.pop("execution")
    kinds["perception"] += observing - taken("render")
    return {**kinds, "control": executing - taken("step") - taken("film")}


def _save(picture: NDArray[np.uint8], path: Path) -> None:
    path.parent.mkdir(exist_ok=True)
    Image.fromarray(picture).save(path)


class _Timed:
    """A recorder, and the time that it takes for everything but the film, which the environment times."""

    def __init__(self, recorder: Recorder) -> None:
        self._recorder = recorder
        self.seconds = 0.0

    def on_event(self, event: Event) -> None:
        """Hand it on."""
        start = time.monotonic()
        self._recorder.on_event(event)
        if event.kind != "frame":
            self.seconds += time.monotonic() - start
