"""An event loop in a thread of its own, so that client libraries that are asynchronous can be called from anywhere.

Anywhere includes notebooks and servers, where the caller's thread has a running loop already. One loop serves all
models, as connections belong to the loop on which they were opened.
"""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Coroutine
from typing import Any, TypeVar

T = TypeVar("T")


class _Background:
    """The loop, started when it is first needed; the thread ends with the process."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._loop: asyncio.AbstractEventLoop | None = None

    def loop(self) -> asyncio.AbstractEventLoop:
        with self._lock:
            if self._loop is None:
                self._loop = asyncio.new_event_loop()
                threading.Thread(target=self._loop.run_forever, name="maniagent-models", daemon=True).start()
            return self._loop


_BACKGROUND = _Background()


def wait_for(coroutine: Coroutine[Any, Any, T]) -> T:
    """What the coroutine returns; where the caller is interrupted (Ctrl-C), the coroutine is cancelled."""
    future = asyncio.run_coroutine_threadsafe(coroutine, _BACKGROUND.loop())
    try:
        return future.result()
    finally:
        future.cancel()  # without effect on what is done
