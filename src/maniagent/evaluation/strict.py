"""Success in SimplerEnv by several measures, from what was true after each step.

The benchmark's own success is geometric: the object is above the target, near enough, in two tasks in contact with
it. It holds for an object that is still in the gripper, or that is rolling off. Strict success does not.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..envs.simpler import HORIZON, PERIOD, TrueStep
from ..geometry import rotation_angle

LAST_SECOND = round(1.0 / PERIOD)
"""Steps."""
AT_REST = 0.005
"""m that an object at rest may move within the last second."""
AT_REST_ANGLE = np.radians(5.0)
"""rad, likewise."""


def last(history: Sequence[TrueStep], budget: int) -> bool:
    """The benchmark's success after the budget's last step."""
    return history[budget - 1].on_target


def ever(history: Sequence[TrueStep], budget: int) -> bool:
    """The benchmark's success after any step within the budget."""
    return any(step.on_target for step in history[:budget])


def strict(history: Sequence[TrueStep], budget: int) -> bool:
    """On the target, let go of and at rest after each step of the budget's last second."""
    second = history[budget - LAST_SECOND : budget]
    T_world_end = second[-1].T_world_object
    return all(
        step.on_target
        and not step.touched
        and bool(np.linalg.norm(step.T_world_object[:3, 3] - T_world_end[:3, 3]) < AT_REST)
        and rotation_angle(T_world_end[:3, :3].T @ step.T_world_object[:3, :3]) < AT_REST_ANGLE
        for step in second
    )


def criteria(history: Sequence[TrueStep], budget: int) -> dict[str, bool]:
    """Success by all measures but the first, `last` within the budget, of an episode of HORIZON steps."""
    return {
        "any": ever(history, budget),
        "strict": strict(history, budget),
        f"at {HORIZON}": last(history, HORIZON),
        f"any at {HORIZON}": ever(history, HORIZON),
        f"strict at {HORIZON}": strict(history, HORIZON),
    }
