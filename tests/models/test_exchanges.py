"""Exchanges are recorded as they happen, and a recording stands in for the models that gave its answers."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from asking import CUP, GOOD, KEY, QUICK, Spot, opened, picture, question, refuse_cups
from fake_server import fails, says, serving
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from maniagent.errors import FormatFailure, ModelFailure, UsageError
from maniagent.models.exchange import Exchange
from maniagent.models.pictures import fingerprint, to_png
from maniagent.models.question import Picture, Question
from maniagent.models.record import EXCHANGES, ExchangeRecorder, as_recorded, read_exchanges
from maniagent.models.replay import ReplayModel

ANSWERED = Exchange(
    role="scene",
    model="openai:fake",
    instructions="You look.",
    parts=("Where is it?", picture()),
    form="Spot",
    mode="schema",
    answers=(GOOD,),
    complaints=(),
    answer=CUP.model_dump(),
    failure=None,
    error="",
    tokens_in=1,
    tokens_out=1,
    seconds=0.1,
    attempts=1,
    money=None,
)


def recorded(folder: Path, *exchanges: Exchange) -> Path:
    recorder = ExchangeRecorder(folder)
    for exchange in exchanges:
        recorder(exchange)
    return folder


def said(text: str, x: float = 0.0) -> Exchange:
    return replace(ANSWERED, parts=(text, picture()), answer={"name": "cup", "x": x, "tags": []})


# Recording -------------------------------------------------------------------------------------------------------


def test_a_live_model_is_recorded_and_replayed_to_the_same_answers(tmp_path: Path) -> None:
    pytest.importorskip("pydantic_ai")
    asked = [question("a"), question("b", role="reasoning"), question("a", shade=9), question("c")]
    with (
        serving(says(GOOD), says("hm"), says(GOOD.replace("cup", "bowl")), says(GOOD), fails(401)) as server,
        opened(f"llamacpp:fake@{server.url}/v1", on_exchange=ExchangeRecorder(tmp_path), patience=QUICK) as (model, _),
    ):
        live = [model.ask(each) for each in asked[:3]]
        with pytest.raises(ModelFailure) as failure:
            model.ask(asked[3])
    replay = ReplayModel(tmp_path)
    assert [replay.ask(each) for each in asked[:3]] == live == [CUP, Spot(name="bowl", x=0.25), CUP]
    with pytest.raises(ModelFailure) as again:
        replay.ask(asked[3])
    assert str(again.value) == str(failure.value)
    assert replay.left == 0
    assert replay.name == "replay of llamacpp:fake"


def test_a_line_tells_the_whole_exchange(tmp_path: Path) -> None:
    recorded(tmp_path, replace(ANSWERED, answers=("hm", GOOD), complaints=("no JSON",), money=0.5))
    (line,) = (tmp_path / EXCHANGES).read_text().splitlines()
    plain = json.loads(line)
    assert plain["parts"] == ["Where is it?", {"name": "main", "picture": plain["parts"][1]["picture"]}]
    assert (plain["answers"], plain["complaints"], plain["repairs"]) == (["hm", GOOD], ["no JSON"], 1)
    assert (plain["tokens_in"], plain["money"], plain["failure"]) == (1, 0.5, None)


def test_a_picture_is_kept_once_and_without_loss(tmp_path: Path) -> None:
    rgb = np.random.default_rng(0).integers(0, 256, (20, 30, 3), dtype=np.uint8)
    recorded(tmp_path, *[replace(ANSWERED, parts=(Picture(name, rgb),)) for name in ("main", "side")])
    (path,) = (tmp_path / "pictures").iterdir()
    with Image.open(path) as image:
        assert np.array_equal(np.asarray(image), rgb)


def test_what_was_recorded_before_a_crash_is_replayed_and_recording_goes_on(tmp_path: Path) -> None:
    recorded(tmp_path, said("first"))
    with (tmp_path / EXCHANGES).open("a") as file:
        file.write('{"version": 1, "role": "sce')
    assert len(read_exchanges(tmp_path)) == 1
    recorded(tmp_path, said("second"))
    assert [each.parts[0] for each in read_exchanges(tmp_path)] == ["first", "second"]


def test_lone_surrogates_in_an_answer_are_recorded(tmp_path: Path) -> None:
    recorded(tmp_path, replace(ANSWERED, answers=("\ud800",)))
    assert read_exchanges(tmp_path)[0].plain["answers"] == ["\ud800"]


def test_no_key_is_recorded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("pydantic_ai")
    monkeypatch.setenv("LLAMA_API_KEY", KEY)
    with (
        serving(says(KEY), fails(500, KEY)) as server,
        opened(f"llamacpp:fake@{server.url}/v1", on_exchange=ExchangeRecorder(tmp_path)) as (model, _),
        pytest.raises(ModelFailure),
    ):
        model.ask(question())
    assert "[key]" in (tmp_path / EXCHANGES).read_text()
    assert KEY not in (tmp_path / EXCHANGES).read_text()


@given(st.integers(1, 9), st.integers(1, 9), st.randoms(use_true_random=False))
def test_a_fingerprint_tells_pictures_apart(height: int, width: int, rng: Any) -> None:
    rgb = np.array([rng.randrange(256) for _ in range(height * width * 3)], np.uint8).reshape(height, width, 3)
    other = rgb.copy()
    other[rng.randrange(height), rng.randrange(width), rng.randrange(3)] ^= 1
    assert fingerprint(rgb) == fingerprint(rgb.copy()) != fingerprint(other)
    if height != width:
        assert fingerprint(rgb) != fingerprint(rgb.reshape(width, height, 3))
    assert to_png(rgb)[:4] == b"\x89PNG"


# Replaying -------------------------------------------------------------------------------------------------------


def test_the_same_question_gets_its_answers_in_turn_and_none_that_was_not_given(tmp_path: Path) -> None:
    replay = ReplayModel(recorded(tmp_path, said("where?", 0.1), said("when?", 0.2), said("where?", 0.3)))
    assert [replay.ask(question(text)).x for text in ("where?", "where?", "when?")] == [0.1, 0.3, 0.2]
    with pytest.raises(ModelFailure, match="asked more often than it was then"):
        replay.ask(question("where?"))


@pytest.mark.parametrize(
    ("other", "differs"),
    [
        (question("Where is the cup?"), r"part 1 differs: 'Where is the cup\?' is asked, 'Where is it\?' was recorded"),
        (question("Where is it?", shade=1), "part 2, the picture 'main', shows something else than pictures/"),
        (question("Where is it?", role="reasoning"), "nothing is left of that role"),
        (Question("scene", "Look!", ("Where is it?", picture()), Spot), "the instructions differ: 'Look!' is asked"),
        (Question("scene", "You look.", ("Where is it?",), Spot), "it has 1 parts, not 2"),
        (Question("scene", "You look.", ("Where is it?", "there"), Spot), "part 2 is a text in one and a picture"),
        (Question("scene", "You look.", ("Where is it?", picture()), type("Other", (Spot,), {})), "is Other, not Spot"),
    ],
    ids=["text", "picture", "role", "instructions", "parts", "kind", "form"],
)
def test_what_was_not_recorded_is_not_answered_and_told(tmp_path: Path, other: Question[Spot], differs: str) -> None:
    replay = ReplayModel(recorded(tmp_path, ANSWERED))
    with pytest.raises(ModelFailure, match=differs):
        replay.ask(other)
    assert replay.ask(question()) == CUP, "nothing was used up by it"


def test_pictures_may_be_left_out_of_the_comparison(tmp_path: Path) -> None:
    assert ReplayModel(recorded(tmp_path, ANSWERED), pictures=False).ask(question(shade=7)) == CUP


def test_the_name_of_a_picture_does_not_matter(tmp_path: Path) -> None:
    asked = Question("scene", "You look.", ("Where is it?", replace(picture(), name="side")), Spot)
    assert ReplayModel(recorded(tmp_path, ANSWERED)).ask(asked) == CUP


def test_failures_are_replayed_as_what_they_were(tmp_path: Path) -> None:
    misfit = replace(said("b"), answer=None, failure="format", error="no fitting answer")
    broken = replace(said("a"), answer=None, failure="model", error="out of reach")
    stopped = replace(said("c"), answer=None, failure="interrupted")
    replay = ReplayModel(recorded(tmp_path, misfit, broken, stopped))
    with pytest.raises(FormatFailure, match="no fitting answer"):
        replay.ask(question("b"))
    with pytest.raises(ModelFailure, match="out of reach"):
        replay.ask(question("a"))
    with pytest.raises(ModelFailure, match="has no answer"):
        replay.ask(question("c"))


def test_an_answer_that_does_not_fit_any_more_is_a_failure(tmp_path: Path) -> None:
    recorded(tmp_path, ANSWERED, replace(ANSWERED, parts=("old",), answer={"gone": 1}))
    with pytest.raises(FormatFailure, match=r"doesn't fit any more: There is no cup"):
        ReplayModel(tmp_path).ask(question(check=refuse_cups))
    with pytest.raises(FormatFailure, match="doesn't fit any more"):
        ReplayModel(tmp_path).ask(Question("scene", "You look.", ("old",), Spot))


def test_a_folder_without_a_recording_is_told(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="holds no recorded exchanges"):
        ReplayModel(tmp_path)


@pytest.mark.parametrize("line", ['{"version": 99}', '{"version": 1}', "[]", '{"version": 1, "parts": 3}'])
def test_a_recording_that_is_not_ours_is_told_with_the_line(tmp_path: Path, line: str) -> None:
    (tmp_path / EXCHANGES).write_text(f"\n{line}\n")
    with pytest.raises(UsageError, match="line 2"):
        ReplayModel(tmp_path)


texts = st.lists(st.text(max_size=4), max_size=3)


@given(texts, texts)
def test_questions_share_a_key_only_where_they_are_the_same(one: list[str], other: list[str]) -> None:
    keys = [as_recorded("scene", "", parts, "Spot").key() for parts in (one, other)]
    assert (keys[0] == keys[1]) == (one == other)
