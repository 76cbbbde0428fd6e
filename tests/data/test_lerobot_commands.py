"""`maniagent data publish|merge|split`: wrong use ends with status 2 and a line that helps."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest
from staged import stage
from typer.testing import CliRunner

from maniagent.cli import app
from maniagent.data.lerobot.interpreter import VARIABLE


@pytest.fixture(autouse=True)
def no_lerobot(monkeypatch: pytest.MonkeyPatch) -> None:
    """An interpreter is named; it is never asked for anything here."""
    monkeypatch.setenv(VARIABLE, sys.executable)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["split", "d", "train", "--out", "o"], "'train' is no part"),
        (["split", "d", "train=many", "--out", "o"], "'train=many' is no part"),
        (["split", "d", "a=1", "a=2", "--out", "o"], "same name"),
        (["split", "d", "a=1", "--out", "o"], "no description of a LeRobot dataset"),
        (["merge", "a", "--out", "o"], "at least two"),
        (["publish", "nowhere"], "nowhere is no folder"),
        (["publish", ".", "--lerobot-python", "nowhere"], "no Python interpreter"),
    ],
)
def test_wrong_use_is_told(arguments: list[str], told: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(app, ["data", *arguments, "--json"])
    assert done.exit_code == 2
    assert told in json.loads(done.stdout)["error"]
    assert list(tmp_path.glob("o")) == []


def test_a_python_without_lerobot_is_told_and_nothing_is_lost(tmp_path: Path) -> None:
    stage(tmp_path / "episodes", "e0")
    (tmp_path / "python").write_text(f'#!/bin/sh\nexec {sys.executable} -S "$@"\n')  # -S: no installed packages
    (tmp_path / "python").chmod(0o755)
    done = CliRunner().invoke(
        app, ["data", "publish", str(tmp_path), "--lerobot-python", str(tmp_path / "python"), "--json"]
    )
    assert done.exit_code == 2
    assert (tmp_path / "episodes" / "e0").exists()
    assert not (tmp_path / "dataset").exists()


def test_with_nothing_staged_publishing_says_so(tmp_path: Path) -> None:
    done = CliRunner().invoke(app, ["data", "publish", str(tmp_path), "--json"])
    assert json.loads(done.stdout) == {"dataset": str(tmp_path / "dataset"), "added": 0, "episodes": 0}
