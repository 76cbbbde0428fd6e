"""Which Python has lerobot: this one, or another one that the user names."""

from __future__ import annotations

import importlib.util
import os
import sys
from pathlib import Path

from ...errors import SetupError

VARIABLE = "MANIAGENT_LEROBOT_PYTHON"


def find_interpreter(named: Path | None = None) -> Path:
    """The interpreter that has lerobot: the one named, else that in MANIAGENT_LEROBOT_PYTHON, else this one.

    Raises SetupError where the named one isn't there, or where none is named and lerobot isn't installed here.
    Whether another one really has lerobot shows when the writer starts.
    """
    from_variable = os.environ.get(VARIABLE)
    if named is None and from_variable:
        named = Path(from_variable)
    if named is not None:
        if not (named.is_file() and os.access(named, os.X_OK)):
            raise SetupError(f"{named} is no Python interpreter; name one that has lerobot. {HOW}")
        return named.absolute()  # not resolved: a virtual environment's python is a link, and means what it is called
    if importlib.util.find_spec("lerobot") is None:
        raise SetupError(f"LeRobot datasets are written with lerobot, which isn't installed here. {HOW}")
    return Path(sys.executable)


HOW = (
    "Install it beside maniagent (pip install 'maniagent[lerobot]'), or, as it brings 8 GB, into an environment of "
    f"its own (python3.11 -m venv lerobot; lerobot/bin/pip install 'lerobot>=0.4.4,<0.5'), and set {VARIABLE} or "
    "--lerobot-python to its python."
)
