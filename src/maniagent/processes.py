"""What worker processes owe their parent: to end with it, and to keep what libraries print out of its lines."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from pathlib import Path


def become_worker(log: Path | None) -> None:
    """Called first in a spawned process: Ctrl-C is the parent's to handle, output goes to `log`, else to stderr."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if log is not None:
        os.dup2(os.open(log, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644), 2)
    os.dup2(2, 1)  # also what C libraries print
    threading.Thread(target=_die_with_parent, daemon=True).start()


def _die_with_parent() -> None:
    """End this process when its parent is gone, even by SIGKILL: nobody would hear of its work any more."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
