"""The benchmark's four tasks with a WidowX, by our names."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

LAYOUTS = 24
"""Start layouts of each task; an episode is one of them."""
PERIOD = 0.2
"""s, one control step."""
HORIZON = 120
"""Steps to which every episode is played on; the largest of the registered budgets."""


@dataclass(frozen=True)
class SimplerTask:
    """One of the benchmark's tasks."""

    name: str
    env_id: str
    steps: int
    """Step budget that the benchmark registers."""


TASKS: Mapping[str, SimplerTask] = {
    task.name: task
    for task in (
        SimplerTask("simpler-stack", "StackGreenCubeOnYellowCubeBakedTexInScene-v1", 60),
        SimplerTask("simpler-carrot", "PutCarrotOnPlateInScene-v1", 60),
        SimplerTask("simpler-spoon", "PutSpoonOnTableClothInScene-v1", 60),
        SimplerTask("simpler-eggplant", "PutEggplantInBasketScene-v1", 120),
    )
}
