"""Episodes of the tabletop twin's tasks: ordinary runs, counted."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

from ..app import RunOutcome, run
from ..types import Event, RunVerdict
from . import actors
from .episode import EpisodeResult, Job, scene_seed

UNNOTICED = "unnoticed"
"""Stage of a failure that the agents took for a success."""


def run_episode(task: str, seed: int, episode: int, actor: str, out: Path | None) -> EpisodeResult:
    """Play one episode in the twin; the scene is that of `scene_seed(seed, episode)`."""
    tally = Tally()
    outcome = run(
        task=task,
        seed=scene_seed(seed, episode),
        out=out,
        observers=(tally,),
        agents=actors.get(actor).make_agents,
    )
    believed = outcome.result.verdict is RunVerdict.ACHIEVED
    return EpisodeResult(
        task=task,
        seed=seed,
        episode=episode,
        success=outcome.achieved is True,
        believed=believed,
        stage="" if outcome.achieved else _stage(outcome, tally),
        reason=outcome.result.reason,
        failed_turns=dict(tally.failed_turns),
        turns=tally.turns,
        robot_seconds=round(tally.robot_seconds, 2),
    )


def repeat(job: Job, actor: str) -> str:
    """The command that plays the episode again."""
    if actor != "rules":
        return f"maniagent eval {job.task} --actor {actor} --episodes {job.episode + 1} --seeds {job.seed + 1}"
    return f"maniagent run --task {job.task} --seed {scene_seed(job.seed, job.episode)}"


def _stage(outcome: RunOutcome, tally: Tally) -> str:
    if outcome.result.verdict is RunVerdict.ACHIEVED:
        return UNNOTICED
    return tally.last_failure or outcome.result.verdict.value


class Tally:
    """An Observer that counts what an evaluation wants to know of a run."""

    def __init__(self) -> None:
        self.turns = 0
        self.failed_turns: Counter[str] = Counter()
        self.last_failure = ""
        """Stage of the last failure; empty where there was none."""
        self._first_look: float | None = None
        self._last_look = 0.0

    @property
    def robot_seconds(self) -> float:
        """Robot time from the first look to the last, s."""
        return 0.0 if self._first_look is None else self._last_look - self._first_look

    def on_event(self, event: Event) -> None:
        """Count one event."""
        match event.kind:
            case "observed":
                self.turns += 1
                self._last_look = event.data["observation"].robot.time
                if self._first_look is None:
                    self._first_look = self._last_look
            case "failed":
                self.last_failure = event.data["stage"] or "execution"
                self.failed_turns[self.last_failure] += 1
