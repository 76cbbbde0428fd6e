"""Each provider's real client library, against a server that speaks its protocol."""

import json
import subprocess
import sys

import pytest
from asking import CUP, GOOD, KEY, opened, question
from fake_server import (
    Raw,
    Script,
    anthropic_calls_tool,
    anthropic_says,
    fails,
    floods,
    google_says,
    says,
    serving,
    stalls,
)

from maniagent.errors import ModelFailure, SetupError
from maniagent.models.opening import open_model
from maniagent.models.patience import Patience

pytest.importorskip("pydantic_ai")

SPEAKS = {
    "openai:gpt-5": ("OPENAI_API_KEY", "/v1", says),
    "xai:grok-4": ("XAI_API_KEY", "/v1", says),
    "anthropic:claude-sonnet-4-6": ("ANTHROPIC_API_KEY", "", anthropic_says),
    "google:gemini-2.5-pro": ("GOOGLE_API_KEY", "", google_says),
    "ollama:qwen3-vl": ("OLLAMA_API_KEY", "/v1", says),
    "vllm:Qwen/Qwen3-VL-8B": ("VLLM_API_KEY", "/v1", says),
    "llamacpp:any": ("LLAMA_API_KEY", "/v1", says),
}


@pytest.mark.parametrize("name", SPEAKS)
def test_every_provider_answers_and_repairs(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    key, path, say = SPEAKS[name]
    monkeypatch.setenv(key, KEY)
    with serving(say("Hm."), say(GOOD)) as server, opened(f"{name}@{server.url}{path}") as (model, exchanges):
        assert model.name == name
        assert model.ask(question()) == CUP
    assert (exchanges[0].tokens_in, exchanges[0].tokens_out, exchanges[0].mode) == (200, 40, "schema")
    assert KEY in json.dumps(server.asked[0].headers), "the key goes to the server"
    assert "iVBOR" in server.asked[0].text, "and so does the picture"
    assert "no JSON object" in server.asked[1].text


@pytest.mark.parametrize("name", ["anthropic:claude-sonnet-4-6", "google:gemini-2.5-pro", "openai:gpt-5"])
@pytest.mark.parametrize(
    ("script", "timeout", "requests", "told"),
    [
        (fails(500), 20.0, 3, "HTTP 500"),
        (fails(401, f"wrong: {KEY}"), 20.0, 1, "refuses the key"),
        (stalls(2.0), 0.4, 1, "no whole answer"),
        (floods(20), 20.0, 1, "more than 8 MiB"),
        (lambda _: Raw(body="<html>"), 20.0, 3, "gives no answer"),
    ],
    ids=["500", "key", "stalled", "flood", "html"],
)
def test_every_client_library_fails_in_the_same_way(
    name: str, script: Script, timeout: float, requests: int, told: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    key, path, say = SPEAKS[name]
    monkeypatch.setenv(key, KEY)
    patience = Patience(timeout=timeout, retries=2, first_wait=0.01)
    with (
        serving(say(GOOD), script) as server,
        opened(f"{name}@{server.url}{path}") as (at_first, _),
        opened(f"{name}@{server.url}{path}", patience=patience) as (model, _),
    ):
        at_first.ask(question())  # libraries import much of themselves with the first request
        with pytest.raises(ModelFailure, match=told) as failure:
            model.ask(question())
    assert len(server.asked) == 1 + requests, "the library's own retries are off"
    assert KEY not in str(failure.value)


def test_a_body_that_trips_a_client_library_is_a_failure_of_the_model(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ANTHROPIC_API_KEY", KEY)
    name = "anthropic:claude-sonnet-4-6"
    with (
        serving(lambda _: Raw(body="{}"), anthropic_says(GOOD)) as server,
        opened(f"{name}@{server.url}") as (model, _),
    ):
        assert model.ask(question()) == CUP


@pytest.mark.filterwarnings("ignore:The model 'claude-3-5-haiku-latest' is deprecated")
def test_a_model_without_schemas_is_asked_by_tool_call(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ANTHROPIC_API_KEY", KEY)
    scripts = [anthropic_calls_tool({"name": "cup"}), anthropic_calls_tool(json.loads(GOOD))]
    with (
        serving(*scripts) as server,
        opened(f"anthropic:claude-3-5-haiku-latest@{server.url}") as (model, exchanges),
    ):
        assert model.ask(question()) == CUP
    assert exchanges[0].mode == "tool"
    assert "x: Field required" in json.dumps(server.asked[1].body["messages"][-1])


@pytest.mark.parametrize("name", ["openai:gpt-5", "anthropic:claude-sonnet-4-6", "google:gemini-2.5-pro", "xai:grok-4"])
def test_a_missing_key_is_told_with_the_variable(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    for variable in (SPEAKS[name][0], "GEMINI_API_KEY"):
        monkeypatch.delenv(variable, raising=False)
    with pytest.raises(SetupError, match=f"needs a key: export {SPEAKS[name][0]}="):
        open_model(name)


def test_a_missing_extra_is_named() -> None:
    code = (
        "import sys; sys.modules['httpx2'] = sys.modules['pydantic_ai'] = None\n"
        "from maniagent.models.opening import open_model\n"
        "open_model('llamacpp:any')"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert "SetupError: Language models need the extra `models`: pip install 'maniagent[models]'" in ended.stderr


def test_nothing_heavy_is_imported_before_a_model_is_opened() -> None:
    code = (
        "import sys, maniagent.models.opening; sys.exit('pydantic_ai' in sys.modules or 'genai_prices' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
