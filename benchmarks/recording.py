"""What recording costs: the share of a twin run's wall time that it adds, by part, and what pictures cost by size.

    python benchmarks/recording.py [EPISODES] [FOLDER]

The carrot is put on the plate, by the rules, once without a recorder and once with one, turn by turn in one process,
with the same seeds; the recorded episodes are staged in FOLDER (a temporary one). Shares are of the recorded run, from
the first look to the episode on the disk. Pictures are drawn by whatever MuJoCo finds (set MUJOCO_GL to choose).
"""

from __future__ import annotations

import os

os.environ.setdefault("LP_NUM_THREADS", "0")  # Mesa's software renderer draws in the calling thread

import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from rich.console import Console
from rich.table import Table

from maniagent import tasks
from maniagent.agents.events import EventLog
from maniagent.agents.loop import AgentLoop
from maniagent.agents.rules import rules_agents
from maniagent.data.episode import EpisodeInfo, Recording
from maniagent.data.recording import EpisodeRecorder
from maniagent.data.staging import Staging
from maniagent.envs.tabletop import TabletopEnv
from maniagent.robots.simulated import SimulatedRobot

TASK = "carrot-on-plate"
SIZES = ((640, 480), (320, 240), (256, 256), (224, 224))
PICTURES = 40


class Stopwatch:
    """Adds up the wall time spent in each part."""

    def __init__(self) -> None:
        self.seconds: defaultdict[str, float] = defaultdict(float)

    @contextmanager
    def timed(self, part: str) -> Iterator[None]:
        """Add the time spent inside."""
        start = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[part] += time.perf_counter() - start

    def wrap(self, owner: Any, method: str, part: str) -> None:
        """Time every call of a method from now on."""
        original = getattr(owner, method)

        def timed(*arguments: Any, **named: Any) -> Any:
            with self.timed(part):
                return original(*arguments, **named)

        setattr(owner, method, timed)


def carry_out(robot: SimulatedRobot, recorder: EpisodeRecorder | None) -> None:
    """One run of the loop, with the recorder among its observers."""
    observers = [] if recorder is None else [recorder]
    AgentLoop(robot, rules_agents(robot.rig), EventLog(observers)).run(tasks.get(TASK).instruction)


def recorded(env: TabletopEnv, seed: int, staging: Staging, watch: Stopwatch) -> Recording:
    """One recorded run, to the episode on the disk."""
    env.reset(seed=seed)
    robot = SimulatedRobot(env)
    recorder = EpisodeRecorder(robot)
    watch.wrap(recorder, "on_sample", "rows")
    with watch.timed("whole"):
        recorder.begin(seed=seed)
        # Only the recorder's pictures are counted: those that the agents ask for are part of every run.
        watch.wrap(robot._sampler, "_take", "samples")
        carry_out(robot, recorder)
        with watch.timed("finish"):
            recording = recorder.finish()
        with watch.timed("staging"):
            info = EpisodeInfo(
                key=f"s{seed}", task=TASK, instruction=TASK, fps=10, seed=seed, start=(0, 0, 0), label="valid"
            )
            staging.commit(info, recording)
    return recording


def measure(episodes: int, folder: Path) -> Table:
    """Play every seed without and with a recorder."""
    env = TabletopEnv(tasks.get(TASK).scene)
    staging, watch = Staging(folder), Stopwatch()
    rows, size = 0, 0
    env.reset(seed=0)
    recorded(env, 10_000, staging, Stopwatch())  # the first pictures of a size are slow
    for seed in range(episodes):
        env.reset(seed=seed)
        robot = SimulatedRobot(env)
        with watch.timed("plain"):
            carry_out(robot, None)
        recording = recorded(env, seed, staging, watch)
        rows += len(recording.steps.time)
        size += sum(pictures.nbytes for pictures in recording.rgb.values())
    env.close()
    spent = watch.seconds
    whole = spent["whole"]
    table = Table(f"{TASK}, {rows / episodes:.0f} rows, {size / episodes / 1e6:.0f} MB", "share of the recorded run")
    table.add_row("without a recorder (its own runs)", f"{spent['plain'] / whole:.1%}")
    table.add_row("rendering the samples", f"{spent['samples'] / whole:.1%}")
    table.add_row("taking note of the rows", f"{spent['rows'] / whole:.2%}")
    table.add_row("making arrays of them", f"{spent['finish'] / whole:.1%}")
    table.add_row("writing, forced onto the disk", f"{spent['staging'] / whole:.1%}")
    apart = spent["rows"] + spent["finish"] + spent["staging"]
    table.add_section()
    table.add_row("recording and staging, rendering apart", f"{apart / whole:.1%}")
    table.add_row("the same, of a run that renders nothing", f"{apart / (whole - spent['samples']):.1%}")
    return table


def picture_costs() -> Table:
    """CPU time of one camera's picture by size, as multiples of the smallest clean one."""
    env = TabletopEnv(tasks.get(TASK).scene)
    env.reset(seed=0)
    rng = np.random.default_rng(0)
    costs: dict[tuple[int, int], list[float]] = {}
    for width, height in SIZES:
        camera = env.cameras[0].resized(width, height)
        ways = [(depth, noise) for depth in (False, True) for noise in (None, rng)]
        costs[width, height] = [
            cpu_seconds(lambda camera=camera, depth=depth, noise=noise: env.take(camera, depth=depth, rng=noise))
            for depth, noise in ways
        ]
    env.close()
    unit = costs[SIZES[-1]][0]
    table = Table(f"one picture ({1e3 * unit:.0f} ms = 1)", "colour", "with noise", "and depth", "with noise")
    for (width, height), row in costs.items():
        table.add_row(f"{width}x{height}", *(f"{cost / unit:.2f}" for cost in row))
    return table


def cpu_seconds(work: Callable[[], object]) -> float:
    """Median process time."""
    work()
    spent = []
    for _ in range(PICTURES):
        start = time.process_time()
        work()
        spent.append(time.process_time() - start)
    return float(np.median(spent))


def main() -> None:
    """Measure and print."""
    cv2.setNumThreads(1)
    episodes = int(sys.argv[1]) if len(sys.argv) > 1 else 3
    with tempfile.TemporaryDirectory(dir=sys.argv[2] if len(sys.argv) > 2 else None) as folder:
        Console().print(measure(episodes, Path(folder)))
    Console().print(picture_costs())


if __name__ == "__main__":
    main()
