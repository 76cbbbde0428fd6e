"""Finds an interpreter that has tensorflow_datasets, for the tests that can't do without."""

from __future__ import annotations

import functools
import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import pytest

from maniagent.data.rlds.client import VARIABLE


def found_python() -> Path | None:
    """The interpreter in MANIAGENT_TFDS_PYTHON, else this one."""
    if os.environ.get(VARIABLE):
        return Path(os.environ[VARIABLE])
    return Path(sys.executable) if importlib.util.find_spec("tensorflow_datasets") else None


@functools.cache
def works(python: Path) -> bool:
    """Whether it really has it."""
    code = "import importlib.util as u; assert u.find_spec('tensorflow_datasets') and u.find_spec('tensorflow')"
    return subprocess.run([python, "-c", code]).returncode == 0


PYTHON = found_python()
needs_tfds = pytest.mark.skipif(
    PYTHON is None or not works(PYTHON), reason=f"no Python has tensorflow_datasets here; name one in {VARIABLE}"
)
