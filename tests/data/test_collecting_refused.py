"""What is wrong with a folder or its disk is told in a line, and before anything moves."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from collection import TABLE, arguments, made, no_room, read_only, settings
from lerobot_python import PYTHON, needs_lerobot
from staged import made_info
from typer.testing import CliRunner

from maniagent.cli import app
from maniagent.data.collector import write_summary
from maniagent.data.ledger import attempts_file, key_of, note, read_attempts
from maniagent.data.lerobot.generation import locked
from maniagent.data.lerobot.publish import DATASET, STAGED, check_dataset
from maniagent.data.sessions import Session
from maniagent.data.settings import CollectSettings
from maniagent.errors import SetupError, UsageError
from maniagent.robots.sampling import Sampling

SAMPLING = Sampling(width=64, height=48)
IMAGES = "observation.images.main"


def refusal(folder: Path, *more: str, mode: str = "--stage-only") -> str:
    """What the command says when it ends before any worker begins."""
    done = CliRunner().invoke(app, arguments(folder, 2, mode, *more), catch_exceptions=False)
    assert done.exit_code == 2
    assert not list(folder.glob("worker-*.log"))
    told = " ".join(done.stderr.split())
    assert "Traceback" not in told
    return told


def cut(path: Path) -> None:
    """Keep the first half of a file."""
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


# The folder -----------------------------------------------------------------------------------------------------


def test_a_file_is_no_folder(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    assert "notes.txt can't be written: File exists. Name another folder" in refusal(tmp_path / "notes.txt")
    assert "can't be written: Not a directory" in refusal(tmp_path / "notes.txt" / "carrots")
    assert (tmp_path / "notes.txt").read_text() == "mine"


def test_two_collections_into_one_folder_at_once_are_one_too_many(tmp_path: Path) -> None:
    folder = made(tmp_path / "carrots")
    with locked(folder, name=".collect.lock"):
        assert "Another process is changing" in refusal(folder)


def test_a_folder_is_made_with_those_above_it(tmp_path: Path) -> None:
    settings().save(tmp_path / "a" / "b" / "c")
    assert CollectSettings.load(tmp_path / "a" / "b" / "c") == settings()


def test_a_start_that_was_killed_before_it_wrote_anything_whole_is_no_obstacle(tmp_path: Path) -> None:
    (tmp_path / ".collect.json.tmp").write_text('{"ta')
    settings().save(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["collect.json"]


def test_a_folder_that_may_not_be_written_to_is_told(tmp_path: Path) -> None:
    folder = made(tmp_path / "carrots")
    with read_only(folder) as possible:
        if not possible:
            pytest.skip("this root can't make a folder read-only")
        assert "collect.json can't be written" in refusal(folder)
    with read_only(tmp_path):
        assert "new can't be written" in refusal(tmp_path / "new")


@pytest.mark.parametrize(
    ("file", "told"),
    [
        ("collect.json", "collect.json can't be read: file: Invalid JSON"),
        ("plan-w00.json", "plan-w00.json can't be read: it isn't whole. Remove it"),
        (f"{STAGED}/{key_of(0, 0, 1)}/episode.json", "episode.json can't be read: it isn't whole. Move the episode"),
    ],
)
def test_a_file_that_is_cut_off_is_named(tmp_path: Path, file: str, told: str) -> None:
    folder = made(tmp_path / "carrots")
    cut(folder / file)
    assert told in refusal(folder)


@pytest.mark.parametrize("line", ["years of work", '{"key": 3}', "[]", "\x80\x81"])
def test_a_line_that_no_kill_leaves_is_named(tmp_path: Path, line: str) -> None:
    folder = made(tmp_path / "carrots")
    with attempts_file(folder, 0).open("a", encoding="latin-1") as file:
        file.write(f"{line}\n")
    assert "Line 3 of" in refusal(folder)


@pytest.mark.parametrize("rest", ["", "\0\0\0\0", '{"key":"w00-00'])
def test_a_line_that_was_cut_off_costs_itself_and_not_the_next_one(tmp_path: Path, rest: str) -> None:
    keys = [key_of(0, start, 1) for start in range(3)]
    note(tmp_path, 0, made_info(keys[0], label="failed"))
    with attempts_file(tmp_path, 0).open("a") as file:
        file.write(rest)
    for key in keys[1:]:
        note(tmp_path, 0, made_info(key, label="failed"))
    assert [info.key for info in read_attempts(tmp_path)] == keys


# The dataset ----------------------------------------------------------------------------------------------------


def made_dataset(folder: Path, **changed: object) -> Path:
    """As much of a dataset as is read before anything goes into it; returns its meta/info.json."""
    meta = folder / DATASET / "meta"
    meta.mkdir(parents=True)
    features = {IMAGES: {"dtype": "video", "shape": [48, 64, 3], "names": ["height", "width", "channels"]}}
    facts = {"fps": 10, "robot_type": "widowx_250s", "total_episodes": 0, "features": features}
    (meta / "info.json").write_text(json.dumps(facts | changed))
    (meta / "maniagent.jsonl").write_text("")
    return meta / "info.json"


def test_a_dataset_of_the_same_kind_is_gone_on_with(tmp_path: Path) -> None:
    made_dataset(tmp_path)
    check_dataset(tmp_path, SAMPLING)


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        ({"fps": 30}, "30 frames a second, not 10"),
        ({"robot_type": "so101"}, "robot so101, not widowx_250s"),
        ({"features": {IMAGES: {"dtype": "video", "shape": [240, 320, 3], "names": []}}}, "320 x 240 px, not 64 x 48"),
        ({"features": {"depth.main": {"dtype": "string", "shape": [1], "names": None}}}, "of another kind: depth"),
        ({"total_episodes": 4}, "tells of 0 episodes, the dataset has 4"),
    ],
)
def test_a_dataset_of_another_kind_is_found_before_anything_is_collected(
    tmp_path: Path, changed: dict[str, object], told: str
) -> None:
    made_dataset(tmp_path, **changed)
    with pytest.raises(UsageError, match=told):
        check_dataset(tmp_path, SAMPLING)


def test_a_dataset_that_no_collection_made_is_left_alone(tmp_path: Path) -> None:
    made_dataset(tmp_path).with_name("maniagent.jsonl").unlink()
    with pytest.raises(UsageError, match="no collection made"):
        check_dataset(tmp_path, SAMPLING)


def test_a_rate_that_videos_can_not_have_is_found_before_anything_is_collected(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"--fps: .* not 12\.5"):
        check_dataset(tmp_path, Sampling(rate=12.5))


def test_what_a_killed_publisher_was_removing_is_removed(tmp_path: Path) -> None:
    left = tmp_path / STAGED / f".{key_of(0, 0, 1)}.published"
    left.mkdir(parents=True)
    made_dataset(tmp_path)
    check_dataset(tmp_path, SAMPLING)
    assert not left.exists()


@needs_lerobot
def test_the_command_refuses_a_dataset_of_another_kind(tmp_path: Path) -> None:
    settings().save(tmp_path / "carrots")
    made_dataset(tmp_path / "carrots", fps=30)
    assert "30 frames a second" in refusal(tmp_path / "carrots", mode=f"--lerobot-python={PYTHON}")


def test_a_python_without_lerobot_is_found_before_anything_is_collected(tmp_path: Path) -> None:
    python = tmp_path / "python"
    python.write_text("#!/bin/sh\nexit 1\n")
    python.chmod(0o755)
    assert "has no lerobot" in refusal(tmp_path / "carrots", mode=f"--lerobot-python={python}")


# The disk -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("file", "write"),
    [
        ("attempts-w00.jsonl", lambda folder: note(folder, 0, made_info(key_of(0, 2, 1)))),
        ("sessions.jsonl", lambda folder: Session(folder, 1).add(writing=1.0)),
        ("plan-w00.json", lambda folder: TABLE.save(folder, 0)),
        ("collect.json", lambda folder: settings(count=3).save(folder)),
        ("summary.json", lambda folder: write_summary(settings(), folder)),
    ],
)
def test_a_full_disk_is_told_wherever_it_is_met_and_leaves_every_file_as_it_was(
    tmp_path: Path, file: str, write: Callable[[Path], object]
) -> None:
    folder = made(tmp_path / "carrots")
    before = (folder / file).read_bytes() if (folder / file).exists() else b""
    with no_room(), pytest.raises(SetupError, match=rf"no room on the disk at .*{file}"):
        write(folder)
    assert ((folder / file).read_bytes() if (folder / file).exists() else b"") == before
    assert not list(folder.glob(".*.tmp"))
    write(folder)  # with room again
