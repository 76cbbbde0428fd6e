"""How models are named, and where the settings of a run come from."""

import os
from pathlib import Path

import pytest
from asking import KEY
from hypothesis import given
from hypothesis import strategies as st

from maniagent.errors import UnknownNameError, UsageError
from maniagent.models.names import PROVIDERS, parse_name
from maniagent.models.opening import open_model, open_models
from maniagent.models.patience import Patience
from maniagent.models.settings import load_settings


@pytest.fixture(autouse=True)
def nothing_set(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder without settings, and an environment without any."""
    monkeypatch.chdir(tmp_path)
    for variable in [name for name in os.environ if name.startswith("MANIAGENT_")]:
        monkeypatch.delenv(variable)
    return tmp_path


# Names -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "base_url", "parts"),
    [
        ("openai:gpt-5", None, ("openai", "gpt-5", None)),
        ("ollama:qwen3-vl:8b", None, ("ollama", "qwen3-vl:8b", "http://127.0.0.1:11434/v1")),
        ("vllm:Qwen/Qwen3-VL-8B@http://gpu:8000/v1/", None, ("vllm", "Qwen/Qwen3-VL-8B", "http://gpu:8000/v1")),
        ("openai-compatible:m", "https://h/v1", ("openai-compatible", "m", "https://h/v1")),
        ("llamacpp:m@http://a/v1", "http://b/v1", ("llamacpp", "m", "http://a/v1")),
        ("openai:org@v2", None, ("openai", "org@v2", None)),
    ],
)
def test_a_name_is_a_provider_a_model_and_perhaps_an_address(
    name: str, base_url: str | None, parts: tuple[str, str, str | None]
) -> None:
    address = parse_name(name, base_url)
    assert (address.provider_name, address.model, address.base_url) == parts
    assert address.name == name.split("@http")[0]


@pytest.mark.parametrize("name", ["gpt-5", "openai:", ":gpt-5", "", "openai"])
def test_a_name_without_its_parts_is_told(name: str) -> None:
    with pytest.raises(UsageError, match="PROVIDER:MODEL"):
        parse_name(name)


def test_an_unknown_provider_is_told_with_the_nearest() -> None:
    with pytest.raises(UnknownNameError, match="Did you mean 'anthropic'"):
        parse_name("antropic:claude")


def test_a_server_of_ones_own_needs_an_address() -> None:
    with pytest.raises(UsageError, match="openai-compatible:m@http://HOST:PORT/v1"):
        parse_name("openai-compatible:m")


@pytest.mark.parametrize("url", ["http://me:secret@host/v1", "http://host/v1?key=secret", "http://host/v1#secret"])
def test_an_address_holds_no_key_and_the_error_neither(url: str) -> None:
    with pytest.raises(UsageError) as told:
        parse_name(f"vllm:m@{url}")
    assert "secret" not in str(told.value)


@given(st.sampled_from(sorted(PROVIDERS)), st.text(min_size=1, max_size=20), st.sampled_from(["", "@http://h:1/v1"]))
def test_every_provider_and_model_is_taken_apart_again(provider: str, model: str, at: str) -> None:
    address = parse_name(f"{provider}:{model}{at}", "http://default/v1")
    assert (address.provider_name, address.model) == (provider, model)


# Settings --------------------------------------------------------------------------------------------------------


def test_flags_are_stronger_than_the_environment_and_that_than_the_file(
    nothing_set: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (nothing_set / "maniagent.toml").write_text(
        '[models]\nvlm = "ollama:file"\nllm = "ollama:file"\noutput = "tool"\n'
        "[models.budget]\ncalls = 5\ntokens = 7\n"
        '[models.prices."ollama:file"]\ninput = 1\noutput = 2\n[other]\nx = 1\n'
    )
    monkeypatch.setenv("MANIAGENT_LLM", "ollama:environment")
    monkeypatch.setenv("MANIAGENT_BUDGET__CALLS", "6")
    monkeypatch.setenv("MANIAGENT_OUTPUT", "schema")
    settings = load_settings(output="prompt", vlm=None)
    assert (settings.vlm, settings.llm, settings.output) == ("ollama:file", "ollama:environment", "prompt")
    assert (settings.budget.calls, settings.budget.tokens, settings.budget.money) == (6, 7, None)
    assert settings.prices["ollama:file"].output == 2


def test_without_any_settings_there_are_sound_bounds() -> None:
    settings = load_settings()
    assert (settings.vlm, settings.llm, settings.output) == (None, None, "auto")
    assert 0 < settings.patience.timeout < 600
    assert settings.patience.max_tokens > 0


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("[models]\nvml = 'x'\n", "vml"),
        ("[models]\noutput = 'loud'\n", "output"),
        ("[models.budget]\ncalls = -1\n", "budget.calls"),
        ("[models.patience]\ntimeout = 0\n", "patience.timeout"),
        ("[models]\nvlm = \n", "no TOML file"),
    ],
)
def test_a_setting_that_makes_no_sense_is_told_by_name(nothing_set: Path, text: str, told: str) -> None:
    (nothing_set / "maniagent.toml").write_text(text)
    with pytest.raises(UsageError, match=told):
        load_settings()


def test_a_bad_variable_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MANIAGENT_BUDGET__SECONDS", "soon")
    with pytest.raises(UsageError, match=r"budget\.seconds"):
        load_settings()


def test_the_address_for_own_models_is_for_no_other(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MANIAGENT_BASE_URL", "http://lab:8000/v1")
    settings = load_settings()
    assert settings.base_url_for("vllm:any") == "http://lab:8000/v1"
    assert settings.base_url_for("openai:gpt-5") is None, "no key for OpenAI goes to the lab's server"


def test_one_named_model_is_both(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("pydantic_ai")
    models = open_models(load_settings(llm="ollama:text"))
    assert models.vlm is models.llm
    models.close()
    models = open_models(load_settings(llm="ollama:text", vlm="ollama:eyes"))
    assert (models.vlm.name, models.llm.name) == ("ollama:eyes", "ollama:text")
    models.close()


def test_no_named_model_is_told() -> None:
    with pytest.raises(UsageError, match="No model is named: give --vlm"):
        open_models(load_settings())


def test_a_schema_can_not_be_asked_of_who_has_none(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("pydantic_ai")
    monkeypatch.setenv("ANTHROPIC_API_KEY", KEY)
    with pytest.raises(UsageError, match="doesn't enforce JSON schemas"):
        open_model("anthropic:claude-3-5-haiku-latest", output="schema")


# Patience --------------------------------------------------------------------------------------------------------


@given(st.integers(1, 40), st.floats(0, 100) | st.none())
def test_waits_grow_and_stay_within_their_bound(attempt: int, asked: float | None) -> None:
    patience = Patience(retries=20)
    wait = patience.wait(attempt, asked)
    if attempt > 20 or (asked or 0) > patience.longest_wait:
        assert wait is None
    else:
        assert wait is not None
        assert max(asked or 0, 0.75 * min(0.5 * 2 ** (attempt - 1), 30)) <= wait <= max(asked or 0, 1.25 * 30)
