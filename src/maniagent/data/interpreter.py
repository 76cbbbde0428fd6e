"""Which Python has a heavy library: this one, or another one that the user names."""

from __future__ import annotations

import importlib.util
import os
import sys
from collections.abc import Sequence
from pathlib import Path

from ..errors import SetupError


def interpreter_with(modules: Sequence[str], named: Path | None, variable: str, how: str) -> Path:
    """The interpreter named, else that in an environment variable, else this one.

    Raises SetupError, saying `how` to get one, where the named one isn't there, or where none is named and a module
    isn't installed here. Whether another one really has them shows when it runs.
    """
    from_variable = os.environ.get(variable)
    if named is None and from_variable:
        named = Path(from_variable)
    if named is not None:
        if not (named.is_file() and os.access(named, os.X_OK)):
            raise SetupError(f"{named} is no Python interpreter; name one that has {modules[0]}. {how}")
        return named.absolute()  # not resolved: a virtual environment's python is a link, and means what it is called
    if any(importlib.util.find_spec(module) is None for module in modules):
        raise SetupError(f"This takes {modules[0]}, which isn't installed here. {how}")
    return Path(sys.executable)
