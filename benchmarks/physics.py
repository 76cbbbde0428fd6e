"""The twin on one core: how much faster than real time it simulates, and what its pictures cost.

    python benchmarks/physics.py

The table holds six things; the arm swings over them from one random posture to the next. The real-time factor is of
physics alone; an observation is both cameras' colour and depth, 640x480 each, with noise; a video frame is the main
view's colour alone. Pictures are drawn by whatever MuJoCo finds (set MUJOCO_GL to choose).
"""

from __future__ import annotations

import os

os.environ["OMP_NUM_THREADS"] = "1"  # before NumPy and OpenCV read it
os.environ.setdefault("LP_NUM_THREADS", "0")  # Mesa's software renderer draws in the calling thread

import time
from collections.abc import Callable
from itertools import pairwise

import cv2
import numpy as np
from rich.console import Console
from rich.table import Table

from maniagent.envs.scene import Scene
from maniagent.envs.tabletop import TabletopEnv

THINGS = ("plate", "basket", "red_chili", "carrot", "egg", "block")
CHUNKS = 30
CHUNK_SECONDS = 1.0
"""Simulated seconds from one posture to the next."""
PICTURES = 40


def swing(env: TabletopEnv, start: np.ndarray, goal: np.ndarray) -> None:
    """Move the arm evenly from one posture to another in `CHUNK_SECONDS`."""
    steps = round(CHUNK_SECONDS / env.period)
    for fraction in np.linspace(0.0, 1.0, steps):
        env.advance(start + fraction * (goal - start), env.opening_range[1])


def postures(env: TabletopEnv) -> np.ndarray:
    """(CHUNKS + 1, 6) rad: around home, high enough to touch nothing."""
    reach = np.array([0.8, 0.15, 0.15, 0.4, 0.4, 1.0])
    offsets = np.random.default_rng(0).uniform(-reach, reach, (CHUNKS + 1, 6))
    return env.home + offsets


def wall_and_process(work: Callable[[], object]) -> tuple[float, float]:
    """Seconds of wall and of process time."""
    wall, process = time.perf_counter(), time.process_time()
    work()
    return time.perf_counter() - wall, time.process_time() - process


def main() -> None:
    """Measure and print."""
    cv2.setNumThreads(1)
    env = TabletopEnv(Scene.model_validate({"objects": [{"name": kind, "kind": kind} for kind in THINGS]}))
    env.reset(seed=0)
    way = postures(env)
    swing(env, env.home, way[0])
    physics = [
        wall_and_process(lambda start=start, goal=goal: swing(env, start, goal)) for start, goal in pairwise(way)
    ]
    table = Table("the twin, one core", "wall, median", "p5 / p95", "process, median", "p5 / p95")
    table.add_row("real-time factor", *_spread(CHUNK_SECONDS / np.array(physics), "{:.1f}"))
    for name, picture in (("ms per observation", env.observe), ("ms per video frame", env.render)):
        picture()
        took = [wall_and_process(picture) for _ in range(PICTURES)]
        table.add_row(name, *_spread(1e3 * np.array(took), "{:.0f}"))
    env.close()
    Console().print(table)


def _spread(values: np.ndarray, form: str) -> list[str]:
    """Of (N, 2) wall and process figures: median and 5th to 95th percentile, as text."""
    cells = []
    for column in values.T:
        low, median, high = np.percentile(column, [5, 50, 95])
        cells += [form.format(median), f"{form.format(low)} / {form.format(high)}"]
    return cells


if __name__ == "__main__":
    main()
