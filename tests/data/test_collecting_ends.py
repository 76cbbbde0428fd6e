"""However a collection is stopped, it ends with a line that says what to do, and the same command goes on."""

from __future__ import annotations

import os
import signal
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from collection import (
    alive,
    arguments,
    enlarge,
    episodes,
    made,
    no_room,
    settings,
    small_disk,
    started,
    wait_until,
    workers_of,
)
from lerobot_python import PYTHON, needs_lerobot

from maniagent.data import station
from maniagent.data.lerobot.ledger import read_ledger
from maniagent.data.lerobot.publish import DATASET
from maniagent.data.share import Share, Tried
from maniagent.envs.cameras import CameraSpec
from maniagent.envs.tabletop import TabletopEnv
from maniagent.errors import CameraFailure


def ended(process: subprocess.Popen[str]) -> str:
    """All that the command said; it and its workers must be gone within seconds."""
    told = " ".join(process.communicate(timeout=60)[0].split())
    assert "Traceback" not in told
    return told


def settled(folder: Path, count: int) -> Callable[[], bool]:
    """Whether so many whole episodes are staged."""
    return lambda: len(episodes(folder)) >= count


# Stopped from outside -------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_whatever_stops_a_collection_the_same_command_goes_on(tmp_path: Path) -> None:
    folder = tmp_path / "carrots"
    said = arguments(folder, 5, "--stage-only", "--workers", "2", "--reset", "teleport")

    process = started(*said)  # a worker dies, and is replaced; then Ctrl-C in the terminal
    wait_until(lambda: len(workers_of(process)) == 2)
    first = workers_of(process)
    os.kill(first[0], signal.SIGKILL)
    wait_until(lambda: len(workers_of(process)) == 2 and first[0] not in workers_of(process))
    wait_until(settled(folder, 1))
    workers = workers_of(process)
    os.killpg(process.pid, signal.SIGINT)
    told = ended(process)
    assert process.returncode == 130
    assert "are kept; the same command goes on from there" in told
    assert not any(map(alive, workers))
    kept = episodes(folder)

    process = started(*said)  # the command alone is killed, and can't tell its workers
    wait_until(settled(folder, len(kept) + 1))
    workers = workers_of(process)
    process.kill()
    ended(process)
    wait_until(lambda: not any(map(alive, workers)), limit=10)
    assert kept.items() <= episodes(folder).items()
    kept = episodes(folder)

    process = started(*said)  # Ctrl-C that only the command hears
    wait_until(lambda: len(workers_of(process)) > 0)
    process.send_signal(signal.SIGINT)
    assert "the same command goes on" in ended(process)
    assert process.returncode == 130
    assert kept.items() <= episodes(folder).items()

    process = started(*said)
    ended(process)
    assert process.returncode == 0
    assert len(episodes(folder)) == 5
    assert kept.items() <= episodes(folder).items()


@pytest.mark.slow
def test_a_worker_that_dies_each_time_ends_the_collection_with_the_name_of_its_log(tmp_path: Path) -> None:
    process = started(*arguments(tmp_path / "carrots", 2, "--stage-only"))
    killed: set[int] = set()
    while process.poll() is None:
        for worker in set(workers_of(process)) - killed:
            os.kill(worker, signal.SIGKILL)
            killed.add(worker)
    told = ended(process)
    assert process.returncode == 2
    assert len(killed) == 3
    assert "Worker 0 died 3 times running (killed by SIGKILL)" in told
    assert "worker-00.log may say why" in told


# A full disk ----------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_disk_that_fills_up_while_collecting_ends_it_and_with_room_it_goes_on(tmp_path: Path) -> None:
    disk = tmp_path / "disk"
    with small_disk(disk, megabytes=4) as possible:
        folder = disk / "carrots"
        said = arguments(folder, 3, "--stage-only", "--reset", "teleport")
        if possible:
            process = started(*said)
        else:
            with no_room(100_000):  # inherited by the command, and by its workers
                process = started(*said)
        told = ended(process)
        assert process.returncode == 2
        assert "There is no room on the disk" in told
        kept = episodes(folder)
        if possible:
            assert kept
            enlarge(disk, megabytes=64)
        process = started(*said)
        ended(process)
        assert process.returncode == 0
        assert len(episodes(folder)) == 3
        assert kept.items() <= episodes(folder).items()


@needs_lerobot
@pytest.mark.slow
def test_a_disk_without_room_for_the_dataset_loses_no_episode(tmp_path: Path) -> None:
    disk = tmp_path / "disk"
    with small_disk(disk, megabytes=4) as possible:
        if not possible:
            pytest.skip("takes a user who may mount a small disk")
        folder = made(disk / "carrots", 3)
        ballast = disk / "ballast"
        size = os.statvfs(disk).f_bavail * os.statvfs(disk).f_bsize - 60_000
        ballast.write_bytes(b"\1" * size)
        kept = episodes(folder)
        said = arguments(folder, 3, "--lerobot-python", str(PYTHON), "--batch", "2")
        process = started(*said)
        told = ended(process)
        assert process.returncode == 2
        assert "full" in told or "no room" in told
        assert episodes(folder) == kept
        assert not (folder / DATASET).exists()
        ballast.unlink()
        process = started(*said)
        ended(process)
        assert process.returncode == 0
        assert [info.key for info in read_ledger(folder / DATASET) or ()] == sorted(kept)
        assert not episodes(folder)


# A camera that stops --------------------------------------------------------------------------------------------


class StumblingEnv(TabletopEnv):
    """A twin whose side camera gives no picture once, in the middle of an episode."""

    taken = 0

    def take(self, camera: CameraSpec, *, depth: bool, rng: np.random.Generator | None) -> Any:
        recorded = camera.name == "side" and not depth  # the agents look with depth
        self.taken += recorded
        if recorded and self.taken == 8:
            raise CameraFailure("The side camera doesn't answer.")
        return super().take(camera, depth=depth, rng=rng)


@pytest.mark.slow
def test_a_camera_that_stops_costs_one_attempt(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(station, "TabletopEnv", StumblingEnv)
    tried = [said for said in Share(settings(1), 0).work() if isinstance(said, Tried)]
    assert [(said.info.label, said.info.reason) for said in tried] == [
        ("failed", "The side camera doesn't answer."),
        ("valid", ""),
    ]
    assert tried[0].recording is None
