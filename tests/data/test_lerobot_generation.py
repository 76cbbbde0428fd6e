"""A dataset changes as a whole, whatever happens meanwhile."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from maniagent.data.lerobot import generation
from maniagent.data.lerobot.generation import exchange, locked, next_generation, recover
from maniagent.errors import UsageError


def make(dataset: Path, version: str) -> None:
    for name in ("data/chunk-000/file-000.parquet", "videos/observation.images.main/chunk-000/file-000.mp4",
                 "meta/episodes/chunk-000/file-000.parquet", "meta/info.json", "README.md"):  # fmt: skip
        path = dataset / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(version)


def content(dataset: Path) -> dict[str, str]:
    return {str(p.relative_to(dataset)): p.read_text() for p in dataset.rglob("*") if p.is_file()}


@pytest.fixture(params=[True, False], ids=["exchange", "two renames"])
def either_way(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    if not request.param:
        monkeypatch.setattr(generation, "exchange", lambda one, other: False)


@pytest.mark.usefixtures("either_way")
def test_a_change_takes_the_place_of_the_dataset_and_leaves_nothing_else(tmp_path: Path) -> None:
    dataset = tmp_path / "dataset"
    make(dataset, "1")
    with next_generation(dataset) as new:
        (new / "meta" / "info.json").write_text("2")
        assert (dataset / "meta" / "info.json").read_text() == "1"
    assert (dataset / "meta" / "info.json").read_text() == "2"
    assert [path.name for path in tmp_path.iterdir()] == ["dataset"]


def test_a_first_generation_is_made(tmp_path: Path) -> None:
    with next_generation(tmp_path / "dataset") as new:
        assert not new.exists()
        make(new, "1")
    assert content(tmp_path / "dataset")["README.md"] == "1"


@pytest.mark.usefixtures("either_way")
@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_what_fails_half_way_changes_nothing(tmp_path: Path, error: type[BaseException]) -> None:
    dataset = tmp_path / "dataset"
    make(dataset, "1")
    before = content(dataset)

    def fail() -> None:
        with next_generation(dataset) as new:
            make(new / "data", "2")
            raise error

    with pytest.raises(error):
        fail()
    assert content(dataset) == before
    assert [path.name for path in tmp_path.iterdir()] == ["dataset"]


def test_a_rename_that_fails_is_taken_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    dataset = tmp_path / "dataset"
    make(dataset, "1")
    monkeypatch.setattr(generation, "exchange", lambda one, other: False)
    rename = Path.rename

    def failing(path: Path, target: Path) -> Path:
        if path.name == "new":
            raise OSError(28, "No space left on device")
        return rename(path, target)

    monkeypatch.setattr(Path, "rename", failing)
    with pytest.raises(OSError, match="No space"), next_generation(dataset):
        pass
    assert content(dataset)["README.md"] == "1"


def test_only_large_files_are_shared_with_the_copy(tmp_path: Path) -> None:
    dataset = tmp_path / "dataset"
    make(dataset, "1")
    with next_generation(dataset) as new:
        assert content(new) == content(dataset)
        shared = {str(p.relative_to(new)) for p in new.rglob("*") if p.is_file() and p.stat().st_nlink > 1}
    assert shared == {name for name in content(dataset) if name not in ("README.md", "meta/info.json")}


def test_where_files_cannot_be_linked_they_are_copied(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    dataset = tmp_path / "dataset"
    make(dataset, "1")

    def refuse(source: str, target: str) -> None:
        raise OSError(1, "Operation not permitted")

    monkeypatch.setattr("os.link", refuse)
    with next_generation(dataset) as new:
        assert content(new) == content(dataset)


def test_a_kill_between_the_two_renames_is_mended(tmp_path: Path) -> None:
    dataset, scratch = tmp_path / "dataset", tmp_path / ".dataset.next" / "abc"
    make(scratch / "old", "1")
    make(scratch / "new", "2")
    recover(dataset)
    assert content(dataset)["README.md"] == "1"
    assert [path.name for path in tmp_path.iterdir()] == ["dataset"]


def test_two_folders_change_names_at_one_moment(tmp_path: Path) -> None:
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "was").write_text(name)
    if not exchange(tmp_path / "a", tmp_path / "b"):
        pytest.skip("this system can't exchange names")
    assert (tmp_path / "a" / "was").read_text() == "b"


def test_a_locked_folder_is_refused_and_free_once_its_holder_is_gone(tmp_path: Path) -> None:
    holding = (
        "import sys, time, pathlib\nfrom maniagent.data.lerobot.generation import locked\n"
        f"with locked(pathlib.Path({str(tmp_path)!r})):\n    print('in', flush=True)\n    time.sleep(60)"
    )
    with subprocess.Popen([sys.executable, "-c", holding], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        process.stdout.readline()
        with pytest.raises(UsageError, match="Another process"), locked(tmp_path, wait=0.1):
            pass
        process.kill()
        with locked(tmp_path, wait=5.0):
            pass


_CHANGING = """
import sys, pathlib, itertools
from maniagent.data.lerobot import generation
if sys.argv[2] == "renames":
    generation.exchange = lambda one, other: False
dataset = pathlib.Path(sys.argv[1])
generation.recover(dataset)
start = int((dataset / "meta" / "info.json").read_text())
print("ready", flush=True)
for number in itertools.count(start + 1):
    with generation.next_generation(dataset) as new:
        (new / "data" / f"{number}").write_text(str(number))
        (new / "meta" / "info.json").write_text(str(number))
"""


@pytest.mark.slow
@pytest.mark.parametrize("way", ["exchange", "renames"])
def test_killed_at_any_moment_a_dataset_is_whole(tmp_path: Path, way: str) -> None:
    dataset, draw = tmp_path / "dataset", np.random.default_rng(0)
    make(dataset, "0")
    for _ in range(5):
        with subprocess.Popen([sys.executable, "-c", _CHANGING, str(dataset), way], stdout=subprocess.PIPE) as process:
            assert process.stdout is not None
            process.stdout.readline()
            time.sleep(draw.uniform(0, 0.1))
            process.send_signal(signal.SIGKILL)
        if way == "exchange":
            assert dataset.exists()  # not even for a moment isn't it there
        recover(dataset)
        number = int((dataset / "meta" / "info.json").read_text())
        assert {p.name for p in (dataset / "data").iterdir()} == {"chunk-000", *(str(n + 1) for n in range(number))}
    assert number > 0
