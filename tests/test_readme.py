"""What the documents say about files, commands and code is true."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
import typer
import yaml
from typer.testing import CliRunner

from maniagent.cli import app
from maniagent.tasks import Task, names

ROOT = Path(__file__).parents[1]
DOCUMENTS = [ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")] + sorted(ROOT.glob("docs/*.md"))
ROOT_COMMAND = typer.main.get_command(app)


def command_of(words: list[str]) -> list[str]:
    """The command among the words, sub-commands included; empty where there is none."""
    path: list[str] = []
    group = ROOT_COMMAND
    for word in words:
        group = getattr(group, "commands", {}).get(word)
        if group is None:
            break
        path.append(word)
    return path


def blocks(path: Path, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", path.read_text(encoding="utf-8"), re.M | re.S)


def links(path: Path) -> list[str]:
    text = path.read_text(encoding="utf-8")
    found = re.findall(r"\]\(([^)\s]+)\)|<img src=\"([^\"]+)\"", text)
    return [link.split("#")[0] for pair in found for link in pair if link and not link.startswith(("http", "#"))]


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: path.name)
def test_links_lead_somewhere(path: Path) -> None:
    assert [link for link in links(path) if link and not (path.parent / link).exists()] == []


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: path.name)
def test_source_files_that_are_named_exist(path: Path) -> None:
    named = re.findall(r"`((?:src|tests|docs|benchmarks)/[\w./-]+)`", path.read_text(encoding="utf-8"))
    assert [name for name in named if not (ROOT / name).exists()] == []


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: path.name)
def test_commands_and_options_that_are_named_exist(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    told = [shlex.split(line, comments=True) for line in re.findall(r"^\$ (?:\S*/)?maniagent (.*)$", text, re.M)]
    told += [re.sub(r"[\[\]\"]", "", line).split() for line in re.findall(r"`maniagent ([^`]*)`", text)]
    for words in told:
        command = command_of(words)
        assert command, words
        usage = CliRunner().invoke(app, [*command, "--help"], env={"COLUMNS": "200"}).stdout
        assert all(word in usage for word in words if word.startswith("--")), words
        if "--task" in words and (task := words[words.index("--task") + 1]) != "NAME":
            assert task in names()


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: path.name)
def test_scenes_that_are_shown_are_valid(path: Path) -> None:
    for block in blocks(path, "yaml"):
        Task.model_validate(yaml.safe_load(block))


def test_the_readme_has_one_python_example_of_ten_lines_at_most() -> None:
    (example,) = blocks(ROOT / "README.md", "python")
    assert sum(bool(line.strip()) for line in example.splitlines()) <= 10


@pytest.mark.slow
def test_the_python_example_runs(tmp_path: Path) -> None:
    (example,) = blocks(ROOT / "README.md", "python")
    done = subprocess.run(
        [sys.executable, "-c", example], cwd=tmp_path, capture_output=True, text=True, check=False, timeout=300
    )
    assert done.returncode == 0, done.stderr
    assert "achieved" in done.stdout
    assert (tmp_path / "runs/readme/report.html").exists()


def test_no_document_names_a_machine_or_a_registry() -> None:
    for path in DOCUMENTS:
        assert not re.search(r"/work/|/root/|/home/|pypi|index-url", path.read_text(encoding="utf-8")), path
