"""SimplerEnv's four WidowX tasks, as ManiSkill3 ships them (extra `simpler`)."""

from .env import CAMERA, FINGER_OFFSET, SimplerEnv
from .starts import Start, draw_start
from .tasks import HORIZON, LAYOUTS, PERIOD, TASKS, SimplerTask
from .truth import TrueStep

__all__ = [
    "CAMERA",
    "FINGER_OFFSET",
    "HORIZON",
    "LAYOUTS",
    "PERIOD",
    "TASKS",
    "SimplerEnv",
    "SimplerTask",
    "Start",
    "TrueStep",
    "draw_start",
]
