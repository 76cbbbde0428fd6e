"""Perception of tables with six things each: two noisy 640x480 RGB-D views to segments, and grasps for every one.

    python benchmarks/perception.py

One core; every scene is looked at several times with fresh sensor noise. Wall time is what a user waits; process
time is what remains of it on an idle machine.
"""

from __future__ import annotations

import os

os.environ["OMP_NUM_THREADS"] = "1"  # before NumPy and OpenCV read it

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import TypeVar

import cv2
import numpy as np
from rich.console import Console
from rich.table import Table

from maniagent.envs.scene import Scene
from maniagent.envs.tabletop import TabletopEnv
from maniagent.geometry import FloatArray
from maniagent.motion import ArmModel
from maniagent.perception.grasps import propose_grasps
from maniagent.perception.heightmap import build_height_map
from maniagent.perception.merging import merge_regions
from maniagent.perception.segmentation import cut_segments, find_supports, split_regions
from maniagent.perception.views import RobotFilter, Tuning, Workspace, foreground
from maniagent.robots.simulated import BodyFilter
from maniagent.types import Observation

SCENES = (
    ("red_chili", "green_chili", "carrot", "banana", "egg", "dish"),
    ("plate", "fork", "knife", "block", "strawberry", "marker"),
    ("basket", "eggplant", "carrot", "corn", "egg", "block"),
    ("towel", "spoon", "toy", "banana", "block", "marker"),
    ("plate", "red_chili", "green_chili", "carrot", "eggplant", "corn"),
)
"""Kinds of the library; the second thing lies on the first where that is one of CARRIERS."""
CARRIERS = ("plate", "basket", "towel")
LOOKS = 6
"""Observations of each scene, each with noise of its own."""
STAGES = ("foreground", "height map", "split", "merge", "cut", "grasps")


Result = TypeVar("Result")


@dataclass
class Stopwatch:
    """Milliseconds of wall and process time by stage, one entry per observation."""

    wall: dict[str, list[float]] = field(default_factory=lambda: {stage: [] for stage in STAGES})
    process: dict[str, list[float]] = field(default_factory=lambda: {stage: [] for stage in STAGES})

    def time(self, stage: str, work: Callable[[], Result]) -> Result:
        """Do the work; note how long it took."""
        wall, process = time.perf_counter(), time.process_time()
        result = work()
        self.process[stage].append(1e3 * (time.process_time() - process))
        self.wall[stage].append(1e3 * (time.perf_counter() - wall))
        return result


def looks() -> Iterator[Observation]:
    """`LOOKS` observations of every scene."""
    for seed, kinds in enumerate(SCENES):
        objects = [{"name": kind, "kind": kind} for kind in kinds]
        if kinds[0] in CARRIERS:
            objects[1] |= {"place": {"on": kinds[0]}}
        env = TabletopEnv(Scene.model_validate({"objects": objects}))
        env.reset(seed=seed)
        for _ in range(LOOKS):
            yield env.observe()
        env.close()


def perceive(observation: Observation, covers_robot: RobotFilter, watch: Stopwatch) -> tuple[int, int]:
    """What `segment` and `propose_grasps` do, stage by stage: how many segments, and how many have a grasp."""
    workspace = Workspace()
    views = watch.time("foreground", lambda: foreground(observation, covers_robot, workspace, Tuning()))
    grid = watch.time("height map", lambda: build_height_map(views, workspace))
    regions = watch.time("split", lambda: split_regions(grid))
    labels = watch.time("merge", lambda: merge_regions(regions, grid))
    segments = watch.time("cut", lambda: cut_segments(views, labels, find_supports(labels, grid), grid))
    grasps = watch.time("grasps", lambda: [propose_grasps(segment, grid) for segment in segments])
    return len(segments), sum(bool(found) for found in grasps)


def main() -> None:
    """Measure and print."""
    cv2.setNumThreads(1)
    covers_robot, watch = BodyFilter(ArmModel()), Stopwatch()
    counts = []
    for number, observation in enumerate(looks()):
        if number == 0:
            perceive(observation, covers_robot, Stopwatch())  # the first call pays for imports and caches
        counts.append(perceive(observation, covers_robot, watch))
    segments, graspable = np.mean(counts, axis=0)
    table = Table(
        "stage",
        "wall ms, median",
        "p95",
        "process ms, median",
        "p95",
        title=f"Perception, {len(counts)} observations of {len(SCENES)} scenes, one core",
    )
    for stage in STAGES:
        table.add_row(stage, *_figures(watch.wall[stage]), *_figures(watch.process[stage]))
    table.add_section()
    totals = [np.sum([times[stage] for stage in STAGES], axis=0) for times in (watch.wall, watch.process)]
    table.add_row("all", *_figures(totals[0]), *_figures(totals[1]))
    Console().print(table)
    Console().print(f"{segments:.1f} segments a scene of 6 things, {graspable:.1f} of them with grasps")


def _figures(milliseconds: Sequence[float] | FloatArray) -> tuple[str, str]:
    median, p95 = np.percentile(milliseconds, [50, 95])
    return f"{median:.0f}", f"{p95:.0f}"


if __name__ == "__main__":
    main()
