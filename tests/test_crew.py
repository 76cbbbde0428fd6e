"""Crews: said by name, found again by it, and their models' exchanges told and kept."""

import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from maniagent.app import run
from maniagent.commands.crew import crew_from
from maniagent.crew import MODELS, Crew, ModelCrew, RulesCrew, crew_of
from maniagent.errors import SetupError, UnknownNameError, UsageError
from maniagent.evaluation.tally import THINKING, Tally
from maniagent.types import RunVerdict
from models.fake_server import says, serving

TEXT = st.text(st.characters(exclude_categories=("C", "Z")), min_size=1, max_size=20)
BLANKS = st.text("ab ='\"", min_size=1, max_size=12)


@pytest.fixture(autouse=True)
def _no_settings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("VLM", "LLM", "BASE_URL"):
        monkeypatch.delenv(f"MANIAGENT_{name}", raising=False)


@given(TEXT, TEXT, BLANKS, BLANKS)
def test_a_crew_is_found_again_by_its_name(vlm: str, llm: str, prompts: str, cache: str) -> None:
    crew = ModelCrew(vlm=vlm, llm=llm, detector="lexicon", prompts=prompts, cache=cache)
    assert crew_of(crew.name) == crew


def test_the_rules_need_no_more_than_their_name() -> None:
    assert crew_of("rules") == RulesCrew()


def test_models_that_are_not_said_come_from_the_settings_or_are_the_other_one(monkeypatch: pytest.MonkeyPatch) -> None:
    assert crew_of("agents llm=ollama:qwen").name == "agents vlm=ollama:qwen llm=ollama:qwen detector=marks"
    monkeypatch.setenv("MANIAGENT_VLM", "openai:a")
    monkeypatch.setenv("MANIAGENT_LLM", "openai:b")
    assert crew_of("agents").name == "agents vlm=openai:a llm=openai:b detector=marks"


@pytest.mark.parametrize(
    ("name", "error", "said"),
    [
        ("rule", UnknownNameError, "Did you mean 'rules'"),
        ("agents", UsageError, "No model is named: give --vlm"),
        ("agents vlm=a:b detectr=marks", UnknownNameError, "Did you mean 'detector'"),
        ("rules vlm=a:b", UnknownNameError, "Unknown actor"),
        ("agents 'vlm=a:b", UnknownNameError, "Unknown actor"),
        ("", UnknownNameError, "Unknown actor"),
    ],
)
def test_names_of_no_crew_are_refused(name: str, error: type[Exception], said: str) -> None:
    with pytest.raises(error, match=said):
        crew_of(name)


def test_options_mean_a_crew() -> None:
    assert crew_from(None) == crew_from("rules") == RulesCrew()
    crew = crew_from(None, vlm="openai:a", prompts=Path("mine"))
    assert crew == ModelCrew(vlm="openai:a", llm="openai:a", prompts=str(Path("mine").resolve()))
    with pytest.raises(UsageError, match=r"--base-url is for --actor agents, not for 'rules'\."):
        crew_from("rules", base_url="http://x")


@pytest.mark.parametrize(
    ("crew", "error", "said"),
    [
        (ModelCrew(vlm="openai:a", llm="openai:a"), SetupError, "OPENAI_API_KEY"),
        (ModelCrew(vlm="vllm:a", llm="vllm:a", detector="marcs"), UnknownNameError, "Did you mean 'marks'"),
        (ModelCrew(vlm="vllm:a", llm="vllm:a", prompts="nowhere"), UsageError, "holds no prompts"),
    ],
)
def test_what_is_missing_is_said_before_anything_moves(
    crew: Crew, error: type[Exception], said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("OPENAI_API_KEY", raising=False)
    with pytest.raises(error, match=said):
        run(task="hungry", crew=crew)


@pytest.mark.slow
def test_a_run_on_a_server_is_told_counted_and_recorded(tmp_path: Path) -> None:
    scene = {"objects": [{"name": "marker", "state": "on the table"}], "summary": "Nothing to eat."}
    give_up = {"evidence": "", "previous": "none", "remaining": "There is nothing to eat.", "next": "cannot"}
    tally = Tally()
    with serving(says(json.dumps(scene), tokens=(500, 40)), says(json.dumps(give_up), tokens=(900, 60))) as server:
        crew = ModelCrew(vlm="vllm:a", llm="vllm:b", base_url=f"{server.url}/v1")
        outcome = run(task="hungry", crew=crew, out=tmp_path / "run", observers=[tally])
        assert [asked.body["model"] for asked in server.asked] == ["a", "b"]
        assert "data:image/png" in server.asked[0].text
        assert "data:image" not in server.asked[1].text
    assert (outcome.result.verdict, outcome.result.reason) == (RunVerdict.CANNOT, "There is nothing to eat.")
    assert (tally.model_calls, tally.tokens) == (2, 1500)
    spent = tally.seconds_by_kind(outcome.result)
    assert spent[THINKING] > 0
    assert min(spent.values()) >= 0
    lines = [json.loads(line) for line in (tmp_path / "run" / "exchanges.jsonl").read_text().splitlines()]
    assert [line["role"] for line in lines] == ["scene", "reasoning"]
    events = [json.loads(line) for line in (tmp_path / "run" / "events.jsonl").read_text().splitlines()]
    assert [event["tokens_in"] for event in events if event["kind"] == "asked"] == [500, 900]
    started = next(event for event in events if event["kind"] == "run_started")
    assert started["agents"] == f"{MODELS} (vlm vllm:a, llm vllm:b, detector marks)"
    run(task="hungry", crew=RulesCrew(), out=tmp_path / "run")  # a run folder with exchanges is a run folder
