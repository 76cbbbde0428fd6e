"""Whether the tests can play SimplerEnv here; they skip, and say why, where they can't."""

import os
from pathlib import Path

import pytest

from maniagent.envs.simpler import TASKS, SimplerEnv
from maniagent.envs.simpler.assets import require
from maniagent.errors import SetupError

_SHARED = Path(__file__).parents[2] / "shared" / "simplerenv-assets"


def skip_without() -> None:
    """Skip where the extra or the assets are missing."""
    if "MS_ASSET_DIR" not in os.environ and _SHARED.exists():
        os.environ["MS_ASSET_DIR"] = str(_SHARED)  # read when ManiSkill is imported
    try:
        require()
    except SetupError as error:
        pytest.skip(str(error))


def make(task: str) -> SimplerEnv:
    """The task's environment; skips also where nothing renders."""
    skip_without()
    try:
        return SimplerEnv(TASKS[task])
    except SetupError as error:
        pytest.skip(str(error))
