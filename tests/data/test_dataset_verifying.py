"""Every fault that can be planted in a dataset is found, by the check that names it; nothing else is."""

import io
import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from made_dataset import (
    CAMERA,
    DATA,
    EPISODES,
    LENGTHS,
    TASKS,
    VIDEO,
    edit_column,
    edit_json,
    edit_table,
    made_dataset,
    picture,
)
from PIL import Image
from staged import made_info

from maniagent.data.dataset.findings import Check, Report
from maniagent.data.dataset.verifying import verify
from maniagent.errors import UsageError

FIRST, SECOND = DATA.format(0), DATA.format(1)


@pytest.fixture(scope="session")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made_dataset(tmp_path_factory.mktemp("datasets") / "sound")


@pytest.fixture
def dataset(sound: Path, tmp_path: Path) -> Path:
    """A copy to do harm to."""
    return Path(shutil.copytree(sound, tmp_path / "dataset"))


def named(report: Report) -> dict[str, Check]:
    return {check.name: check for check in report.checks}


def failed(report: Report) -> set[str]:
    return {check.name for check in report.checks if check.outcome == "failed"}


@pytest.mark.parametrize("deep", [False, True])
def test_a_sound_dataset_passes_every_check(sound: Path, deep: bool) -> None:
    report = verify(sound, deep=deep)
    assert report.sound
    assert report.warnings == 0
    assert {check.outcome for check in report.checks if check.name != "collection"} == {"passed"}
    assert named(report)["collection"].outcome == "skipped"


def test_progress_goes_up_to_the_end_and_not_beyond(sound: Path) -> None:
    steps: list[tuple[int, int]] = []
    verify(sound, on_progress=lambda done, total, what: steps.append((done, total)))
    assert steps[-1] == (2 * len(LENGTHS), 2 * len(LENGTHS))
    assert [done for done, _ in steps] == sorted(done for done, _ in steps)


# What is wrong with the numbers -----------------------------------------------------------------------------------


def _set(at: int, value: Any) -> Callable[[list[Any]], None]:
    def edit(cells: list[Any]) -> None:
        cells[at] = value

    return edit


def _poison(cells: list[Any]) -> None:
    cells[3][2] = float("nan")


def _freeze(cells: list[Any]) -> None:
    cells[:12] = [cells[0]] * 12


def _spike(cells: list[Any]) -> None:
    cells[5][1] = 1e6


NUMBERS: list[tuple[str, str, Callable[[list[Any]], None], set[str], str]] = [
    (FIRST, "frame_index", _set(4, 7), {"indices"}, "frame_index is 7, not 4"),
    (FIRST, "index", _set(4, 7), {"indices"}, "index is 7, not 4"),
    (FIRST, "timestamp", _set(4, 0.46), {"timestamps"}, "timestamp is 0.46 s, not 0.4 s"),
    (FIRST, "timestamp", _set(4, float("nan")), {"timestamps", "finite"}, "NaN or infinite (1 of 12 frames)"),
    (FIRST, "action", _poison, {"finite"}, "action is NaN or infinite"),
    (FIRST, "task_index", _set(4, 9), {"task of each frame"}, "names task 9, which has no text"),
    (FIRST, "task_index", _set(4, 1), {"task of each frame"}, "its frames say"),
    (SECOND, "episode_index", _set(0, 77), {"rows", "indices"}, "rows of unknown episodes (77)"),
    (SECOND, "episode_index", _set(3, 3), {"rows"}, "its rows are not in one piece"),
    (FIRST, "action", _freeze, {"statistics", "episode statistics"}, "action is the same in all 12 frames"),
    (FIRST, "action", _spike, {"statistics", "episode statistics"}, "1e+06 is far from all else"),
]


@pytest.mark.parametrize(("file", "column", "edit", "checks", "said"), NUMBERS)
def test_wrong_numbers_are_found_where_they_are(
    dataset: Path, file: str, column: str, edit: Callable[[list[Any]], None], checks: set[str], said: str
) -> None:
    edit_column(dataset / file, column, edit)
    report = verify(dataset)
    assert checks <= failed(report) <= checks | {"indices", "timestamps", "statistics", "episode statistics"}
    assert said in " ".join(finding.what for check in report.checks for finding in check.findings)


def test_degrees_where_radians_are_wanted_are_one_warning(dataset: Path) -> None:
    for file in (FIRST, SECOND):
        edit_column(dataset / file, "action", lambda cells: cells.__setitem__(slice(None), _degrees(cells)))
    found = [finding.what for finding in named(verify(dataset))["motion"].findings]
    assert len(found) == 6
    assert found[0].startswith("action, waist goes from -")


def _degrees(cells: list[Any]) -> list[Any]:
    return [[*np.degrees(cell[:6]).tolist(), cell[6]] for cell in cells]


def test_an_episode_that_is_there_twice_is_found(tmp_path: Path) -> None:
    dataset = made_dataset(tmp_path / "twice", (12, 12))
    for column in ("observation.state", "action"):
        first = _cells(dataset / FIRST, column)
        edit_column(dataset / SECOND, column, lambda cells, first=first: cells.__setitem__(slice(None), first))
    report = verify(dataset)
    assert [f.what for f in named(report)["duplicates"].findings] == ["has the same states and actions as episode 0"]


def _cells(path: Path, column: str) -> list[Any]:
    found: list[Any] = []
    edit_column(path, column, found.extend)
    return found


def test_frames_that_name_no_subtask_are_a_warning(dataset: Path) -> None:
    edit_column(dataset / FIRST, "subtask", _set(0, ""))
    check = named(verify(dataset))["sub-task of each frame"]
    assert [(f.where, f.what) for f in check.findings] == [("episode 0, frame 0", "1 of 12 frames name no sub-task")]


@pytest.mark.parametrize("shape", [[6], [8], [7, 1]])
def test_values_of_another_shape_than_promised_are_found(dataset: Path, shape: list[int]) -> None:
    edit_json(dataset / "meta/info.json", lambda info: info["features"]["action"].update(shape=shape, names=None))
    report = verify(dataset)
    assert failed(report) == {"shapes"}
    assert named(report)["shapes"].problems == len(LENGTHS)


def test_a_column_of_another_type_than_promised_is_found(dataset: Path) -> None:
    edit_json(dataset / "meta/info.json", lambda info: info["features"]["action"].update(dtype="float64"))
    assert failed(verify(dataset)) == {"schema"}


def test_missing_and_surplus_columns_are_told_apart(dataset: Path) -> None:
    edit_table(dataset / FIRST, lambda table: table.rename_columns({"action": "acton"}))
    check = named(verify(dataset))["schema"]
    assert (check.problems, check.warnings) == (1, 1)


@pytest.mark.parametrize(("column", "check"), [("action", "shapes"), ("index", "shapes"), ("episode_index", "rows")])
def test_empty_cells_are_found(dataset: Path, column: str, check: str) -> None:
    edit_column(dataset / FIRST, column, _set(3, None))
    assert check in failed(verify(dataset))


def test_texts_where_numbers_are_wanted_are_found(dataset: Path) -> None:
    def edit(table: pa.Table) -> pa.Table:
        at = table.schema.get_field_index("index")
        return table.set_column(at, "index", pa.array([str(i) for i in range(len(table))]))

    edit_table(dataset / FIRST, edit)
    assert {"schema", "shapes"} <= failed(verify(dataset))


def test_stale_statistics_are_found_overall_and_by_episode(dataset: Path) -> None:
    edit_json(dataset / "meta/stats.json", lambda stats: stats["action"]["std"].__setitem__(2, 9.0))
    edit_column(dataset / EPISODES, "stats/action/max", lambda cells: cells[1].__setitem__(0, 9.0))
    report = verify(dataset)
    assert failed(report) == {"statistics", "episode statistics"}
    (overall,), (one,) = named(report)["statistics"].findings, named(report)["episode statistics"].findings
    assert overall.what.startswith("action: std of dimension 2 is 9, computed 0.")
    assert one.where == "episode 1"


def test_statistics_of_pictures_that_overflowed_are_warned_of(dataset: Path) -> None:
    edit_column(dataset / EPISODES, f"stats/{CAMERA}/std", _set(2, [[[0.0]]] * 3))
    check = named(verify(dataset))["episode statistics"]
    assert check.outcome == "warned"
    assert "std is 0 in episodes 2" in check.findings[0].what


# What is wrong with the whole -------------------------------------------------------------------------------------


@pytest.mark.parametrize("key", ["total_episodes", "total_frames", "total_tasks"])
def test_wrong_totals_are_found(dataset: Path, key: str) -> None:
    edit_json(dataset / "meta/info.json", lambda info: info.update({key: info[key] + 1}))
    report = verify(dataset)
    assert failed(report) == {"totals"}
    assert key in named(report)["totals"].findings[0].what


def test_a_missing_video_and_a_missing_data_file_are_found(dataset: Path) -> None:
    (dataset / VIDEO).unlink()
    (dataset / FIRST).unlink()
    report = verify(dataset)
    assert failed(report) == {"files", "rows", "video frames"}  # and what comes after is looked up as if it was there
    assert {f.where for f in named(report)["files"].findings} == {VIDEO, FIRST}


def test_a_data_file_that_belongs_to_no_episode_is_a_problem_and_a_video_a_warning(dataset: Path) -> None:
    shutil.copy(dataset / FIRST, dataset / DATA.format(7))
    shutil.copy(dataset / VIDEO, dataset / VIDEO.replace("000.mp4", "007.mp4"))
    check = named(verify(dataset))["files"]
    assert (check.problems, check.warnings) == (1, 1)


def test_gaps_between_episodes_are_found(dataset: Path) -> None:
    edit_column(dataset / EPISODES, "dataset_from_index", _set(2, 28))
    report = verify(dataset)
    assert {"episodes", "indices"} <= failed(report)


@pytest.mark.parametrize(
    ("texts", "said"),
    [
        ([TASKS[0], " "], "task 1 has no text"),
        ([TASKS[0], TASKS[0]], "2 times"),
        ([TASKS[0], "x"], "has tasks that meta/tasks"),
    ],
)
def test_tasks_without_their_texts_are_found(dataset: Path, texts: list[str], said: str) -> None:
    edit_column(dataset / "meta/tasks.parquet", "__index_level_0__", lambda cells: cells.__setitem__(slice(2), texts))
    check = named(verify(dataset))["tasks"]
    assert check.outcome == "failed"
    assert said in " ".join(finding.what for finding in check.findings)


def test_tasks_out_of_order_are_found(dataset: Path) -> None:
    edit_table(dataset / "meta/tasks.parquet", lambda table: table.take([1, 0]))
    assert failed(verify(dataset)) == {"tasks"}


def test_the_collectors_own_lines_are_held_against_the_episodes(dataset: Path) -> None:
    path = dataset / "meta/maniagent.jsonl"
    infos = [made_info(f"e{i}", instruction=TASKS[i % 2]) for i in range(len(LENGTHS))]
    lines = [info.model_dump_json() for info in infos]
    path.write_text("\n".join(lines) + "\n")
    assert named(verify(dataset))["collection"].outcome == "passed"
    path.write_text("\n".join([lines[1], lines[1]]) + "\n")
    problems = [finding.what for finding in named(verify(dataset))["collection"].findings]
    assert len(problems) == 3  # too few lines, one twice, one of another task
    path.write_text('{"key": 3}\n')
    assert "is no EpisodeInfo" in named(verify(dataset))["collection"].findings[0].what


# What is wrong with the pictures ----------------------------------------------------------------------------------


def test_a_video_that_is_too_short_is_found(dataset: Path, tmp_path: Path) -> None:
    shorter = made_dataset(tmp_path / "shorter", (*LENGTHS[:-1], LENGTHS[-1] - 2))
    shutil.copy(shorter / VIDEO, dataset / VIDEO)
    report = verify(dataset)
    assert failed(report) == {"video frames", "pictures"}
    assert "has 12 pictures for 14 frames" in named(report)["video frames"].findings[0].what


def test_a_clip_that_begins_between_two_pictures_is_found(dataset: Path) -> None:
    edit_column(dataset / EPISODES, f"videos/{CAMERA}/from_timestamp", lambda cells: _set(1, cells[1] + 0.01)(cells))
    check = named(verify(dataset))["video frames"]
    assert "10.00 ms from its frame's time" in check.findings[0].what


def test_surplus_pictures_are_a_warning(dataset: Path, tmp_path: Path) -> None:
    longer = made_dataset(tmp_path / "longer", (*LENGTHS, 5))
    shutil.copy(longer / VIDEO, dataset / VIDEO)
    report = verify(dataset)
    assert report.sound
    assert named(report)["video frames"].outcome == "warned"


@pytest.mark.parametrize("deep", [False, True])
def test_black_pictures_are_found_and_that_they_stand_still(tmp_path: Path, deep: bool) -> None:
    dataset = made_dataset(tmp_path / "dark", dark=2)
    check = named(verify(dataset, deep=deep))["pictures"]
    assert (check.problems, check.warnings) == (1, 1)
    assert {finding.where for finding in check.findings} == {f"{VIDEO}, episode 2"}


def test_pictures_of_another_size_are_found(dataset: Path) -> None:
    edit_json(dataset / "meta/info.json", lambda info: info["features"][CAMERA].update(shape=[96, 128, 3]))
    assert failed(verify(dataset)) == {"video frames"}


def test_a_dataset_without_videos_is_verified_too(dataset: Path) -> None:
    shutil.rmtree(dataset / "videos")
    edit_json(dataset / "meta/info.json", lambda info: (info["features"].pop(CAMERA), info.update(video_path=None)))
    report = verify(dataset)
    assert report.sound
    assert named(report)["video frames"].outcome == "skipped"


@pytest.mark.parametrize("deep", [False, True])
def test_pictures_in_the_data_files_are_looked_at_too(dataset: Path, deep: bool) -> None:
    shutil.rmtree(dataset / "videos")
    edit_json(dataset / "meta/info.json", lambda info: info["features"][CAMERA].update(dtype="image"))
    for file, start, stop in ((FIRST, 0, 2), (SECOND, 2, 4)):
        cells = [_cell(e, t) for e in range(start, stop) for t in range(LENGTHS[e])]
        edit_table(dataset / file, lambda table, cells=cells: table.append_column(CAMERA, pa.array(cells)))
    assert failed(verify(dataset, deep=deep)) == set()
    edit_column(dataset / SECOND, CAMERA, lambda cells: cells[0].update(bytes=b"no picture"))
    assert failed(verify(dataset, deep=deep)) == {"pictures"}


def _cell(episode: int, frame: int) -> dict[str, Any]:
    buffer = io.BytesIO()
    Image.fromarray(picture(episode, frame)).save(buffer, "PNG")
    return {"bytes": buffer.getvalue(), "path": f"frame-{frame:06d}.png"}


# What can't be read -----------------------------------------------------------------------------------------------


def test_where_there_is_no_dataset_it_says_so_and_names_one_that_is_near(sound: Path, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="There is no folder"):
        verify(tmp_path / "nowhere")
    with pytest.raises(UsageError, match=r"Did you mean .*sound"):
        verify(sound.parent)


@pytest.mark.parametrize(
    "edit",
    [
        lambda info: info.update(codebase_version="v2.1"),
        lambda info: info.update(fps=0),
        lambda info: info.update(total_frames="many"),
        lambda info: info.update(features={}),
        lambda info: info["features"].pop("index"),
        lambda info: info["features"]["action"].update(shape=[-7]),
        lambda info: info.update(data_path="data/{chunk_index}/{file_index:999999999d}.parquet"),
        lambda info: info.update(data_path="data/{chunk_index.real}/{file_index}.parquet"),
        lambda info: info.update(data_path="../{chunk_index}/{file_index}.parquet"),
        lambda info: info.update(data_path="/etc/{chunk_index}/{file_index}.parquet"),
    ],
)
def test_a_description_that_cant_be_true_is_a_finding(dataset: Path, edit: Callable[[Any], None]) -> None:
    edit_json(dataset / "meta/info.json", edit)
    assert not verify(dataset).sound


@pytest.mark.parametrize("name", ["meta/info.json", "meta/stats.json", "meta/tasks.parquet", EPISODES])
def test_a_missing_file_of_meta_is_a_finding(dataset: Path, name: str) -> None:
    (dataset / name).unlink()
    report = verify(dataset)
    assert "metadata" in failed(report)


FILES = ("meta/info.json", "meta/stats.json", "meta/tasks.parquet", EPISODES, FIRST, VIDEO)


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.sampled_from(FILES), st.data())
def test_whatever_happens_to_its_files_is_a_finding_and_never_raises(
    dataset: Path, name: str, data: st.DataObject
) -> None:
    whole = (dataset / name).read_bytes()
    if data.draw(st.booleans(), label="cut short"):
        harmed = whole[: data.draw(st.integers(0, len(whole) - 1))]
    else:
        bytes_ = bytearray(whole)
        for at in data.draw(st.lists(st.integers(0, len(whole) - 1), min_size=1, max_size=8)):
            bytes_[at] ^= data.draw(st.integers(1, 255))
        harmed = bytes(bytes_)
    try:
        (dataset / name).write_bytes(harmed)
        json.dumps(verify(dataset, deep=name == VIDEO).to_plain(), allow_nan=False)
    finally:
        (dataset / name).write_bytes(whole)


def test_a_flood_of_findings_is_counted_and_problems_stay_in_view() -> None:
    check = Check("flood", "?")
    for i in range(50):
        check.warning(f"{i}", "odd")
    check.problem("here", "wrong")
    assert (len(check.findings), check.more, check.outcome) == (20, 31, "failed")
    assert any(finding.is_problem for finding in check.findings)


def test_a_row_group_shared_by_episodes_is_read_as_well(dataset: Path) -> None:
    edit_table(dataset / FIRST, lambda table: pa.concat_tables([table]).combine_chunks())
    assert verify(dataset).sound
    assert np.all(np.array(LENGTHS) > 10)  # long enough to be asked whether they move
