"""Planning of a whole pick-and-place, seven key points among other objects, on one core.

    python benchmarks/planning.py

Scenes are random: the object, where it goes, and three boxes in the way, all in reach. A rejected plan is counted
apart: some scenes have no grasp straight from above that clears a neighbour.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import time

import numpy as np
from rich.console import Console
from rich.table import Table

from maniagent.errors import MotionRejected
from maniagent.geometry import FloatArray, make_transform, top_down_rotation
from maniagent.motion import ArmModel, MotionGate, MotionLimits, MotionPlanner
from maniagent.types import Gripper, KeyPoint, OrientedBox

SCENES = 200


def top_down(x: float, y: float, z: float, yaw: float) -> FloatArray:
    """T_base_tcp of a gripper that points straight down."""
    return make_transform(top_down_rotation(yaw), [x, y, z])


def spots(rng: np.random.Generator, count: int) -> FloatArray:
    """(count, 2) positions on the table, at least 12 cm apart."""
    found: list[FloatArray] = []
    while len(found) < count:
        spot = rng.uniform([0.18, -0.25], [0.36, 0.25])
        if all(np.linalg.norm(spot - other) > 0.12 for other in found):
            found.append(spot)
        elif rng.random() < 0.01:
            found.clear()
    return np.array(found)


def scene(rng: np.random.Generator) -> tuple[list[KeyPoint], dict[int, OrientedBox]]:
    """Key points of a pick-and-place of object 0 onto object 1, and the boxes of all objects."""
    places, yaw, goal_yaw = spots(rng, 4), rng.uniform(-np.pi, np.pi), rng.uniform(-np.pi, np.pi)
    extents = [(0.04, 0.03, 0.03), (0.12, 0.12, 0.02), (0.05, 0.05, 0.12), (0.05, 0.05, 0.06)]
    boxes = {
        index: OrientedBox(np.array([*spot, extent[2] / 2]), np.array(extent), yaw if index == 0 else 0.0)
        for index, (spot, extent) in enumerate(zip(places, extents, strict=True))
    }
    (x, y), (X, Y) = places[0], places[1]
    return [
        KeyPoint(top_down(x, y, 0.12, yaw), Gripper.OPEN, "above the object"),
        KeyPoint(top_down(x, y, 0.016, yaw), Gripper.CLOSE, "down to it", touches=frozenset({0})),
        KeyPoint(top_down(x, y, 0.15, yaw), Gripper.KEEP, "lift", held=0),
        KeyPoint(top_down(X, Y, 0.15, goal_yaw), Gripper.KEEP, "over the goal", held=0),
        KeyPoint(top_down(X, Y, 0.04, goal_yaw), Gripper.OPEN, "lower", held=0, touches=frozenset({1})),
        KeyPoint(top_down(X, Y, 0.15, goal_yaw), Gripper.KEEP, "retreat"),
        KeyPoint(top_down(0.22, 0.0, 0.2, 0.0), Gripper.KEEP, "rest"),
    ], boxes


def main() -> None:
    """Plan and print."""
    rng, model, limits = np.random.default_rng(0), ArmModel(), MotionLimits()
    planner, gate = MotionPlanner(model, limits), MotionGate(model, limits)
    planned, rejected, motion, reasons = [], [], [], []
    for _ in range(SCENES):
        keypoints, boxes = scene(rng)
        begin = time.perf_counter()
        try:
            plan = planner.plan(keypoints, model.home, model.max_opening, boxes)
            gate.approve(plan)
        except MotionRejected as rejection:
            rejected.append(time.perf_counter() - begin)
            reasons.append(str(rejection))
        else:
            planned.append(time.perf_counter() - begin)
            motion.append(plan.duration)
    table = Table(
        "outcome",
        "scenes",
        "median ms",
        "p95 ms",
        "arm motion s",
        title="Pick-and-place planning with the gate, one core",
    )
    for name, seconds, moving in (("planned", planned, f"{np.median(motion):.1f}"), ("rejected", rejected, "")):
        if seconds:
            median, p95 = 1e3 * np.percentile(seconds, [50, 95])
            table.add_row(name, str(len(seconds)), f"{median:.0f}", f"{p95:.0f}", moving)
    Console().print(table)
    for reason in reasons[:5]:
        Console().print(f"rejected: {reason}")


if __name__ == "__main__":
    main()
