"""A trial of SimplerEnv in a process of its own: `python -m maniagent.envs.simpler.trial` renders and makes one step.

The last line on stdout is JSON: `renderer` and `seconds`, or `error`. It is for `maniagent simpler setup`: what
libraries print stays out of its output, and a driver that takes the process down takes this one only.
"""

from __future__ import annotations

import json
import sys
import time
from importlib import import_module

import numpy as np

from ...errors import ManiAgentError
from .env import SimplerEnv
from .tasks import TASKS


def main() -> None:
    """Try it."""
    start = time.monotonic()
    try:
        env = SimplerEnv(TASKS["simpler-stack"])
        env.reset(0)
        env.step(np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]))
        spread = float(env.picture().std())
        told: dict[str, object] = {"renderer": _renderer(), "seconds": round(time.monotonic() - start, 1)}
        if spread < 1.0:
            told = {"error": "the picture is all of one colour"}
    except ManiAgentError as error:
        told = {"error": str(error)}
    sys.stdout.write("\n" + json.dumps(told) + "\n")


def _renderer() -> str:
    lines = str(import_module("sapien").render.get_device_summary()).splitlines()
    return next((line.removeprefix("GPU: ") for line in lines if line.startswith("GPU: ")), "unknown")


if __name__ == "__main__":
    main()
