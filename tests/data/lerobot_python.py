"""Finds an interpreter that has lerobot, for the tests that can't do without."""

from __future__ import annotations

import functools
import importlib.util
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

VARIABLE = "MANIAGENT_LEROBOT_PYTHON"


def found_python() -> Path | None:
    """The interpreter in MANIAGENT_LEROBOT_PYTHON, else this one, else that which lerobot's own commands run with."""
    if VARIABLE in os.environ:
        return Path(os.environ[VARIABLE])
    if importlib.util.find_spec("lerobot"):
        return Path(sys.executable)
    if command := shutil.which("lerobot-info"):
        return Path(command).resolve().parent / "python"
    return None


@functools.cache
def works(python: Path) -> bool:
    """Whether it really can import lerobot."""
    return subprocess.run([python, "-c", "import importlib.util as u; assert u.find_spec('lerobot')"]).returncode == 0


PYTHON = found_python()
needs_lerobot = pytest.mark.skipif(
    PYTHON is None or not works(PYTHON), reason=f"no Python has lerobot here; name one in {VARIABLE}"
)
