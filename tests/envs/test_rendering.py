import os
import subprocess
import sys

import pytest

from maniagent.envs import rendering
from maniagent.errors import SetupError

DRAW = """
import mujoco
model = mujoco.MjModel.from_xml_string("<mujoco><worldbody><light pos='0 0 3'/><geom size='1'/></worldbody></mujoco>")
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
with mujoco.Renderer(model, 8, 8) as renderer:
    renderer.update_scene(data)
    assert renderer.render().any()
"""


def python(code: str) -> subprocess.CompletedProcess[str]:
    clean = {name: value for name, value in os.environ.items() if name not in ("MUJOCO_GL", "PYOPENGL_PLATFORM")}
    return subprocess.run([sys.executable, "-c", code], env=clean, capture_output=True, text=True, check=False)


@pytest.fixture
def probes(monkeypatch: pytest.MonkeyPatch) -> dict[str, str]:
    """What each back-end's probe answers, and no back-end wanted or bound."""
    answers: dict[str, str] = {}
    monkeypatch.setattr(rendering, "probe", lambda backend: answers.get(backend, "is missing"))
    monkeypatch.setattr(rendering, "_rebind_mujoco", lambda backend: None)
    monkeypatch.setenv("MUJOCO_GL", "")
    return answers


def test_egl_is_taken_where_it_draws(probes: dict[str, str]) -> None:
    probes |= {"egl": "", "osmesa": ""}
    assert rendering.ensure_gl() == os.environ["MUJOCO_GL"] == "egl"


def test_a_broken_egl_falls_through_to_osmesa(probes: dict[str, str]) -> None:
    probes |= {"osmesa": ""}
    assert rendering.ensure_gl() == os.environ["MUJOCO_GL"] == "osmesa"


def test_where_nothing_draws_the_error_holds_the_line_that_mends_it(probes: dict[str, str]) -> None:
    with pytest.raises(
        SetupError, match="apt-get install -y --no-install-recommends libegl1 libopengl0 libgl1-mesa-dri"
    ):
        rendering.ensure_gl()
    assert not os.environ["MUJOCO_GL"]


def test_a_wish_is_respected(probes: dict[str, str], monkeypatch: pytest.MonkeyPatch) -> None:
    probes |= {"egl": "", "osmesa": ""}
    monkeypatch.setenv("MUJOCO_GL", "osmesa")
    assert rendering.ensure_gl() == "osmesa"


@pytest.mark.parametrize("wanted", ["egl", "glfw", "nonsense"])
def test_a_wish_that_cannot_be_granted_is_told(
    probes: dict[str, str], monkeypatch: pytest.MonkeyPatch, wanted: str
) -> None:
    probes |= {"osmesa": ""}
    monkeypatch.setenv("MUJOCO_GL", wanted)
    with pytest.raises(SetupError, match=f"MUJOCO_GL={wanted} is set, but"):
        rendering.ensure_gl()


def test_it_works_after_mujoco_was_imported() -> None:
    done = python(f"import mujoco\nfrom maniagent.envs.rendering import ensure_gl\nprint(ensure_gl())\n{DRAW}")
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() in rendering.OFFSCREEN


def test_a_probe_of_what_can_not_draw_says_why() -> None:
    assert "invalid value" in rendering.probe("nonsense")
