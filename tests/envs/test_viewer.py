"""The window on a running simulation; where there is a screen, it opens and closes."""

import os

import pytest

from maniagent import tasks
from maniagent.envs.tabletop import TabletopEnv
from maniagent.envs.viewer import require_screen
from maniagent.errors import SetupError


def test_without_a_screen_the_reason_and_the_way_out_are_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with pytest.raises(SetupError, match=r"no screen here.*leave --view out"):
        require_screen()
    with pytest.raises(SetupError):
        TabletopEnv(tasks.get("carrot-on-plate").scene, render_mode="human")


@pytest.mark.slow
@pytest.mark.skipif("DISPLAY" not in os.environ, reason="there is no screen; xvfb-run gives one")
def test_the_window_opens_shows_and_closes() -> None:
    env = TabletopEnv(tasks.get("carrot-on-plate").scene, render_mode="human")
    env.reset(seed=0)
    env.close()
