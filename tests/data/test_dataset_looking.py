"""Reading a dataset, summing it up, drawing it, and the commands that do so."""

import io
import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_dataset import (
    CAMERA,
    DATA,
    LENGTHS,
    NAMES,
    SUBTASKS,
    TASKS,
    VIDEO,
    edit_json,
    edit_table,
    made_dataset,
    picture,
)
from PIL import Image
from rich.console import Console
from staged import made_info
from typer.testing import CliRunner, Result

from maniagent.cli import app
from maniagent.data.dataset.checks.statistics import Moments
from maniagent.data.dataset.curves import curves
from maniagent.data.dataset.drawing import fitted, ticks, width_of, wrapped
from maniagent.data.dataset.layout import DatasetError
from maniagent.data.dataset.progress import VerifyProgress
from maniagent.data.dataset.reading import Dataset
from maniagent.data.dataset.summary import judge, summarise
from maniagent.data.dataset.view import view
from maniagent.errors import UnknownNameError, UsageError


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made_dataset(tmp_path_factory.mktemp("datasets") / "made")


@pytest.fixture
def copy(made: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(made, tmp_path / "dataset"))


def call(*arguments: object) -> Result:
    return CliRunner().invoke(app, ["data", *map(str, arguments)], catch_exceptions=False)


def colours(image: Image.Image) -> set[tuple[int, ...]]:
    return set(map(tuple, np.asarray(image.convert("RGB")).reshape(-1, 3).tolist()))


# Reading ----------------------------------------------------------------------------------------------------------


def test_each_episode_is_read_from_its_own_rows_and_pictures(made: Path) -> None:
    dataset = Dataset.open(made)
    start = 0
    for number, length in enumerate(LENGTHS):
        episode = dataset.episode(number)
        numbers = dataset.numbers(episode, ["index", "action"])
        assert numbers["index"].tolist() == list(range(start, start + length))
        assert numbers["action"].shape == (length, 7)
        assert dataset.subtasks(episode)[0] == SUBTASKS[0]
        for frame, found in zip((0, length - 1), dataset.pictures(episode, CAMERA, (0, length - 1)), strict=True):
            assert np.abs(found.astype(int) - picture(number, frame)).mean() < 6
        start += length


def test_subtasks_are_read_from_lerobots_own_table_too(copy: Path) -> None:
    def edit(table: pa.Table) -> pa.Table:
        numbers = pa.array([int(text == SUBTASKS[1]) for text in table["subtask"].to_pylist()])
        return table.drop_columns("subtask").append_column("subtask_index", numbers)

    for file in range(2):
        edit_table(copy / DATA.format(file), edit)
    edit_table(copy / "meta/tasks.parquet", lambda table: table)
    names = pa.table({"subtask_index": [0, 1], "__index_level_0__": list(SUBTASKS)})
    shutil.copy(copy / "meta/tasks.parquet", copy / "meta/subtasks.parquet")
    edit_table(copy / "meta/subtasks.parquet", lambda _: names)
    number = {"dtype": "int64", "shape": [1], "names": None}
    edit_json(copy / "meta/info.json", lambda info: info["features"].update(subtask_index=number))
    edit_json(copy / "meta/info.json", lambda info: info["features"].pop("subtask"))
    dataset = Dataset.open(copy)
    assert dataset.subtasks(dataset.episodes[0]) == (SUBTASKS[0],) * 6 + (SUBTASKS[1],) * 6


def test_an_episode_that_is_not_there_is_refused(made: Path) -> None:
    with pytest.raises(UsageError, match="There is no episode 9; the dataset has 4"):
        Dataset.open(made).episode(9)


def test_a_missing_video_is_told_with_its_name(copy: Path) -> None:
    (copy / VIDEO).unlink()
    dataset = Dataset.open(copy)
    with pytest.raises(DatasetError, match="is missing"):
        dataset.pictures(dataset.episodes[0], CAMERA, [0])


# Summing up -------------------------------------------------------------------------------------------------------


def test_the_summary_counts_and_measures(made: Path) -> None:
    summary = summarise(Dataset.open(made))
    assert (summary.episodes, summary.frames) == (len(LENGTHS), sum(LENGTHS))
    assert summary.seconds == pytest.approx(sum(LENGTHS) / 10)
    assert summary.tasks == {TASKS[0]: 2, TASKS[1]: 2}
    assert (summary.lengths["min"], summary.lengths["max"]) == (min(LENGTHS), max(LENGTHS))
    assert [d.name for d in summary.dimensions if d.feature == "action"] == NAMES
    (camera,) = summary.cameras
    assert (camera.codec, camera.width, camera.height, camera.files) == ("h264", 64, 48, 1)
    assert camera.bytes == summary.bytes["videos"]
    assert summary.labels is None


def test_labels_are_judged_by_the_truth_where_it_is_known() -> None:
    said = [("valid", True), ("valid", True), ("valid", False), ("failed", True), ("doubtful", False), ("valid", None)]
    labels = judge([made_info(f"e{i}", label=label, truly_valid=truth) for i, (label, truth) in enumerate(said)])
    assert labels.counts == {"valid": 4, "failed": 1, "doubtful": 1}
    assert labels.judged == 5
    assert labels.precision == pytest.approx(2 / 3)
    assert labels.recall == pytest.approx(2 / 3)


def test_recall_is_not_claimed_where_only_valid_episodes_were_kept() -> None:
    labels = judge([made_info(f"e{i}", truly_valid=True, attempts=1 + i) for i in range(3)])
    assert (labels.precision, labels.recall) == (1.0, None)
    assert labels.attempts == {1: 1, 2: 1, 3: 1}


@given(st.lists(st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=9), min_size=1, max_size=5))
def test_moments_of_parts_join_to_those_of_the_whole(parts: list[list[float]]) -> None:
    joined = Moments.of(np.array(parts[0]))
    for part in parts[1:]:
        joined = joined + Moments.of(np.array(part))
    whole = Moments.of(np.concatenate(parts))
    assert joined.count == whole.count
    for name in ("low", "high", "mean", "std"):
        assert getattr(joined, name) == pytest.approx(getattr(whole, name), abs=1e-6)


# Drawing ----------------------------------------------------------------------------------------------------------


def test_the_pictures_that_are_said_to_be_written_are_there(made: Path, tmp_path: Path) -> None:
    written = view(Dataset.open(made), tmp_path / "out", episodes=[2, 0, 2], moments=3)
    assert [path.name for path in written] == ["sheet-main.png", "episode-0002.png", "episode-0000.png"]
    for path in written:
        with Image.open(path) as image:
            assert len(colours(image)) > 20, path.name


def test_curves_show_the_subtasks_as_bands(made: Path, copy: Path) -> None:
    def drawn(root: Path) -> set[tuple[int, ...]]:
        dataset = Dataset.open(root)
        return colours(curves(dataset, dataset.episodes[0]))

    edit_json(copy / "meta/info.json", lambda info: info["features"].pop("subtask"))
    assert {(219, 234, 254), (254, 243, 199)} <= drawn(made)
    assert not {(219, 234, 254), (254, 243, 199)} & drawn(copy)


def test_an_unknown_camera_is_refused_with_the_nearest(made: Path, tmp_path: Path) -> None:
    with pytest.raises(UnknownNameError, match=r"Did you mean 'observation\.images\.main'"):
        view(Dataset.open(made), tmp_path, camera="observation.images.man")


@given(st.floats(-1e6, 1e6), st.floats(1e-6, 1e6))
def test_ticks_are_few_ascending_and_within(low: float, width: float) -> None:
    found = ticks(low, low + width)
    assert 0 < len(found) <= 6
    assert found == sorted(found)
    assert all(low - 1e-6 * width <= tick <= low + width * (1 + 1e-6) for tick in found)


@given(st.text(st.characters(min_codepoint=32, max_codepoint=126), max_size=80), st.integers(40, 300))
def test_texts_stay_within_their_room(text: str, width: int) -> None:
    assert width_of(fitted(text, 11, width), 11) <= width
    lines = wrapped(text, 11, width, 2)
    assert len(lines) <= 2
    assert all(width_of(line, 11) <= width for line in lines)


# Commands ---------------------------------------------------------------------------------------------------------


def test_verify_exits_by_what_it_finds(made: Path, copy: Path, tmp_path: Path) -> None:
    (copy / VIDEO).unlink()
    assert [call("verify", made).exit_code, call("verify", copy).exit_code] == [0, 1]
    assert call("verify", tmp_path / "nowhere").exit_code == 2


def test_verify_tells_what_where_and_what_to_do(copy: Path) -> None:
    (copy / VIDEO).unlink()
    said = " ".join(call("verify", copy).stdout.split())
    assert f"problem: {VIDEO}: is missing Copy it from where the dataset was made." in said


def test_verify_prints_one_json_object(made: Path) -> None:
    printed = json.loads(call("verify", made, "--deep", "--json").stdout)
    assert (printed["sound"], printed["problems"], printed["deep"]) == (True, 0, True)
    assert {"name", "outcome", "findings"} <= set(printed["checks"][0])


def test_stats_prints_tables_or_json(made: Path) -> None:
    assert TASKS[0] in call("stats", made).stdout
    assert json.loads(call("stats", made, "--json").stdout)["frames"] == sum(LENGTHS)


def test_what_a_dataset_says_cant_command_the_terminal(copy: Path) -> None:
    edit_json(copy / "meta/info.json", lambda info: info.update(robot_type="\x1b[2Jrobot"))
    assert "\x1b" not in call("stats", copy).stdout


def test_progress_shows_what_is_looked_at_and_nothing_that_commands_the_terminal() -> None:
    shown = io.StringIO()
    with VerifyProgress(Console(file=shown, force_terminal=True, width=100)) as progress:
        progress(3, 8, "data/\x1b[2Jfile.parquet")
    assert "3/8" in shown.getvalue()
    assert "data/ [2Jfile.parquet" in shown.getvalue()


def test_without_pyarrow_it_says_what_to_install(made: Path) -> None:
    script = "import sys; sys.modules['pyarrow'] = None; from maniagent.cli import main; main()"
    command = [sys.executable, "-c", script, "data", "stats", str(made)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 2
    assert "pip install 'maniagent[data]'" in done.stderr


def test_view_names_what_it_wrote(made: Path, tmp_path: Path) -> None:
    printed = json.loads(call("view", made, "-e", 1, "--out", tmp_path / "v", "--json").stdout)
    assert [Path(path).name for path in printed["pictures"]] == ["sheet-main.png", "episode-0001.png"]


@pytest.mark.parametrize("arguments", [("-e", 99), ("--camera", "rear")])
def test_view_refuses_what_is_not_there(made: Path, tmp_path: Path, arguments: tuple[object, ...]) -> None:
    assert call("view", made, "--out", tmp_path / "v", *arguments).exit_code == 2


def test_a_broken_dataset_is_one_line_for_stats_and_view(copy: Path, tmp_path: Path) -> None:
    (copy / DATA.format(0)).write_bytes(b"PAR1")
    for command in (("stats",), ("view", "--out", tmp_path)):
        result = call(command[0], copy, *command[1:])
        assert result.exit_code == 2
        assert "can't be read" in " ".join(result.stderr.split())
