"""`maniagent models`: what it finds out about models of different worth, and how it tells."""

import base64
import io
import json
import random
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from asking import KEY
from fake_server import Asked, Raw, Script, calls_tool, fails, says, serving
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image
from typer.testing import CliRunner, Result

from maniagent.cli import app
from maniagent.models.check import draw

pytest.importorskip("pydantic_ai")

PAINT = {"red": (214, 39, 40), "green": (44, 160, 44), "blue": (31, 90, 200), "yellow": (250, 210, 30)}


def check(*arguments: str) -> Result:
    return CliRunner().invoke(app, ["models", "check", *arguments], catch_exceptions=False)


def competent(look: Callable[[Asked], list[str]]) -> Script:
    """A model that does all it is asked; `look` gives the colours it sees."""

    def script(asked: Asked) -> Raw:
        text = asked.text
        if "17 + 25" in text:
            return says('{"result": 42}')(asked)
        if "Greet me" in text:
            greeting = '{"ruby_word": "Hi", "amber_number": 1, "slate_kind": "warm"}'
            return (calls_tool(greeting) if "tools" in asked.body else says(greeting))(asked)
        if "coloured shapes" in text:
            seen = look(asked)
            return says(json.dumps({"count": len(seen), "colours": seen}))(asked)
        return says(json.dumps({"numbers": list(range(1, 61))}), tokens=(50, 200))(asked)

    return script


def see(asked: Asked) -> list[str]:
    """What is in the middle of the nine cells of the picture that was sent."""
    url = asked.body["messages"][1]["content"][1]["image_url"]["url"]
    with Image.open(io.BytesIO(base64.b64decode(url.split(",")[1]))) as image:
        rgb = np.asarray(image)
    middles = [tuple(int(c) for c in rgb[64 + 128 * (i // 3), 64 + 128 * (i % 3)]) for i in range(9)]
    names = {paint: name for name, paint in PAINT.items()}
    return [names[middle] for middle in middles if middle in names]


def test_a_model_that_sees_and_keeps_to_forms_serves_for_all() -> None:
    with serving(competent(see)) as server:
        result = check(f"vllm:good@{server.url}/v1", "--json")
    found = json.loads(result.stdout)
    assert result.exit_code == 0
    assert (found["reachable"], found["llm"], found["vlm"], found["mode"]) == (True, True, True, "schema")
    assert [finding["name"] for finding in found["findings"]] == [
        "answers",
        "fits",
        "schema",
        "tool",
        "pictures",
        "speed",
    ]
    assert all(finding["ok"] for finding in found["findings"])
    assert found["tokens_per_second"] > 0


@pytest.mark.parametrize("look", [lambda _: [], lambda _: ["red"], lambda asked: see(asked)[1:]])
def test_a_model_that_guesses_what_it_sees_serves_for_text_only(look: Callable[[Asked], list[str]]) -> None:
    with serving(competent(look)) as server:
        result = check(f"vllm:blind@{server.url}/v1")
    assert result.exit_code == 1
    assert "✗ pictures" in result.stdout
    assert "Serves as LLM only" in result.stdout


def test_a_server_that_refuses_pictures_and_schemas_is_told_as_such() -> None:
    def script(asked: Asked) -> Raw:
        if "response_format" in asked.body or "tools" in asked.body or "image_url" in asked.text:
            return fails(400, "not supported here")(asked)
        return competent(see)(asked)

    with serving(script) as server:
        result = check(f"llamacpp:plain@{server.url}/v1", "--json")
    found = json.loads(result.stdout)
    findings = {finding["name"]: finding for finding in found["findings"]}
    assert (found["llm"], found["vlm"], found["mode"]) == (True, False, "prompt")
    assert [findings[name]["ok"] for name in ("schema", "tool", "pictures")] == [False] * 3
    assert "refused: HTTP 400: not supported here" in findings["schema"]["detail"]


def test_a_model_that_only_chats_serves_for_nothing() -> None:
    with serving(says("Hello!")) as server:
        result = check(f"ollama:chatty@{server.url}/v1")
    assert result.exit_code == 1
    assert "Serves as neither" in result.stdout


def test_out_of_reach_is_one_finding_and_status_2() -> None:
    result = check("llamacpp:gone@http://127.0.0.1:9/v1", "--json")
    found = json.loads(result.stdout)
    assert result.exit_code == 2
    assert [finding["name"] for finding in found["findings"]] == ["answers"]


def test_a_refused_key_is_status_2_and_not_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENAI_API_KEY", KEY)
    with serving(fails(401, f"{KEY}?")) as server:
        result = check("openai:gpt-5", "--base-url", f"{server.url}/v1")
    assert result.exit_code == 2
    assert "refuses the key in OPENAI_API_KEY" in result.stdout
    assert KEY not in result.output


@pytest.mark.parametrize("name", ["gpt-5", "opnai:gpt-5", "openai-compatible:m"])
def test_wrong_use_is_status_2_and_one_line(name: str) -> None:
    result = check(name)
    assert result.exit_code == 2
    assert len(result.stderr.strip().splitlines()) == 1


def test_the_list_says_which_keys_are_there_and_never_what_they_are(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XAI_API_KEY", KEY)
    monkeypatch.delenv("OPENAI_API_KEY", raising=False)
    table = CliRunner().invoke(app, ["models", "list"])
    plain = CliRunner().invoke(app, ["models", "list", "--json"])
    listed: dict[str, Any] = {entry["provider"]: entry for entry in json.loads(plain.stdout)}
    assert listed["xai"]["key_found"] == "XAI_API_KEY"
    assert listed["openai"]["key_found"] is None
    assert KEY not in table.output + plain.output


@given(st.lists(st.sampled_from(sorted(PAINT)), max_size=6), st.randoms(use_true_random=False))
@settings(max_examples=20)
def test_the_picture_shows_every_shape_once(colours: list[str], rng: random.Random) -> None:
    middles = draw(colours, rng)[64::128, 64::128].reshape(-1, 3)
    shown = [tuple(map(int, middle)) for middle in middles]
    assert sorted(each for each in shown if each != (255, 255, 255)) == sorted(PAINT[colour] for colour in colours)
