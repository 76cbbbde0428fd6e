"""docs/models.md holds: its code runs, and its settings and providers are the ones there are."""

import re
import tomllib
from pathlib import Path

import pytest
from asking import GOOD
from fake_server import says, serving

from maniagent.models.names import PROVIDERS
from maniagent.models.settings import ModelSettings

TEXT = (Path(__file__).parents[2] / "docs" / "models.md").read_text(encoding="utf-8")


def block(language: str) -> str:
    (found,) = re.findall(rf"```{language}\n(.*?)```", TEXT, re.DOTALL)
    return found


def test_the_code_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("pydantic_ai")
    monkeypatch.chdir(tmp_path)
    with serving(says(GOOD.replace(', "tags": []', ""))) as server:
        exec(block("python").replace("http://127.0.0.1:8080", server.url), {"__name__": "docs"})  # noqa: S102 - our own
    assert (tmp_path / "recording" / "exchanges.jsonl").exists()


def test_the_settings_are_all_there_with_their_defaults() -> None:
    shown = tomllib.loads(block("toml"))["models"]
    settings = ModelSettings.model_validate(shown)
    assert set(shown) == set(ModelSettings.model_fields)
    assert settings.patience == ModelSettings.model_fields["patience"].default
    assert set(shown["budget"]) == set(type(settings.budget).model_fields)


def test_the_providers_are_all_there() -> None:
    rows = re.findall(r"^\| `([\w-]+)` \| (.*?) \| (.*?) \|$", TEXT, re.MULTILINE)
    assert [name for name, _, _ in rows] == list(PROVIDERS)
    for name, keys, served in rows:
        assert re.findall(r"`(\w+_API_KEY)`", keys) == list(PROVIDERS[name].keys)
        assert PROVIDERS[name].base_url is None or not PROVIDERS[name].own or PROVIDERS[name].base_url in served
