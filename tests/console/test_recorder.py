import json
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
import synthetic
from PIL import Image

from maniagent.console.recorder import Recorder
from maniagent.console.report import write_report
from maniagent.types import ActionSequence

SMALL = (160, 120)


def record(folder: Path, **options: Any) -> None:
    with Recorder(folder) as recorder:
        for event in synthetic.events(size=SMALL, **options):
            recorder.on_event(event)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("runs") / "run"
    record(path)
    return path


def test_the_log_has_every_event_but_video_frames(folder: Path) -> None:
    logged = [json.loads(line) for line in (folder / "events.jsonl").read_text().splitlines()]
    told = [event for event in synthetic.events(size=SMALL) if event.kind != "frame"]
    assert [record["kind"] for record in logged] == [event.kind for event in told]
    assert [record["time"] for record in logged] == pytest.approx([event.time for event in told], abs=1e-3)


def test_every_file_the_log_names_is_there(folder: Path) -> None:
    for line in (folder / "events.jsonl").read_text().splitlines():
        for name in json.loads(line).get("files", {}).values():
            assert (folder / name).stat().st_size > 0


def test_pictures_are_what_the_cameras_saw(folder: Path) -> None:
    with Image.open(folder / "observations/turn-02-side.png") as image:
        assert np.array_equal(np.asarray(image), synthetic.camera("side", *SMALL).rgb)


def test_sequences_read_back_as_they_were_written(folder: Path) -> None:
    text = (folder / "sequences/turn-01.json").read_text()
    assert ActionSequence.model_validate_json(text) == synthetic.sequence()


def test_the_summary_says_what_happened(folder: Path) -> None:
    summary = json.loads((folder / "summary.json").read_text())
    assert (summary["task"], summary["seed"], summary["verdict"]) == ("carrot-on-plate", 3, "achieved")
    assert summary["achieved"] is True
    assert [subtask["verdict"] for subtask in summary["subtasks"]] == ["failure", "success"]
    assert summary["out"] == str(folder)


def test_an_earlier_run_is_replaced(tmp_path: Path) -> None:
    record(tmp_path / "run")
    record(tmp_path / "run", frames=0)
    assert not (tmp_path / "run/video.mp4").exists()
    assert (tmp_path / "run/report.html").exists()


def test_an_interrupted_run_still_gets_a_report(tmp_path: Path) -> None:
    def stopped_by_a_person() -> None:
        with Recorder(tmp_path) as recorder:
            for event in synthetic.events(size=SMALL):
                if event.kind == "executed":
                    raise KeyboardInterrupt
                recorder.on_event(event)

    with pytest.raises(KeyboardInterrupt):
        stopped_by_a_person()
    assert "Cut short" in (tmp_path / "report.html").read_text()
    assert not (tmp_path / "summary.json").exists()


_KILLED = """
import os, signal, sys
from pathlib import Path
from typing import Any
sys.path.insert(0, sys.argv[2])
import synthetic
from maniagent.console.recorder import Recorder
recorder = Recorder(Path(sys.argv[1]))
executed = 0
for event in synthetic.events(size=(160, 120)):
    recorder.on_event(event)
    executed += event.kind == "executed"
    if executed == 2:
        os.kill(os.getpid(), signal.SIGKILL)
"""


def test_all_that_was_recorded_before_a_kill_is_readable(tmp_path: Path) -> None:
    run = tmp_path / "run"
    here = Path(__file__).parent
    done = subprocess.run([sys.executable, "-c", _KILLED, str(run), str(here)], check=False, capture_output=True)
    assert done.returncode == -signal.SIGKILL, done.stderr.decode()
    kinds = [json.loads(line)["kind"] for line in (run / "events.jsonl").read_text().splitlines()]
    assert kinds[-1] == "executed"
    with av.open(str(run / "video.mp4")) as container:
        frames = sum(1 for _ in container.decode(video=0))
    assert frames >= 9 * 12 - 10  # all but the last, unfinished second
    assert "Cut short" in write_report(run).read_text()
    record(run)  # and the folder can be used again
