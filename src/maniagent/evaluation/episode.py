"""One episode of an evaluation: which one it is, and what became of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from ..console.folder import OBSERVATIONS

MOST_EPISODES = 10_000
"""Episodes per task and seed."""

FINAL_PICTURE = f"{OBSERVATIONS}/final.png"
"""In a run folder, where the suite leaves one: what the camera sees when everything is over."""

CRASH, TIME_LIMIT = "crash", "time-limit"
"""Stages of failures that the actor never got to report: the episode broke off, or was stopped from outside."""


def scene_seed(seed: int, episode: int) -> int:
    """The seed that draws an episode's scene: `10000 seed + episode`, so that no two (seed, episode) share one."""
    return MOST_EPISODES * seed + episode


@dataclass(frozen=True, order=True)
class Job:
    """One episode to be played."""

    task: str
    seed: int
    """0 to the number of seeds - 1."""
    episode: int
    """0 to the number of episodes per task and seed - 1."""

    @property
    def name(self) -> str:
        """Its name, also as a folder."""
        return f"{self.task}-s{self.seed}-e{self.episode:03d}"


class EpisodeResult(BaseModel):
    """What became of one episode; one line of results.jsonl."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    task: str
    seed: int
    episode: int
    success: bool
    """By the task's own predicate on the true state, at the end of the episode."""
    criteria: Mapping[str, bool] = {}
    """Success by further measures, where the suite has some: "at any step", "strict" ..."""
    believed: bool | None = None
    """Whether the actor itself believes that it is done; None where it doesn't say."""
    stage: str = ""
    """Where a failed episode failed: a FailureStage, "unnoticed" (the actor believes in success), how the actor gave
    up, "crash" or "time-limit"; empty on success."""
    reason: str = ""
    """In words: why it failed, or why the actor believes that it is done."""
    failed_turns: Mapping[str, Annotated[int, Field(ge=1)]] = {}
    """Failures that the actor met on the way, by stage, those it overcame included."""
    turns: int | None = None
    """How often the actor looked at the scene."""
    steps: int | None = None
    """Steps of the environment, where it counts them."""
    robot_seconds: float | None = None
    """Seconds by the robot's own clock."""
    model_calls: int = 0
    tokens: int = 0
    wall_seconds: float = 0.0
    seconds: Mapping[str, float] = {}
    """What the wall seconds went into: simulator, perception, reasoning ... other; empty where nobody took the time."""
    folder: str = ""
    """Run folder, relative to the evaluation's; empty where nothing was recorded."""

    @property
    def job(self) -> Job:
        """Which episode this is."""
        return Job(self.task, self.seed, self.episode)


def lost(job: Job, stage: str, reason: str, wall_seconds: float = 0.0) -> EpisodeResult:
    """The result of an episode that broke off: a failure with its reason."""
    return EpisodeResult(
        task=job.task,
        seed=job.seed,
        episode=job.episode,
        success=False,
        stage=stage,
        reason=reason,
        failed_turns={stage: 1},
        wall_seconds=wall_seconds,
    )
