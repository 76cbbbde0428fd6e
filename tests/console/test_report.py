import html
import json
import re
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
import synthetic
from hypothesis import given
from hypothesis import strategies as st

from maniagent.console import page
from maniagent.console.recorder import Recorder
from maniagent.console.report import write_report
from maniagent.console.story import read_story
from maniagent.errors import UsageError
from pages import Reader

SMALL = (96, 72)
HOSTILE = '</title><script>alert(1)</script><img src=x onerror="alert(2)">\x00\u202e " \' & {braces}'


def recorded(folder: Path, instruction: str = synthetic.INSTRUCTION, **options: Any) -> Reader:
    with Recorder(folder) as recorder:
        for event in synthetic.events(instruction, size=SMALL, frames=2, **options):
            recorder.on_event(event)
    return Reader((folder / "report.html").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def reader(tmp_path_factory: pytest.TempPathFactory) -> Reader:
    return recorded(tmp_path_factory.mktemp("runs") / "run")


def test_the_page_tells_the_whole_story(reader: Reader) -> None:
    for words in (
        "put the carrot on the plate",
        "carrot-on-plate",
        "The carrot lies on the plate.",
        "The carrot still lies on the table.",
        "the carrot slipped out of the fingers while it was lifted",
        "carry the carrot above the plate",
        "pick-and-place",
        "Nothing is left to do",
        "6.90 s",
    ):
        assert words in reader.text
    assert [attrs["id"] for tag, attrs in reader.elements if tag == "article"] == ["turn-1", "turn-2", "turn-3"]


def test_the_failure_is_told_once_in_the_table_by_stage(reader: Reader) -> None:
    table = reader.text[reader.text.index("Failures by stage") :]
    assert re.search(r"grasp 1 turn 1 : the carrot slipped", table)
    assert table.count("slipped") == 1


def test_nothing_is_loaded_from_anywhere(reader: Reader) -> None:
    for tag, attrs in reader.elements:
        for name in ("src", "href", "poster", "srcset", "action"):
            value = attrs.get(name)
            assert value is None or value.startswith(("data:", "#")), (tag, name, value)
    policy = next(attrs for tag, attrs in reader.elements if attrs.get("http-equiv") == "Content-Security-Policy")
    assert "default-src 'none'" in (policy["content"] or "")
    assert reader.count("video") == 1
    assert reader.count("img") >= 3


def test_pictures_have_words_for_those_who_do_not_see_them(reader: Reader) -> None:
    assert all(attrs.get("alt") for tag, attrs in reader.elements if tag == "img")


@pytest.mark.parametrize(
    ("achieved", "words"), [(True, "check on the true state of the scene holds"), (None, "Not known")]
)
def test_belief_and_truth_stand_side_by_side(tmp_path: Path, achieved: bool | None, words: str) -> None:
    reader = recorded(tmp_path, achieved=achieved)
    assert words in reader.text
    assert "differ" not in reader.text


def test_a_wrong_belief_is_pointed_out(tmp_path: Path) -> None:
    reader = recorded(tmp_path, achieved=False)
    assert "Not achieved" in reader.text
    assert "The agents’ belief and the truth differ." in reader.text


def test_hostile_text_stays_text(tmp_path: Path) -> None:
    reader = recorded(tmp_path, HOSTILE)
    assert reader.count("script") == 1
    assert not any("onerror" in attrs for _, attrs in reader.elements)
    assert "<script>alert(1)</script>" in reader.text
    assert "\x00" not in reader.text


@given(st.text())
def test_escaped_text_is_inert_and_comes_back(text: str) -> None:
    escaped = page.text(text)
    assert not set(escaped) & set("<>\"'\x00")
    if text.isprintable():
        assert html.unescape(escaped) == text


def test_a_missing_picture_leaves_a_note(tmp_path: Path) -> None:
    recorded(tmp_path)
    (tmp_path / "detections/turn-01.png").write_bytes(b"\x89PNG cut short")
    (tmp_path / "observations/turn-01-side.png").unlink()
    assert "no picture" in Reader(write_report(tmp_path).read_text()).text


def test_every_beginning_of_a_run_makes_a_page(tmp_path: Path) -> None:
    recorded(tmp_path)
    lines = (tmp_path / "events.jsonl").read_text().splitlines()
    for count in range(len(lines)):
        (tmp_path / "events.jsonl").write_text("\n".join(lines[:count]))
        assert "Cut short" in Reader(write_report(tmp_path).read_text()).text


def test_a_folder_that_is_no_run_is_told(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"events\.jsonl is missing"):
        write_report(tmp_path)


def test_seconds_come_from_the_events_where_the_run_did_not_count_them(tmp_path: Path) -> None:
    recorded(tmp_path)
    path = tmp_path / "events.jsonl"
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    path.write_text("\n".join(json.dumps(line) for line in lines[:-1]))
    reader = Reader(write_report(tmp_path).read_text())
    assert "observe 0.39 s" in reader.text


def test_the_timeline_covers_the_whole_run_without_gaps(tmp_path: Path) -> None:
    recorded(tmp_path)
    story = read_story(tmp_path)
    spans = [span for turn in story.turns for span in turn.spans]
    assert spans[0].start == 0.0
    assert spans[-1].end == story.seconds
    assert all(before.end == after.start for before, after in pairwise(spans))
