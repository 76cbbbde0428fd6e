"""What worker processes owe their parent: to end with it, and to keep out of its lines what they print."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def starting_workers() -> Iterator[None]:
    """Hold Ctrl-C back while worker processes are started.

    One that is cut off in its start, or that hears Ctrl-C before `become_worker`, would print a traceback. Ours is told
    in the end; in those that were started the signal stays blocked.
    """
    pressed = False

    def note(number: int, frame: object) -> None:
        nonlocal pressed
        pressed = True

    if threading.current_thread() is not threading.main_thread():  # which doesn't hear it
        yield
        return
    before = signal.signal(signal.SIGINT, note)  # another thread may take the signal, mask or not
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # this is what they inherit
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        signal.signal(signal.SIGINT, before)
    if pressed:
        signal.raise_signal(signal.SIGINT)


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
