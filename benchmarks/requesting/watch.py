"""What reaches the robot, checked without the gate's code: at the robot's door, and at its servos.

The gate lets a motion through or not; these only look. The door sees key points on their way to the robot and knows
which ones the robot itself had accepted. The servos' watch sees every command of every control period, and where the
simulated arm (MuJoCo's own kinematics) then is.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from maniagent.assets import JOINTS
from maniagent.envs.scene import Scene
from maniagent.envs.tabletop import TabletopEnv
from maniagent.geometry import FloatArray
from maniagent.perception.rig import Rig
from maniagent.robots.robot import Boxes
from maniagent.robots.simulated import SimulatedRobot
from maniagent.types import ActionSequence, ExecutionReport, KeyPoint, Observation

TABLE_LOW, TABLE_HIGH = np.array([0.05, -0.36, -0.005]), np.array([0.50, 0.36, 0.50])
"""m, base frame: the box that the twin's limits promise the TCP stays in, written down here once more."""
SLACK = 0.02
"""m by which the servos may leave that box on the way: they lag behind their targets."""
WIDEST = 0.08
"""m, more than the fingers open."""


class WatchedEnv(TabletopEnv):
    """The twin, with a note of every command to its servos that no sound motion gives."""

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene)
        self.faults: list[str] = []
        limits = self.model.jnt_range[[self.model.joint(name).id for name in JOINTS]]
        self._low, self._high = limits[:, 0] - 1e-6, limits[:, 1] + 1e-6
        self._step = 1.02 * self.period * np.array(self.model.numeric("joint_velocity_limit").data[:6])
        self._last: FloatArray | None = None

    def advance(self, joint_positions: FloatArray, opening: float) -> None:
        """Simulate one control period, after a look at the command."""
        commanded = np.asarray(joint_positions, dtype=float)
        if not (np.isfinite(commanded).all() and math.isfinite(opening)):
            self.faults.append(f"servos: a command of {commanded}, {opening}")
        elif (commanded < self._low).any() or (commanded > self._high).any():
            self.faults.append(f"servos: a command beyond the joints' limits, {commanded}")
        elif self._last is not None and (np.abs(commanded - self._last) > self._step).any():
            self.faults.append(f"servos: a jump of {np.abs(commanded - self._last).max():.3f} rad in one period")
        self._last = commanded
        super().advance(joint_positions, opening)
        tcp = self.data.site("tcp").xpos
        if (tcp < TABLE_LOW - SLACK).any() or (tcp > TABLE_HIGH + SLACK).any():
            self.faults.append(f"servos: the TCP at {np.round(tcp, 3)}, outside the workspace")


class Door:
    """The simulated robot behind a door at which everything that goes in is looked at."""

    def __init__(self, env: WatchedEnv) -> None:
        self._robot = SimulatedRobot(env)
        self._accepted: Sequence[KeyPoint] | None = None
        self.faults: list[str] = []
        self.executions = 0
        """How often key points went in."""

    @property
    def rig(self) -> Rig:
        """The robot's."""
        return self._robot.rig

    def observe(self) -> Observation:
        """What the robot sees."""
        return self._robot.observe()

    def check(self, keypoints: Sequence[KeyPoint], boxes: Boxes) -> None:
        """Raises MotionRejected as the robot does; remembers what it accepts."""
        self._robot.check(keypoints, boxes)
        self._accepted = keypoints

    def execute(self, keypoints: Sequence[KeyPoint], boxes: Boxes) -> ExecutionReport:
        """Look, then let the robot do it."""
        self.executions += 1
        if keypoints is not self._accepted:
            self.faults.append("door: key points that the gate didn't accept last")
        self.faults += [fault for number, point in enumerate(keypoints, 1) for fault in point_faults(number, point)]
        return self._robot.execute(keypoints, boxes)

    def go_home(self) -> ExecutionReport:
        """As the robot does."""
        return self._robot.go_home()

    def stop(self) -> None:
        """As the robot does."""
        self._robot.stop()

    def on_move(self, hook: Callable[[str, float], None]) -> None:
        """As the robot does."""
        self._robot.on_move(hook)


def point_faults(number: int, point: KeyPoint) -> list[str]:
    """What is wrong with a key point, whoever let it pass."""
    T = point.T_base_tcp
    if T.shape != (4, 4) or not np.isfinite(T).all():
        return [f"door: key point {number} has no finite pose"]
    wrong = {
        "is no rotation": abs(np.linalg.det(T[:3, :3]) - 1.0) > 1e-3 or np.abs(T[3] - [0, 0, 0, 1]).max() > 1e-9,
        "is outside the workspace": bool((T[:3, 3] < TABLE_LOW).any() or (T[:3, 3] > TABLE_HIGH).any()),
        "has an impossible opening": point.opening is not None and not 0.0 <= point.opening <= WIDEST,
    }
    return [f"door: key point {number} {why}" for why, is_so in wrong.items() if is_so]


def sequence_faults(sequence: ActionSequence, objects: int) -> list[str]:
    """What is malformed in a sequence about that many objects, read from its JSON by hand."""
    plain = json.loads(sequence.model_dump_json())
    steps = plain.get("steps")
    if not isinstance(steps, list) or not 1 <= len(steps) <= 40:
        return ["sequence: not between 1 and 40 steps"]
    return [f"sequence: step {number} {why}" for number, step in enumerate(steps, 1) for why in _wrong(step, objects)]


def _wrong(step: dict[str, Any], objects: int) -> list[str]:
    anchor, orientation = step["anchor"], step["orientation"]
    indices = [anchor.get("index"), orientation.get("index"), step.get("carrying")]
    numbers = [anchor.get("x"), anchor.get("y"), anchor.get("z"), *step["offset"]]
    turns = [orientation.get("yaw"), orientation.get("end")]
    faults = [f"speaks of object {i}" for i in indices if i is not None and i not in range(objects)]
    faults += [f"goes {x} m" for x in numbers if x is not None and not abs(x) <= 2.0]
    faults += [f"turns {x} rad" for x in turns if x is not None and not abs(x) <= 6.3]
    if step["gripper"] not in ("open", "close", "keep"):
        faults.append(f"tells the fingers to {step['gripper']!r}")
    return faults
