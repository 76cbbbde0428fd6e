"""Is this machine fit to run? Each need is tried out, not looked up: an installed library may still not work."""

from __future__ import annotations

import importlib
import importlib.metadata
import io
import os
import platform
import re
import sys
import tempfile
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .envs.rendering import OFFSCREEN, install_line, probe
from .envs.simpler.assets import EXTRA, SETUP, asset_root, missing_files, missing_packages

_OLDEST_PYTHON = (3, 11)
_REINSTALL = "{python} -m pip install --force-reinstall --no-deps {package}"


@dataclass(frozen=True)
class Check:
    """One thing that was looked at."""

    name: str
    ok: bool
    detail: str
    """A version, a path, or why it does not work."""
    fix: str = ""
    """The line that mends it; empty where it is fine."""
    needed: bool = True
    """Whether `maniagent run` fails without it."""


def examine() -> tuple[Check, ...]:
    """Look at everything; takes a few seconds."""
    with ThreadPoolExecutor(len(OFFSCREEN)) as pool:  # the probes are processes of their own
        reasons = pool.map(probe, OFFSCREEN)
        tried = tuple(_tried(name, package, trial) for name, package, trial in _TRIALS)
        renderers = _renderers(dict(zip(OFFSCREEN, reasons, strict=True)))
    return (
        _python(),
        *tried,
        *renderers,
        _writable(Path.cwd()),
        _screen(os.environ),
        _processors(),
        *_extras(),
        _simpler(),
    )


def works(checks: Sequence[Check]) -> bool:
    """Whether `maniagent run` works here."""
    return all(check.ok for check in checks if check.needed)


def _python() -> Check:
    oldest = ".".join(map(str, _OLDEST_PYTHON))
    ok = sys.version_info[:2] >= _OLDEST_PYTHON
    return Check("Python", ok, platform.python_version(), "" if ok else f"maniagent needs Python {oldest} or newer")


def _tried(name: str, package: str, trial: Callable[[], None]) -> Check:
    """Whether a library does its work: these are the ways in which native extensions and their parts fail."""
    fix = _REINSTALL.format(python=sys.executable, package=package)
    try:
        version = importlib.metadata.version(package)
        trial()
    except importlib.metadata.PackageNotFoundError:
        return Check(name, False, "not installed", f"{sys.executable} -m pip install {package}")
    except (ImportError, OSError, RuntimeError, ValueError, AttributeError) as error:
        return Check(name, False, f"{type(error).__name__}: {error}", fix)
    return Check(name, True, f"{package} {version}")


def _simulate() -> None:
    import mujoco

    model = mujoco.MjModel.from_xml_string(_TWO_LINKS)
    mujoco.mj_step(model, mujoco.MjData(model))


def _solve_ik() -> None:
    import mink
    import mujoco

    configuration = mink.Configuration(mujoco.MjModel.from_xml_string(_TWO_LINKS))
    configuration.update(np.array([0.3, 0.4]))
    task = mink.FrameTask("tip", "site", position_cost=1.0, orientation_cost=0.0)
    task.set_target(mink.SE3.from_translation(np.array([0.3, 0.0, 0.2])))
    for _ in range(100):
        configuration.integrate_inplace(mink.solve_ik(configuration, [task], 0.1, solver="daqp", damping=1e-6), 0.1)
    error = float(np.linalg.norm(task.compute_error(configuration)[:3]))
    if not error < 1e-3:
        raise RuntimeError(f"the test pose was missed by {1e3 * error:.1f} mm")


def _plan() -> None:
    from ompl import base, geometric

    space = base.RealVectorStateSpace(1)
    space.setBounds(0.0, 1.0)
    geometric.SimpleSetup(space)


def _time() -> None:
    import ruckig

    request, trajectory = ruckig.InputParameter(1), ruckig.Trajectory(1)
    request.target_position = [1.0]
    request.max_velocity = request.max_acceleration = request.max_jerk = [1.0]
    verdict = ruckig.Ruckig(1).calculate(request, trajectory)
    if verdict != ruckig.Result.Working:
        raise RuntimeError(f"the test trajectory ended with {verdict}")


def _encode() -> None:
    import av

    with av.open(io.BytesIO(), "w", format="mp4") as container:
        stream = container.add_stream("libx264", rate=10)
        stream.width, stream.height, stream.pix_fmt = 64, 64, "yuv420p"
        frame = av.VideoFrame.from_ndarray(np.zeros((64, 64, 3), np.uint8), format="rgb24")
        for packet in (*stream.encode(frame), *stream.encode(None)):
            container.mux(packet)


_TWO_LINKS = """
<mujoco>
  <worldbody>
    <body><joint name="shoulder" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 .25 0 0" size=".02"/>
      <body pos=".25 0 0"><joint name="elbow" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 .25 0 0" size=".02"/>
        <site name="tip" pos=".25 0 0"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""

_TRIALS: tuple[tuple[str, str, Callable[[], None]], ...] = (
    ("simulation", "mujoco", _simulate),
    ("inverse kinematics", "mink", _solve_ik),
    ("motion planning", "ompl", _plan),
    ("motion timing", "ruckig", _time),
    ("video encoder", "av", _encode),
)


def _renderers(reasons: dict[str, str]) -> list[Check]:
    """One check a back-end; only if none draws is one of them needed."""
    none_draws = all(reasons.values())
    return [
        Check(
            f"rendering, {backend}",
            not reason,
            reason or "draws offscreen",
            install_line(backend) if reason else "",
            needed=none_draws and backend == OFFSCREEN[0],
        )
        for backend, reason in reasons.items()
    ]


def _writable(folder: Path) -> Check:
    try:
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        fix = "cd to a folder you may write to, or use --out"
        return Check("run folder", False, f"{folder}: {error.strerror}", fix)
    return Check("run folder", True, f"{folder} can be written")


def _screen(environment: os._Environ[str]) -> Check:
    for variable in ("WAYLAND_DISPLAY", "DISPLAY"):
        if environment.get(variable):
            return Check("screen", True, f"{variable}={environment[variable]}", needed=False)
    return Check("screen", False, "none; only --view needs one", "run on a desktop to use --view", needed=False)


def _processors() -> Check:
    count = len(os.sched_getaffinity(0))
    return Check("processors", True, f"{count}", needed=False)


def _extras() -> list[Check]:
    """The package's optional extras, whatever they are: which are installed as a whole."""
    names = importlib.metadata.metadata("maniagent").get_all("Provides-Extra") or []
    return [_extra(name, importlib.metadata.requires("maniagent") or []) for name in sorted(names)]


def _extra(name: str, requirements: Sequence[str]) -> Check:
    wanted = [line for line in requirements if re.search(rf"extra == .{re.escape(name)}\W", line)]
    packages = [re.split(r"[^\w.-]", line, maxsplit=1)[0] for line in wanted]
    missing = [package for package in packages if not _installed(package)]
    if not missing:
        return Check(f"extra, {name}", True, "installed", needed=False)
    detail = f"missing {', '.join(missing)}"
    return Check(f"extra, {name}", False, detail, f"{sys.executable} -m pip install 'maniagent[{name}]'", needed=False)


def _simpler() -> Check:
    """Whether the benchmark's packages and assets are here; `maniagent simpler setup` tries whether they work."""
    if packages := missing_packages():
        return Check("SimplerEnv", False, f"missing {', '.join(packages)}", EXTRA, needed=False)
    root = asset_root()
    if missing_files(root):
        return Check("SimplerEnv", False, f"assets missing in {root}", f"{SETUP} --assets {root}", needed=False)
    return Check("SimplerEnv", True, f"assets in {root}", needed=False)


def _installed(package: str) -> bool:
    try:
        importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return False
    return True
