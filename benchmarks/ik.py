"""Inverse kinematics over 1000 reachable top-down poses of the workspace, on one core.

    python benchmarks/ik.py

Solved means: within joint limits, 1 mm and 0.5 degrees. Reachable means: a random posture within the joint limits
puts the TCP there, pointing straight down, inside the workspace and with the fingertips not in the table; every
solve starts from home, knowing nothing of that posture. The second row is the same on an arm whose links and axes
are a millimetre and a fraction of a degree off, as after a calibration, where the closed form alone is not enough.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import tempfile
import time
from pathlib import Path

import mujoco
import numpy as np
from rich.console import Console
from rich.table import Table

from maniagent.assets import WX250S_XML
from maniagent.geometry import FloatArray, rotation_angle
from maniagent.motion import ArmModel, IKSolver, MotionLimits

POSES = 1000


def reachable_poses(model: ArmModel, rng: np.random.Generator) -> list[FloatArray]:
    """Random TCP poses in the workspace that some posture reaches, straight down (as near as the arm's axes allow)."""
    limits, poses = MotionLimits(), []
    while len(poses) < POSES:
        q = rng.uniform(model.lower, model.upper)
        q[3] = 0.0
        q[4] = np.pi / 2 - q[1] - q[2]
        T = model.forward(q)
        if model.within_limits(q) and limits.contains(T[:3, 3]) and T[2, 3] > 0.012:
            poses.append(T)
    return poses


def measure(model: ArmModel, poses: list[FloatArray]) -> tuple[float, float, float]:
    """Share solved, median ms, 95th percentile ms."""
    solver, solved, seconds = IKSolver(model), 0, []
    for T in poses:
        begin = time.perf_counter()
        found = solver.solutions(T, model.home)
        seconds.append(time.perf_counter() - begin)
        if found:
            reached = model.forward(found[0])
            off = np.linalg.norm(reached[:3, 3] - T[:3, 3])
            turned = rotation_angle(reached[:3, :3].T @ T[:3, :3])
            solved += bool(off < 1e-3 and turned < np.radians(0.5) and model.within_limits(found[0]))
    return solved / len(poses), 1e3 * float(np.median(seconds)), 1e3 * float(np.percentile(seconds, 95))


def calibrated_arm(folder: Path) -> ArmModel:
    """The arm with links up to 2 mm and an axis 0.7 degrees off."""
    spec = mujoco.MjSpec.from_file(str(WX250S_XML))
    for name, offset in (("upper_forearm_link", [0.0015, 0.001, -0.002]), ("wrist_link", [0.001, -0.001, 0.0015])):
        spec.body(name).pos = np.asarray(spec.body(name).pos) + offset
    spec.joint("wrist_angle").axis = [0.01, 1.0, 0.006]
    path = folder / "calibrated.xml"
    path.write_text(spec.to_xml())
    return ArmModel(path)


def main() -> None:
    """Measure and print."""
    table = Table("arm", "solved", "median ms", "p95 ms", title=f"IK, {POSES} reachable top-down poses, one core")
    with tempfile.TemporaryDirectory() as folder:
        for name, model in (("as published", ArmModel()), ("calibrated", calibrated_arm(Path(folder)))):
            share, median, p95 = measure(model, reachable_poses(model, np.random.default_rng(0)))
            table.add_row(name, f"{100 * share:.1f} %", f"{median:.2f}", f"{p95:.2f}")
    Console().print(table)


if __name__ == "__main__":
    main()
