"""A small collection for tests of how collecting ends: made without a robot, or played by the real command."""

from __future__ import annotations

import contextlib
import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from staged import FPS, made_info, stage

from maniagent.data.ledger import key_of, note
from maniagent.data.lerobot.publish import STAGED
from maniagent.data.settings import CollectSettings, checked_settings
from maniagent.data.table import Table
from maniagent.robots.sampling import Sampling
from maniagent.testing import made_object

SMALL = ("--width", "64", "--height", "48")
TABLE = Table.seen(made_object(0, "carrot", (0.2, 0.15)), [made_object(1, "plate", (0.3, -0.1))])


def settings(count: int = 2, **said: object) -> CollectSettings:
    """What the command line of `arguments` says."""
    sampling = Sampling(rate=FPS, width=64, height=48)
    return checked_settings("carrot-on-plate", None, None, count=count, sampling=sampling, **said)


def arguments(folder: Path, count: int = 2, *more: str) -> list[str]:
    """Of `maniagent`."""
    return ["collect", "carrot-on-plate", "-n", str(count), "--out", str(folder), *SMALL, *more]


def made(folder: Path, count: int = 2) -> Path:
    """A collection of `count` episodes that are staged, and nothing in the dataset yet."""
    settings(count).save(folder)
    TABLE.save(folder, 0)
    for start in range(count):
        stage(folder / STAGED, key_of(0, start, 1))
        note(folder, 0, made_info(key_of(0, start, 1)))
    return folder


def started(*said: str) -> subprocess.Popen[str]:
    """The command, in a process group of its own."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # else a job in the background ignores Ctrl-C
    try:
        return subprocess.Popen(
            [sys.executable, "-m", "maniagent.cli", *said],
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True,
        )  # fmt: skip
    finally:
        signal.signal(signal.SIGINT, before)


def workers_of(process: subprocess.Popen[str]) -> list[int]:
    """The process ids of its workers, the eldest first."""
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children")
    found = []
    for child in map(int, children.read_text().split() if children.exists() else ()):
        with contextlib.suppress(OSError):
            if b"spawn_main" in Path(f"/proc/{child}/cmdline").read_bytes():
                found.append(child)
    return sorted(found)


def alive(pid: int) -> bool:
    """Whether a process runs; one that is only waited for doesn't."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def wait_until(what: Callable[[], bool], limit: float = 120.0) -> None:
    """Look often; TimeoutError after `limit` seconds."""
    end = time.monotonic() + limit
    while not what():
        if time.monotonic() > end:
            raise TimeoutError
        time.sleep(0.02)


def episodes(folder: Path) -> dict[str, dict[str, bytes]]:
    """What is staged: by key, the contents of each file."""
    return {
        info.parent.name: {file.name: file.read_bytes() for file in info.parent.iterdir()}
        for info in (folder / STAGED).glob("w*/episode.json")
    }


@contextlib.contextmanager
def no_room(size: int = 0) -> Iterator[None]:
    """No file may grow beyond `size` (bytes) in this process, as on a full disk: works for anybody, anywhere."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@contextlib.contextmanager
def read_only(folder: Path) -> Iterator[bool]:
    """A folder that may not be written to, whoever asks; yields False where this machine can't have one."""
    if os.geteuid() != 0:
        folder.chmod(0o555)
        yield True
        folder.chmod(0o755)
        return
    mounted = _ran("mount", "--bind", folder, folder) and _ran("mount", "-o", "remount,bind,ro", folder, folder)
    try:
        yield mounted
    finally:
        _ran("umount", folder)


@contextlib.contextmanager
def small_disk(folder: Path, megabytes: int) -> Iterator[bool]:
    """A disk of that size at `folder`; yields False where this user may not mount one."""
    folder.mkdir()
    mounted = os.geteuid() == 0 and _ran("mount", "-t", "tmpfs", "-o", f"size={megabytes}m", "tmpfs", folder)
    try:
        yield mounted
    finally:
        if mounted:
            _ran("umount", "-l", folder)


def enlarge(folder: Path, megabytes: int) -> None:
    """Make room on a small disk."""
    assert _ran("mount", "-o", f"remount,size={megabytes}m", folder)


def _ran(*command: str | Path) -> bool:
    try:
        return subprocess.run(command, capture_output=True, check=False).returncode == 0
    except FileNotFoundError:
        return False
