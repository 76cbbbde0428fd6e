"""`maniagent eval` as people use it: the real command, the real simulator."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from typer.testing import CliRunner

from maniagent.cli import app

QUICK = ("eval", "drag-plate", "--seeds", "1", "--no-record", "--json")


def hear_ctrl_c() -> None:
    """Undo what a shell does to what it starts in the background (tests may run there): it has it ignore Ctrl-C."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def start(out: Path, *options: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "maniagent.cli", *QUICK, "--out", str(out), *options]
    pipe = subprocess.PIPE
    return subprocess.Popen(
        command, stdout=pipe, stderr=pipe, text=True, start_new_session=True, preexec_fn=hear_ctrl_c
    )  # fmt: skip


def lines(out: Path) -> list[bytes]:
    path = out / "results.jsonl"
    return path.read_bytes().splitlines(keepends=True) if path.exists() else []


def wait_for(done: Callable[[], object], process: subprocess.Popen[str], seconds: float = 240.0) -> None:
    deadline = time.monotonic() + seconds
    while not done():
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < deadline
        time.sleep(0.05)


def workers_of(process: subprocess.Popen[str]) -> list[int]:
    """Processes of the session that `process` leads, without itself."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rsplit(")", 1)[1].split()
        except (FileNotFoundError, ProcessLookupError):
            continue
        if int(fields[3]) == process.pid and int(stat.parent.name) != process.pid and fields[0] != "Z":
            found.append(int(stat.parent.name))
    return found


@pytest.mark.slow
def test_killed_half_way_it_goes_on_where_it_was(tmp_path: Path) -> None:
    options = ("--episodes", "4", "--workers", "2")
    first = start(tmp_path, *options)
    wait_for(lambda: lines(tmp_path), first)
    first.kill()
    first.wait()
    kept = lines(tmp_path)
    assert 1 <= len(kept) < 4
    deadline = time.monotonic() + 10
    while workers_of(first):
        assert time.monotonic() < deadline, "workers live on without their parent"
        time.sleep(0.1)
    with (tmp_path / "results.jsonl").open("ab") as file:
        file.write(b'{"task": "drag-plate", "se')
    second = start(tmp_path, *options)
    stdout, stderr = second.communicate(timeout=300)
    assert second.returncode == 0, stderr
    assert f"Going on: {len(kept)} of 4" in stderr
    assert lines(tmp_path)[: len(kept)] == kept
    assert sorted(json.loads(line)["episode"] for line in lines(tmp_path)) == [0, 1, 2, 3]
    told = json.loads(stdout)
    assert told["complete"] is True
    assert told["average"]["episodes"] == 4
    assert told == json.loads((tmp_path / "summary.json").read_text())


@pytest.mark.slow
def test_ctrl_c_stops_cleanly_and_keeps_what_is_done(tmp_path: Path) -> None:
    process = start(tmp_path, "--episodes", "3")
    wait_for(lambda: workers_of(process), process)
    time.sleep(2.0)
    os.killpg(process.pid, signal.SIGINT)
    stdout, stderr = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "Traceback" not in stderr
    assert "of 3 episodes are kept" in stderr
    assert json.loads(stdout) == {"error": "Stopped with Ctrl-C."}
    assert json.loads((tmp_path / "summary.json").read_text())["complete"] is False
    end = time.monotonic() + 10.0  # a worker on its way out may be slower than the one who sent it home
    while workers_of(process) and time.monotonic() < end:
        time.sleep(0.1)
    assert workers_of(process) == []


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("tabletop9",), "Did you mean"),
        (("tabletop", "--actor", "rulez"), "Did you mean 'rules'"),
        (("tabletop", "--out", "/proc/here"), "can't hold an evaluation"),
    ],
)
def test_wrong_use_is_one_json_object_and_status_2(
    arguments: tuple[str, ...], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(app, ["eval", *arguments, "--json"])
    assert done.exit_code == 2
    assert said in json.loads(done.stdout)["error"]
    assert list(tmp_path.iterdir()) == []
