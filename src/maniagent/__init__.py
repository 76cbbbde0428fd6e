"""maniagent: an instruction and RGB-D images in, a carried-out manipulation task out; no training.

Implements ManiAgent (arXiv 2510.11660).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .app import RunOutcome, run

__version__ = "0.1.0"
__all__ = ["RunOutcome", "__version__", "run"]


def __getattr__(name: str) -> Any:
    """`run` and `RunOutcome` on first use: importing the package alone stays instant."""
    if name in ("RunOutcome", "run"):
        from . import app

        return getattr(app, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
