"""A window on the running simulation, for people to watch (`maniagent run --view`)."""

from __future__ import annotations

import os
import sys
import threading
import time

import mujoco

from ..errors import SetupError


def require_screen() -> None:
    """Raise SetupError where no window can be opened."""
    if sys.platform == "linux" and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise SetupError(
            "--view opens a window, and there is no screen here (neither DISPLAY nor WAYLAND_DISPLAY is set). "
            "Run it on a desktop, or leave --view out: the run folder holds a video."
        )


class LiveView:
    """MuJoCo's viewer, kept at real time. Closing the window ends the showing, not the run."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        from mujoco import viewer  # it needs a GL library with windows, which nothing else here does

        self._data = data
        others = set(threading.enumerate())
        self._viewer = viewer.launch_passive(model, data, show_left_ui=False, show_right_ui=False)
        self._threads = set(threading.enumerate()) - others
        self._start = time.monotonic() - data.time

    def show(self) -> None:
        """Draw the present state, and wait until it is due."""
        if not self._viewer.is_running():
            return
        self._viewer.sync()
        ahead = self._data.time - (time.monotonic() - self._start)
        if ahead > 0:
            time.sleep(ahead)
        else:
            self._start = time.monotonic() - self._data.time  # after a pause for thought, not in fast motion

    def close(self) -> None:
        """Close the window, and wait until the viewer's thread lets go of model and data."""
        self._viewer.close()
        for thread in self._threads:
            thread.join(timeout=5.0)
