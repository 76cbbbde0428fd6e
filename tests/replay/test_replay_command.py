"""`maniagent replay` on runs of the rules in the twin, in processes of its own."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from recorded import SCENARIOS, record
from typer.testing import CliRunner

from maniagent.app import run
from maniagent.cli import app
from maniagent.console.folder import OBSERVATIONS, look_name, picture_name
from maniagent.replay.looks import load_look, save_look
from maniagent.types import Observation

TASK = "carrot-on-plate"


@pytest.fixture(scope="module")
def recorded_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("runs") / "run"
    assert run(task=TASK, seed=3, out=folder).achieved
    return folder


@pytest.fixture
def folder(recorded_run: Path, tmp_path: Path) -> Path:
    return shutil.copytree(recorded_run, tmp_path / "run")


def replayed(folder: Path) -> tuple[int, dict[str, Any]]:
    command = [sys.executable, "-m", "maniagent.cli", "replay", str(folder), "--json"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)
    return done.returncode, json.loads(done.stdout)


def change_depth(folder: Path, change: Any) -> None:
    """Change the main view's depth image (H, W) of the first turn."""
    path = folder / OBSERVATIONS / look_name(1)
    seen = load_look(path, lambda view: path.parent / picture_name(1, view))
    depth: NDArray[np.float32] = seen.main_frame.depth.copy()
    change(depth)
    frame = type(seen.main_frame)("main", seen.main_frame.rgb, depth, seen.main_frame.K, seen.main_frame.T_base_camera)
    save_look(path, Observation({**seen.frames, "main": frame}, "main", seen.robot))


@pytest.mark.slow
def test_a_fresh_process_comes_to_the_same_decisions(folder: Path) -> None:
    status, found = replayed(folder)
    assert (status, found["same"], found["complete"], found["difference"]) == (0, True, True, None)
    lines = [json.loads(line) for line in (folder / "events.jsonl").read_text().splitlines()]
    kinds = [line["kind"] for line in lines]
    assert found["decisions"] == sum(kinds.count(kind) for kind in ("described", "reasoned", "located", "planned"))


@pytest.mark.slow
def test_other_depths_are_other_decisions_and_the_first_one_is_named(folder: Path) -> None:
    def sink(depth: NDArray[np.float32]) -> None:
        depth[150:330, 200:440] += 0.004

    change_depth(folder, sink)
    status, found = replayed(folder)
    assert (status, found["same"]) == (1, False)
    assert (found["difference"]["turn"], found["difference"]["kind"]) == (1, "described")


@pytest.mark.slow
def test_one_pixel_that_nobody_looks_at_changes_nothing(folder: Path) -> None:
    def touch(depth: NDArray[np.float32]) -> None:
        depth[0, 0] += 0.001

    change_depth(folder, touch)
    status, found = replayed(folder)
    assert (status, found["same"]) == (0, True)


@pytest.mark.slow
def test_a_run_that_was_killed_is_replayed_as_far_as_it_came(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    command = [sys.executable, "-m", "maniagent.cli", "run", "--task", TASK, "--seed", "3", "--out", str(folder)]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    log, patience = folder / "events.jsonl", time.monotonic() + 120
    while not (log.is_file() and log.read_text().count('"Carry it')):
        assert process.poll() is None, "the run ended before it was killed"
        assert time.monotonic() < patience
        time.sleep(0.02)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    status, found = replayed(folder)
    assert (status, found["same"], found["complete"]) == (0, True, False)
    assert (found["turns"], found["decisions"]) == (1, 4)


def test_neither_simulator_nor_renderer_is_loaded(tmp_path: Path) -> None:
    record(tmp_path, SCENARIOS["at once"])
    code = (
        "import sys\nfrom maniagent.replay.play import replay\n"
        "print([name for name in sys.modules if name.startswith(('maniagent.envs', 'maniagent.tasks', 'gymnasium'))])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_what_can_not_be_replayed_is_one_line_and_status_2(tmp_path: Path) -> None:
    for place in (tmp_path / "nowhere", tmp_path):
        result = CliRunner().invoke(app, ["replay", str(place)], catch_exceptions=False)
        assert (result.exit_code, result.stdout) == (2, "")
        assert "is no run folder" in result.stderr


@pytest.mark.slow
def test_a_person_reads_what_was_found(folder: Path) -> None:
    result = CliRunner().invoke(app, ["replay", str(folder)], catch_exceptions=False)
    assert (result.exit_code, result.stdout) == (0, "The same: 6 decisions on 2 turns.\n")
    log = folder / "events.jsonl"
    log.write_text(log.read_text().replace('"skill": "pick-and-place"', '"skill": "drag"'))
    result = CliRunner().invoke(app, ["replay", str(folder)], catch_exceptions=False)
    assert result.exit_code == 1
    assert 'turn 1, planned sequence.skill: recorded "drag", replayed "pick-and-place"' in result.stdout
