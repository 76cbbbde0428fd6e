"""`maniagent prompts score`: real scenes, the real SceneAgent, models that answer as they are told."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner, Result

from maniagent.agents.minds.prompts import Prompts
from maniagent.app import run
from maniagent.cli import app
from maniagent.errors import FormatFailure, ModelFailure, UnknownNameError, UsageError
from maniagent.evaluation.prompts import Scoring, load_variants, scenes_of, score_prompts
from maniagent.evaluation.prompts.scenes import draw
from maniagent.evaluation.prompts.variants import PACKAGED
from maniagent.testing import ScriptedAgents, ScriptedModel
from maniagent.types import Subtask, Verdict
from models.fake_server import Asked, Raw, fails, says, serving

BOTH, PLATE, CLUTTER = ("carrot", "plate"), ("plate",), ("orange carrot", "plate", "robot arm", "table top")


def seen(*names: str) -> dict[str, Any]:
    return {"objects": [{"name": name, "state": "on the table"} for name in names], "summary": "A table."}


@pytest.fixture
def terse(tmp_path: Path) -> Path:
    """A prompt of one's own."""
    folder = tmp_path / "terse"
    folder.mkdir()
    (folder / "scene.md").write_text("Name things TERSELY.\n---\n{instruction} {names}\n", encoding="utf-8")
    return folder


def score(terse: Path, out: Path, answers: Sequence[Mapping[str, Any] | BaseException], seeds: int = 1) -> Scoring:
    model = ScriptedModel({"scene": answers})
    return score_prompts(model, load_variants([terse]), scenes_of(["carrot-on-plate"], seeds=seeds), out)


# Scores -----------------------------------------------------------------------------------------------------------


def test_recall_decides_before_relevance(terse: Path, tmp_path: Path) -> None:
    scoring = score(terse, tmp_path / "out", [seen(*PLATE), seen(*CLUTTER)])
    packaged, own = scoring.scores
    assert (packaged.recall, packaged.relevance, packaged.real, packaged.coverage) == (0.5, 1.0, 1.0, 0.5)
    assert (own.recall, own.relevance, own.real, own.coverage) == (1.0, 0.5, 0.5, 1.0)
    assert (own.better, own.worse, own.complete, packaged.complete) == (1, 0, 1, 0)
    assert scoring.winner == "terse"
    assert scoring.complete


def test_relevance_decides_between_prompts_that_find_the_same(terse: Path, tmp_path: Path) -> None:
    assert score(terse, tmp_path / "a", [seen(*CLUTTER), seen(*BOTH)]).winner == "terse"
    assert score(terse, tmp_path / "b", [seen(*BOTH), seen(*CLUTTER)]).winner == PACKAGED


def test_of_equals_the_packaged_prompt_stays(terse: Path, tmp_path: Path) -> None:
    assert score(terse, tmp_path / "out", [seen(*BOTH)]).winner == PACKAGED


def test_a_prompt_alone_wins_over_nobody(tmp_path: Path) -> None:
    model = ScriptedModel({"scene": [seen(*BOTH)]})
    scoring = score_prompts(model, load_variants(), scenes_of(["carrot-on-plate"], seeds=1), tmp_path / "out")
    assert (scoring.winner, scoring.scores[0].recall) == (None, 1.0)


def test_no_answer_that_fits_counts_as_nothing_named(terse: Path, tmp_path: Path) -> None:
    scoring = score(terse, tmp_path / "out", [seen(*BOTH), FormatFailure("No answer fits.")])
    own = scoring.scores[1]
    assert (own.recall, own.relevance, own.failed, own.worse) == (0.0, 0.0, 1, 1)
    assert "No answer fits." in (tmp_path / "out/summary.md").read_text()


def test_every_question_is_asked_afresh_with_the_words_of_its_variant(terse: Path, tmp_path: Path) -> None:
    model = ScriptedModel({"scene": [seen(*BOTH)]})
    score_prompts(model, load_variants([terse]), scenes_of(["carrot-on-plate"], seeds=2), tmp_path / "out")
    instructions = [question.instructions for question in model.asked]
    assert instructions == [Prompts.load().scene.instructions.strip(), "Name things TERSELY."] * 2
    assert all("carrot" not in str(question.parts[1]).replace("put the carrot on", "") for question in model.asked)


def test_the_picture_is_the_one_that_a_run_begins_with() -> None:
    (scene,) = scenes_of(["carrot-on-plate"], seeds=2)[1:]
    agents = ScriptedAgents([Subtask(previous=Verdict.INITIAL, reason="Nothing is wanted.", done=True)])
    run(task="carrot-on-plate", seed=1, agents=lambda rig: agents.as_agents())
    shown, begun = draw(scene).observation.main_frame, agents.described[0].main_frame
    assert np.array_equal(shown.rgb, begun.rgb)


# What is kept -----------------------------------------------------------------------------------------------------


def test_a_scene_with_misses_is_drawn_with_a_ring_where_the_missed_thing_is(terse: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    score(terse, out, [seen(*PLATE), seen(*BOTH)])
    with Image.open(out / "misses/carrot-on-plate-s0.png") as image:
        ringed = np.all(np.asarray(image) == (190, 24, 60), axis=2)
    assert ringed.sum() > 200
    text = (out / "summary.md").read_text()
    assert "| carrot-on-plate-s0 | packaged | carrot | plate |" in text
    assert "misses/carrot-on-plate-s0.png" in text
    plain = json.loads((out / "summary.json").read_text())
    assert plain["winner"] == "terse"
    assert plain["results"][0] | {"seconds": 0} == {
        "scene": "carrot-on-plate-s0", "variant": "packaged", "recall": 0.5, "relevance": 1.0,
        "named": {"plate": "plate"}, "missed": ["carrot"], "unmatched": {}, "failure": "", "seconds": 0,
        "picture": "misses/carrot-on-plate-s0.png",
    }  # fmt: skip


def test_what_was_answered_is_not_asked_again(terse: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    first = score(terse, out, [seen(*PLATE), seen(*BOTH)])
    again = score(terse, out, [])
    assert again == first
    (terse / "scene.md").write_text("Other words.\n---\n{instruction} {names}\n", encoding="utf-8")
    assert score(terse, out, [seen(*CLUTTER)]).scores[1].relevance == 0.5, "other words are another question"


@pytest.mark.slow
@pytest.mark.parametrize("end", [KeyboardInterrupt(), ModelFailure("The run's budget of 3 calls is used up.")])
def test_what_was_answered_before_the_end_is_kept_and_compared(terse: Path, tmp_path: Path, end: BaseException) -> None:
    out = tmp_path / "out"
    with pytest.raises(type(end)):
        score(terse, out, [seen(*BOTH), seen(*PLATE), seen(*BOTH), end], seeds=2)
    kept = json.loads((out / "summary.json").read_text())
    assert (kept["complete"], kept["winner"], len(kept["results"])) == (False, PACKAGED, 3)
    assert [variant["scenes"] for variant in kept["variants"]] == [1, 1], "only scenes that all were tried on"

    with (out / "answers.jsonl").open("a") as file:
        file.write('{"key": "cut sho')
    whole = score(terse, out, [seen(*BOTH)], seeds=2)
    assert whole.complete
    assert [score.recall for score in whole.scores] == [1.0, 0.75]
    assert score(terse, out, [], seeds=2) == whole, "nor does a line that was cut short harm the next"


# Wrong use --------------------------------------------------------------------------------------------------------


def test_prompts_that_cannot_be_compared_are_refused(terse: Path, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"holds no scene\.md"):
        load_variants([tmp_path])
    with pytest.raises(UsageError, match="says the same as 'terse'"):
        load_variants([terse, terse])
    (terse / "scene.md").write_text("No placeholders.\n---\nNone.\n", encoding="utf-8")
    with pytest.raises(UsageError, match=r"lacks \{instruction\}"):
        load_variants([terse])


def test_folders_of_one_name_are_told_apart_by_their_path(terse: Path, tmp_path: Path) -> None:
    other = tmp_path / "other" / "terse"
    other.mkdir(parents=True)
    (other / "scene.md").write_text("Else.\n---\n{instruction} {names}\n", encoding="utf-8")
    assert [variant.name for variant in load_variants([terse, other])] == [PACKAGED, "terse", str(other)]


def test_scenes_that_say_nothing_of_what_matters_are_refused(tmp_path: Path) -> None:
    scene = tmp_path / "kitchen.yaml"
    scene.write_text("objects: [{name: carrot, kind: carrot}]\n", encoding="utf-8")
    with pytest.raises(UsageError, match="doesn't say what matters"):
        scenes_of(files=[scene])
    with pytest.raises(UnknownNameError, match="Did you mean 'hungry'"):
        scenes_of(["hungri"])
    with pytest.raises(UsageError, match="Two scenes are named 'hungry'"):
        scenes_of(["hungry", "hungry"])
    with pytest.raises(UsageError, match="seeds is 0"):
        scenes_of(seeds=0)


def test_a_scene_file_may_stand_for_the_tasks(tmp_path: Path) -> None:
    scene = tmp_path / "kitchen.yaml"
    scene.write_text(
        "name: kitchen\ninstruction: put the egg on the plate\n"
        "objects: [{name: egg, kind: egg}, {name: plate, kind: plate}]\n"
        'success: [{kind: "on", object: egg, target: plate}]\n',
        encoding="utf-8",
    )
    assert [one.name for one in scenes_of(files=[scene], seeds=2)] == ["kitchen-s0", "kitchen-s1"]


# The command ------------------------------------------------------------------------------------------------------


def call(out: Path, *options: str) -> Result:
    words = ["prompts", "score", "--task", "carrot-on-plate", "--seeds", "1", "--out", str(out), *options]
    return CliRunner().invoke(app, words, catch_exceptions=False)


def sees(asked: Asked) -> Raw:
    """A model that names more when it is asked with our words than when it is asked tersely."""
    return says(json.dumps(seen(*(PLATE if "TERSELY" in asked.text else BOTH))))(asked)


@pytest.mark.slow
def test_the_command_asks_a_server_and_says_who_wins(terse: Path, tmp_path: Path) -> None:
    pytest.importorskip("pydantic_ai")
    out = tmp_path / "out"
    with serving(sees) as server:
        options = ("--vlm", "vllm:a", "--base-url", f"{server.url}/v1", "--prompts", str(terse))
        done = call(out, *options, "--json")
        told = call(out, *options)
    assert (done.exit_code, told.exit_code) == (0, 0)
    assert len(server.asked) == 2, "the second call asks nothing"
    plain = json.loads(done.stdout)
    assert [(one["name"], one["recall"]) for one in plain["variants"]] == [(PACKAGED, 1.0), ("terse", 0.5)]
    assert plain["winner"] == PACKAGED
    assert "'packaged' wins by recall" in told.stdout
    assert (out / "exchanges.jsonl").read_text().count("\n") == 2


def test_the_budget_is_kept_and_the_answers_before_it_are(
    terse: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("pydantic_ai")
    monkeypatch.setenv("MANIAGENT_BUDGET__CALLS", "1")
    with serving(sees) as server:
        options = ("--vlm", "vllm:a", "--base-url", f"{server.url}/v1", "--prompts", str(terse))
        first, second = call(tmp_path / "out", *options), call(tmp_path / "out", *options)
    assert (first.exit_code, second.exit_code) == (2, 0), "the second call goes on where the first was stopped"
    assert "budget of 1 calls" in first.stderr
    assert "1 of 2 answers are kept" in first.stderr


def test_wrong_use_is_status_2_before_anybody_is_asked(terse: Path, tmp_path: Path) -> None:
    pytest.importorskip("pydantic_ai")
    with serving(fails(500)) as server:
        options = ("--vlm", "vllm:a", "--base-url", f"{server.url}/v1")
        assert call(tmp_path / "out", *options, "--prompts", str(tmp_path / "nowhere")).exit_code == 2
        assert call(tmp_path / "out", *options, "--task", "hungri").exit_code == 2
        refused = call(terse, *options)
    assert (refused.exit_code, "holds what no comparison" in refused.stderr) == (2, True)
    assert server.asked == []
