"""Episodes of the tabletop twin's tasks: ordinary runs, counted."""

from __future__ import annotations

import shlex
from pathlib import Path

from ..app import run
from ..crew import crew_of
from ..types import RunVerdict
from .episode import EpisodeResult, Job, scene_seed
from .tally import Tally


def run_episode(task: str, seed: int, episode: int, actor: str, out: Path | None) -> EpisodeResult:
    """Play one episode in the twin; the scene is that of `scene_seed(seed, episode)`."""
    tally = Tally()
    outcome = run(
        task=task,
        seed=scene_seed(seed, episode),
        out=out,
        observers=(tally,),
        crew=crew_of(actor),
    )
    return EpisodeResult(
        task=task,
        seed=seed,
        episode=episode,
        success=outcome.achieved is True,
        believed=outcome.result.verdict is RunVerdict.ACHIEVED,
        stage="" if outcome.achieved else tally.failure_stage(outcome.result),
        reason=outcome.result.reason,
        failed_turns=dict(tally.failed_turns),
        turns=tally.turns,
        robot_seconds=round(tally.robot_seconds, 2),
        model_calls=tally.model_calls,
        tokens=tally.tokens,
        seconds=tally.seconds_by_kind(outcome.result),
    )


def repeat(job: Job, actor: str) -> str:
    """The command that plays the episode again."""
    who = "" if actor == "rules" else f" --actor {shlex.quote(actor)}"
    return f"maniagent run --task {job.task} --seed {scene_seed(job.seed, job.episode)}{who}"
