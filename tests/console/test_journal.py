import json
import math
from pathlib import Path

import numpy as np
import pytest
import synthetic
from hypothesis import given
from hypothesis import strategies as st

from maniagent.console.journal import read_lines, to_line, to_plain
from maniagent.types import Event, Gripper

plain = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner, max_size=4),
    max_leaves=12,
)


@given(plain)
def test_every_event_is_one_line_of_strict_json(value: object) -> None:
    line = to_line(Event("described", 1.0, {"turn": 1, "value": value}))
    assert "\n" not in line
    assert json.loads(line, parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))["turn"] == 1
    line.encode("utf-8")


@given(st.text(st.characters(codec="utf-8")))
def test_text_survives_the_log(tmp_path_factory: pytest.TempPathFactory, text: str) -> None:
    path = tmp_path_factory.mktemp("log") / "events.jsonl"
    path.write_text(to_line(Event("failed", 0.0, {"reason": text})) + "\n", encoding="utf-8", newline="\n")
    assert read_lines(path)[0]["reason"] == text


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, np.float32("nan")])
def test_numbers_json_cannot_hold_become_null(value: float) -> None:
    assert to_plain(value) is None


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_floats_read_back_bit_by_bit(value: float) -> None:
    line = to_line(Event("planned", 0.0, {"value": np.array([value])}))
    assert np.float64(json.loads(line)["value"][0]).tobytes() == np.float64(value).tobytes()


def test_images_are_summarised_and_matrices_kept() -> None:
    frame = to_plain(synthetic.camera("main", 64, 48))
    assert (frame["width"], frame["height"]) == (64, 48)
    assert 0.9 < frame["depth_known"] < 1.0
    assert np.allclose(frame["K"][2], [0, 0, 1])
    assert "rgb" not in frame


def test_masks_stay_out_of_the_log_and_enumerations_go_in_as_words() -> None:
    found = synthetic.detection(synthetic.camera("main"), "carrot", synthetic.CARROT, (0.06, 0.016), 0.9)
    assert set(to_plain(found)) == {"query", "box", "score", "frame"}
    assert to_plain(Gripper.CLOSE) == "close"


def test_a_line_cut_short_by_a_crash_is_left_out(tmp_path: Path) -> None:
    path = tmp_path / "events.jsonl"
    path.write_text('{"kind": "run_started", "time": 0}\n{"kind": "obs')
    assert [record["kind"] for record in read_lines(path)] == ["run_started"]


def test_damage_before_the_end_is_told(tmp_path: Path) -> None:
    path = tmp_path / "events.jsonl"
    path.write_text('{"kind": "run_started", "time": 0}\nnonsense\n{"kind": "failed", "time": 1}\n')
    with pytest.raises(ValueError, match="line 2"):
        read_lines(path)
