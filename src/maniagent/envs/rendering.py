"""Which OpenGL back-end draws the camera images: settled before MuJoCo makes its first renderer.

MuJoCo reads `MUJOCO_GL` while it is being imported and, left alone, takes GLFW, which needs a screen. Offscreen
there are two: EGL, on the GPU where there is one and in software where Mesa is installed, and OSMesa, always in
software. Whether one of them works depends on drivers, so each is asked to draw a picture, in a process of its own:
a driver that crashes takes only that process with it.
"""

from __future__ import annotations

import functools
import importlib
import os
import subprocess
import sys

from ..errors import SetupError

OFFSCREEN = ("egl", "osmesa")
"""Offscreen back-ends, the faster first."""

PACKAGES = {"egl": ("libegl1", "libopengl0", "libgl1-mesa-dri"), "osmesa": ("libosmesa6",)}
"""Debian and Ubuntu packages that let each back-end draw without a GPU; libegl1 alone brings no OpenGL library."""

PROBE_SECONDS = 120.0
"""A probe takes about a second on an idle machine; one that takes this long hangs in a driver."""

_PROBE = """
import mujoco
model = mujoco.MjModel.from_xml_string("<mujoco><worldbody><light pos='0 0 3'/><geom size='1'/></worldbody></mujoco>")
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
with mujoco.Renderer(model, 16, 16) as renderer:
    renderer.update_scene(data)
    assert renderer.render().any(), "the picture is black"
"""


def install_line(backend: str) -> str:
    """The line that installs what `backend` ("egl" or "osmesa") needs on Debian and Ubuntu."""
    sudo = "" if os.geteuid() == 0 else "sudo "
    return f"{sudo}apt-get install -y --no-install-recommends {' '.join(PACKAGES[backend])}"


@functools.cache
def probe(backend: str) -> str:
    """Why `backend` (a value for MUJOCO_GL) doesn't draw here, in one line; empty where it does.

    Asked once per process and back-end; takes about a second.
    """
    environment = {name: value for name, value in os.environ.items() if name != "PYOPENGL_PLATFORM"}
    try:
        done = subprocess.run(  # noqa: S603 - our own interpreter and our own text
            [sys.executable, "-c", _PROBE],
            env=environment | {"MUJOCO_GL": backend},
            capture_output=True,
            text=True,
            errors="replace",
            timeout=PROBE_SECONDS,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return f"no picture after {PROBE_SECONDS:.0f} s"
    if done.returncode == 0:
        return ""
    lines = done.stderr.strip().splitlines()
    return lines[-1].strip() if lines else f"the test picture ended with exit status {done.returncode}"


def ensure_gl() -> str:
    """Settle the back-end for this process and return its name; call it before a `mujoco.Renderer` is made.

    `MUJOCO_GL` is respected where it is set; else EGL is taken if it truly draws, else OSMesa. It may be called
    again and again, and also after MuJoCo was imported.

    Raises SetupError, with the line that installs what is missing, where nothing draws.
    """
    wanted = os.environ.get("MUJOCO_GL", "").strip().lower()
    reasons = {backend: probe(backend) for backend in ((wanted,) if wanted else ())}
    if not wanted:
        for backend in OFFSCREEN:
            reasons[backend] = probe(backend)
            if not reasons[backend]:
                break
    chosen = next((backend for backend, reason in reasons.items() if not reason), None)
    if chosen is None:
        raise SetupError(_advice(wanted, reasons))
    os.environ["MUJOCO_GL"] = chosen
    _rebind_mujoco(chosen)
    return chosen


def _advice(wanted: str, reasons: dict[str, str]) -> str:
    tried = "; ".join(f"{backend}: {reason}" for backend, reason in reasons.items())
    if wanted:
        remedy = f"unset MUJOCO_GL, so that one is chosen, or install what it needs: {install_line('egl')}"
        if wanted in PACKAGES:
            remedy = f"install what it needs, {install_line(wanted)}, or unset MUJOCO_GL"
        return f"MUJOCO_GL={wanted} is set, but it draws nothing here ({tried}); {remedy}"
    return f"No OpenGL back-end draws camera images here ({tried}). Install one: {install_line('egl')}"


def _rebind_mujoco(backend: str) -> None:
    """Let an already imported MuJoCo use `backend`; it looked at MUJOCO_GL at import only."""
    for name in ("mujoco.rendering.classic.gl_context", "mujoco.gl_context"):  # since 3.4; before
        module = sys.modules.get(name)
        context = getattr(module, "GLContext", None)
        if module is not None and context is not None:
            if not context.__module__.endswith(f".{backend}"):
                os.environ.pop("PYOPENGL_PLATFORM", None)
                importlib.reload(module)
            return
