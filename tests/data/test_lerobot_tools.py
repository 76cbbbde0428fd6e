"""Which episodes go into which part, and what is refused before lerobot is asked."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from staged import stage
from test_lerobot_publish import Scribe

from maniagent.data.lerobot import merge, publish, split
from maniagent.data.lerobot.tools import draw_parts
from maniagent.errors import UsageError


@given(st.integers(5, 200), st.floats(0.2, 0.8), st.integers(0, 9))
def test_shares_that_make_up_all_of_it_leave_no_episode_out(total: int, share: float, seed: int) -> None:
    parts = draw_parts(total, {"train": share, "val": 1 - share}, seed)
    assert sorted(parts["train"] + parts["val"]) == list(range(total))
    assert abs(len(parts["train"]) - share * total) <= 1


def test_counts_are_kept_and_parts_share_nothing() -> None:
    parts = draw_parts(20, {"a": 5, "b": 0.25, "c": 2}, seed=0)
    assert [len(part) for part in parts.values()] == [5, 5, 2]
    assert len(set().union(*parts.values())) == 12


def test_parts_are_drawn_from_all_over_and_the_same_each_time() -> None:
    (part,) = draw_parts(300, {"val": 0.1}, seed=3).values()
    assert part == draw_parts(300, {"val": 0.1}, seed=3)["val"] != draw_parts(300, {"val": 0.1}, seed=4)["val"]
    assert part[0] < 60
    assert part[-1] > 240


@pytest.mark.parametrize(
    ("parts", "told"),
    [
        ({}, "can't be split"),
        ({"a": 3, "b": 3}, "can't be split"),
        ({"a": 0}, "can't be split"),
        ({"a": 0.05}, "can't be split"),
        ({"a": 0.7, "b": 0.7}, "can't be split"),
        ({"a": 1.5}, "between 0 and 1"),
        ({"a": float("nan")}, "between 0 and 1"),
        ({"../a": 1}, "can't name a part"),
        ({"": 1}, "can't name a part"),
    ],
)
def test_parts_that_make_no_sense_are_refused(parts: dict[str, float | int], told: str) -> None:
    with pytest.raises(UsageError, match=told):
        draw_parts(5, parts, seed=0)


def test_what_is_no_dataset_is_neither_merged_nor_split(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no description of a LeRobot dataset"):
        merge([tmp_path / "a", tmp_path / "b"], tmp_path / "out", writer=Scribe())
    with pytest.raises(UsageError, match="no description of a LeRobot dataset"):
        split(tmp_path / "a", {"train": 1}, tmp_path / "out", writer=Scribe())
    with pytest.raises(UsageError, match="no folder"):
        merge([tmp_path / "a", tmp_path / "b"], tmp_path / "nowhere" / "out", writer=Scribe())


def test_datasets_of_different_frames_are_not_merged(tmp_path: Path) -> None:
    for name, fps in (("one", 10), ("two", 5)):
        stage(tmp_path / name / "episodes", "e0", fps=fps)
        publish(tmp_path / name, writer=Scribe())
    with pytest.raises(UsageError, match="5 frames a second, there 10"):
        merge([tmp_path / "one" / "dataset", tmp_path / "two" / "dataset"], tmp_path / "out", writer=Scribe())
