"""Which Python has lerobot."""

from __future__ import annotations

from pathlib import Path

from ..interpreter import interpreter_with

VARIABLE = "MANIAGENT_LEROBOT_PYTHON"
HOW = (
    "Install it beside maniagent (pip install 'maniagent[lerobot]'), or, as it brings 8 GB, into an environment of "
    f"its own (python3.11 -m venv lerobot; lerobot/bin/pip install 'lerobot>=0.4.4,<0.5'), and set {VARIABLE} or "
    "--lerobot-python to its python."
)


def find_interpreter(named: Path | None = None) -> Path:
    """The interpreter named, else that in MANIAGENT_LEROBOT_PYTHON, else this one. Raises as `interpreter_with`."""
    return interpreter_with(("lerobot",), named, VARIABLE, HOW)
