"""`maniagent cache` as a person types it."""

import json
import re
from pathlib import Path
from typing import Any

import pytest
from sequences import judged, put, subtask
from typer.testing import CliRunner, Result

from maniagent.agents.cache import ActionCache, CacheStore
from maniagent.cli import app
from maniagent.types import Verdict


def call(*arguments: str | Path) -> Result:
    return CliRunner(env={"COLUMNS": "120"}).invoke(app, ["cache", *map(str, arguments)], catch_exceptions=False)


@pytest.fixture
def cache(tmp_path: Path) -> Path:
    path = tmp_path / "cache.sqlite"
    learned = ActionCache(CacheStore(path))
    learned.learn(judged(subtask(), put(), Verdict.SUCCESS), None)
    learned.learn(judged(subtask(), put(), Verdict.FAILURE), None)
    there = subtask("put the \x1b[31mcup at (0.3, 0.1)", "\x1b[31mcup")
    learned.learn(judged(there, put(point=(0.3, 0.1)), Verdict.SUCCESS), None)
    return path


def exported(cache: Path) -> dict[str, Any]:
    return json.loads(call("export", "--cache", cache).stdout)


def test_list_says_what_was_learned_and_how_it_went(cache: Path) -> None:
    text = call("list", "--cache", cache).stdout
    assert re.search(r"1 +text +put the carrot on the plate +pick-and-place +1 of 2", text)
    assert re.search(r"2 +form +put \{0\} on \{1\} ", text)
    assert "\x1b" not in text
    listed = json.loads(call("list", "--cache", cache, "--json").stdout)
    assert [(entry["id"], entry["kind"], entry["successes"], entry["failures"]) for entry in listed] == [
        (1, "text", 1, 1),
        (2, "form", 1, 1),
        (3, "text", 1, 0),
    ]


def test_show_tells_the_steps(cache: Path) -> None:
    text = call("show", "2", "--cache", cache).stdout
    assert "Take the {0}" in text
    assert "pick-and-place" in text
    shown = json.loads(call("show", "1", "--cache", cache, "--json").stdout)
    assert shown["sequence"] == put().model_dump(mode="json")


def test_rm_removes(cache: Path) -> None:
    assert call("rm", "1", "3", "--cache", cache).exit_code == 0
    assert [entry.id for entry in CacheStore(cache).entries()] == [2]


def test_what_is_exported_is_imported_elsewhere_and_only_once(cache: Path, tmp_path: Path) -> None:
    file, other = tmp_path / "cache.json", tmp_path / "other.sqlite"
    assert call("export", file, "--cache", cache).exit_code == 0
    assert json.loads(call("import", file, "--cache", other, "--json").stdout) == {"added": 3, "known": 0}
    assert exported(other) == exported(cache)
    assert json.loads(call("import", file, "--cache", other, "--json").stdout) == {"added": 0, "known": 3}


def test_the_users_own_cache_is_empty_before_anything_was_learned(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    result = call("list", "--json")
    assert (result.exit_code, json.loads(result.stdout)) == (0, [])


@pytest.mark.parametrize(
    "arguments",
    [("show", "9"), ("rm", "9"), ("rm", "1", "9"), ("import", "no-such-file"), ("export", "no/such/folder")],
)
def test_wrong_use_is_one_line_and_status_2(cache: Path, arguments: tuple[str, ...]) -> None:
    result = call(*arguments, "--cache", cache)
    assert result.exit_code == 2
    assert result.stderr.startswith("error: ")
    assert len(CacheStore(cache).entries()) == 3


@pytest.mark.parametrize("command", [("list",), ("show", "1"), ("rm", "1"), ("export",)])
def test_a_cache_that_is_not_there_is_told(tmp_path: Path, command: tuple[str, ...]) -> None:
    result = call(*command, "--cache", tmp_path / "typo.sqlite")
    assert result.exit_code == 2
    assert "There is no cache at" in result.stderr


def changed(**changes: Any) -> Any:
    return lambda export: export["entries"][0].update(changes)


def step(**changes: Any) -> Any:
    return lambda export: export["entries"][0]["sequence"]["steps"][0].update(changes)


HOSTILE = {
    "another format": lambda export: export.update(format="bookmarks"),
    "another version": lambda export: export.update(version=2),
    "an unknown field": lambda export: export.update(run="rm -rf"),
    "an unknown field in an entry": changed(code="import os"),
    "no successes": changed(successes=0),
    "negative failures": changed(failures=-1),
    "a count as text": changed(successes="many"),
    "a huge count": changed(successes=10**30),
    "a naive time": changed(judged="2026-01-01T00:00:00"),
    "endless text": changed(wording="x" * 10_000),
    "no objects": changed(objects=[]),
    "an unknown kind": changed(kind="regex"),
    "no normal form": changed(kind="form", objects=["{0}", "{1}"], wording="Put {0} on the {1}."),
    "a form of named objects": changed(kind="form", objects=["carrot", "plate"]),
    "an unknown object": step(anchor={"index": 7, "part": "grasp"}),
    "a point nobody said": step(anchor={"x": 0.3, "y": 0.1, "z": 0.0}),
    "a far point": step(offset=[0, 0, 1e9]),
    "NaN": step(offset=[0, 0, float("nan")]),
    "no steps": lambda export: export["entries"][0]["sequence"].update(steps=[]),
}


@pytest.mark.parametrize("hostile", HOSTILE.values(), ids=HOSTILE)
def test_a_hostile_file_is_refused_as_a_whole(cache: Path, tmp_path: Path, hostile: Any) -> None:
    content, file, other = exported(cache), tmp_path / "hostile.json", tmp_path / "other.sqlite"
    hostile(content)
    content["entries"].reverse()  # what is wrong comes last
    file.write_text(json.dumps(content))
    result = call("import", file, "--cache", other)
    assert (result.exit_code, result.stdout) == (2, "")
    assert "is no exported cache" in result.stderr
    assert CacheStore(other).entries() == ()


@pytest.mark.parametrize("content", [b"", b"nonsense", b"\xff\xfe\x00", b"[" * 100_000, b"{}", b"null", b'"text"'])
def test_a_file_that_is_no_export_is_refused(tmp_path: Path, content: bytes) -> None:
    file = tmp_path / "broken.json"
    file.write_bytes(content)
    result = call("import", file, "--cache", tmp_path / "other.sqlite")
    assert result.exit_code == 2
    assert "is no exported cache" in result.stderr
