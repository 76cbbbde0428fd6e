"""A suite whose episodes behave as their task is called; worker processes import it."""

import os
import signal
import sys
import time
from pathlib import Path

from maniagent.errors import SetupError
from maniagent.evaluation.episode import EpisodeResult, Job
from maniagent.evaluation.suites import Suite


def run_episode(task: str, seed: int, episode: int, actor: str, out: Path | None) -> EpisodeResult:
    match task:
        case "raise":
            raise ValueError("the <arm> is gone")
        case "exit":
            sys.exit(3)
        case "die":
            os.kill(os.getpid(), signal.SIGKILL)
        case "hang":
            time.sleep(600)
        case "refuse":
            raise SetupError("Nothing renders here.")
        case "chatter":
            os.write(1, b"a library talks\n")
    if task == "lose":
        return EpisodeResult(
            task=task, seed=seed, episode=episode, success=False, believed=True, stage="unnoticed",
            reason="I see <b>it</b> | there", failed_turns={"grasp": 2}, turns=3, criteria={"strict": False},
        )  # fmt: skip
    return EpisodeResult(
        task=task, seed=seed, episode=episode, success=True, believed=True, turns=2, criteria={"strict": episode > 0},
        reason=f"process {os.getpid()}" if task == "who" else "",
    )  # fmt: skip


def repeat(job: Job, actor: str) -> str:
    return f"play {job.name} --with {actor}"


def suite(*tasks: str) -> Suite:
    return Suite("fake", tasks, run_episode, repeat)
