import datetime
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from maniagent.console.folder import default_folder, prepare
from maniagent.errors import UsageError

NOON = datetime.datetime(2026, 11, 22, 12, 0, 0)


def test_the_default_folder_tells_when_what_and_which_seed() -> None:
    assert default_folder("carrot-on-plate", 7, NOON) == Path("runs/20261122-120000-carrot-on-plate-s7")


@given(st.text())
def test_the_default_folder_never_leaves_runs(name: str) -> None:
    folder = default_folder(name, 0, NOON)
    assert folder.parent == Path("runs")
    assert folder.name.isascii()
    assert " " not in folder.name


def test_a_foreign_folder_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("years of work")
    with pytest.raises(UsageError, match=r"thesis\.tex"):
        prepare(tmp_path)
    assert (tmp_path / "thesis.tex").read_text() == "years of work"


def test_a_run_with_something_foreign_in_it_is_left_alone(tmp_path: Path) -> None:
    for name in ("events.jsonl", "notes.txt"):
        (tmp_path / name).touch()
    with pytest.raises(UsageError, match=r"notes\.txt"):
        prepare(tmp_path)
    assert (tmp_path / "events.jsonl").exists()


def test_files_named_like_ours_without_a_log_are_foreign(tmp_path: Path) -> None:
    (tmp_path / "observations").mkdir()
    with pytest.raises(UsageError, match="observations"):
        prepare(tmp_path)


def test_a_file_in_the_place_of_a_folder_is_told(tmp_path: Path) -> None:
    (tmp_path / "out").touch()
    with pytest.raises(UsageError, match="is a file"):
        prepare(tmp_path / "out")
    with pytest.raises(UsageError, match="can't be made"):
        prepare(tmp_path / "out" / "below")
