"""What was written is found again, after any death, and never mixed with anything else."""

from pathlib import Path

import pytest

from maniagent.errors import UsageError
from maniagent.evaluation.episode import EpisodeResult, Job, lost
from maniagent.evaluation.results import RESULTS, SETTINGS, ResultsFile, Settings

SETTING = Settings(
    suite="fake", tasks=("win",), actor="rules", episodes=3, seeds=1, time_limit=300.0, version="1"
)  # fmt: skip
FIRST, SECOND = (lost(Job("win", 0, k), "crash", "two\nlines, and U+2028:\u2028.") for k in (0, 1))


def written(folder: Path, *results: EpisodeResult) -> Path:
    with ResultsFile(folder, SETTING) as file:
        for result in results:
            file.add(result)
    return folder / RESULTS


def read(folder: Path) -> list[EpisodeResult]:
    with ResultsFile(folder, SETTING) as file:
        return file.done


def test_results_come_back_as_they_were(tmp_path: Path) -> None:
    written(tmp_path / "a" / "b", FIRST, SECOND)
    assert read(tmp_path / "a" / "b") == [FIRST, SECOND]


def test_a_result_is_in_the_file_before_the_next_begins(tmp_path: Path) -> None:
    with ResultsFile(tmp_path, SETTING) as file:
        file.add(FIRST)
        assert (tmp_path / RESULTS).read_text().endswith("\n")


@pytest.mark.parametrize("kept", [1, 20, -1])
def test_a_half_written_last_line_is_dropped_and_the_next_one_is_whole(tmp_path: Path, kept: int) -> None:
    path = written(tmp_path, FIRST, SECOND)
    first, second = path.read_bytes().split(b"\n")[:2]
    path.write_bytes(first + b"\n" + second[:kept])
    assert read(tmp_path) == [FIRST]
    written(tmp_path, SECOND)
    assert read(tmp_path) == [FIRST, SECOND]


def test_a_damaged_line_is_told_with_its_number(tmp_path: Path) -> None:
    path = written(tmp_path, FIRST)
    path.write_bytes(b"{}\n" + path.read_bytes())
    with pytest.raises(UsageError, match=r"results.jsonl, line 1,"):
        read(tmp_path)


@pytest.mark.parametrize(
    "change", [{"episodes": 4}, {"seeds": 2}, {"actor": "other"}, {"suite": "x"}, {"version": "2"}]
)
def test_other_settings_are_refused_and_named(tmp_path: Path, change: dict[str, object]) -> None:
    written(tmp_path, FIRST)
    (name,) = change
    with pytest.raises(UsageError, match=name):
        ResultsFile(tmp_path, SETTING.model_copy(update=change))
    assert read(tmp_path) == [FIRST]


def test_a_folder_with_something_else_is_refused_and_left_alone(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("mine")
    with pytest.raises(UsageError, match="no evaluation left there"):
        ResultsFile(tmp_path, SETTING)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]


def test_a_file_is_no_folder(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(UsageError, match="can't hold an evaluation"):
        ResultsFile(tmp_path / "file", SETTING)


@pytest.mark.parametrize("content", ["", "{", "[]"])
def test_damaged_settings_are_refused(tmp_path: Path, content: str) -> None:
    written(tmp_path, FIRST)
    (tmp_path / SETTINGS).write_text(content)
    with pytest.raises(UsageError, match="another --out"):
        ResultsFile(tmp_path, SETTING)


def test_a_second_evaluation_in_the_same_folder_is_refused_while_the_first_is_under_way(tmp_path: Path) -> None:
    with ResultsFile(tmp_path, SETTING), pytest.raises(UsageError, match="under way"):
        ResultsFile(tmp_path, SETTING)
    assert read(tmp_path) == []
