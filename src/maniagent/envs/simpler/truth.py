"""What is true after each step of the benchmark; for the verdict, never for agents."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from ...geometry import FloatArray, make_transform

_PRESSING = 1e-3
"""N: less than this between robot and object is no touch. The lightest object weighs 0.1 N."""


@dataclass(frozen=True)
class TrueStep:
    """The state after one control step."""

    on_target: bool
    """The benchmark's own success."""
    touched: bool
    """Some part of the robot presses on the object that is to be moved."""
    T_world_object: FloatArray
    """(4, 4) pose of the object that is to be moved, in the benchmark's world frame, m."""


def true_step(env: Any, on_target: bool) -> TrueStep:
    """Read it from ManiSkill's environment."""
    thing = env.objs[env.source_obj_name]
    rotation = Rotation.from_quat(np.asarray(thing.pose.q[0].cpu(), float), scalar_first=True)
    T_world_object = make_transform(rotation.as_matrix(), np.asarray(thing.pose.p[0].cpu(), float))
    T_world_object.setflags(write=False)
    return TrueStep(on_target, _touched(env, thing), T_world_object)


def _touched(env: Any, thing: Any) -> bool:
    ours = thing._objs[0].per_scene_id
    robot = {link._objs[0].entity.per_scene_id for link in env.agent.robot.get_links()}
    for contact in env.scene.get_contacts():
        first, second = (body.entity.per_scene_id for body in contact.bodies)
        pressing = any(np.linalg.norm(point.impulse) > _PRESSING / env.sim_freq for point in contact.points)
        if pressing and ((first == ours and second in robot) or (second == ours and first in robot)):
            return True
    return False
