"""Calls that make no sense are refused with one clear error, before anything moves; the command line's exit status."""

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from maniagent.app import run
from maniagent.cli import app
from maniagent.errors import UsageError


@pytest.mark.parametrize("text", ["", "  \n\t "])
def test_an_empty_instruction_is_wrong_use(text: str) -> None:
    with pytest.raises(UsageError, match="no instruction"):
        run(text, task="pepper-on-plate")


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"task": "peper-on-plate"}, "Unknown task 'peper-on-plate'. Did you mean 'pepper-on-plate'?"),
        ({}, "either a task"),
        ({"task": "pepper-on-plate", "scene": "kitchen.yaml"}, "not both"),
        ({"task": "pepper-on-plate", "seed": -1}, "seed is -1"),
        ({"scene": "no/such/file.yaml"}, "no/such/file.yaml"),
        ({"scene": "."}, "Can't read"),
    ],
)
def test_wrong_use_is_one_clear_error(options: dict[str, Any], said: str) -> None:
    with pytest.raises(UsageError, match=said.replace("?", r"\?")):
        run("put the pepper on the plate", **options)


THING = "objects: [{name: thing, kind: carrot%s}]"
MISTAKES = {
    "not YAML": ("objects: [}", "not valid YAML"),
    "no mapping": ("- carrot", "should hold a mapping"),
    "nothing": ("", "should hold a mapping"),
    "code": ("objects: !!python/object/apply:os.getcwd []", "not valid YAML"),
    "no objects": ("objects: []", "objects"),
    "misspelt key": ("objekts: []", "objekts"),
    "unknown kind": ("objects: [{name: thing, kind: carot}]", "carot"),
    "bad name": ("objects: [{name: The Thing, kind: carrot}]", "objects.0.name"),
    "twice the same": ("objects: [{name: a, kind: carrot}, {name: a, kind: egg}]", "two objects are named 'a'"),
    "not a number": (THING % ", place: {at: [.nan, 0]}", "place.at"),
    "out of reach": (THING % ", place: {at: [0.9, 0.0]}", "out of reach"),
    "on the unknown": (THING % ", place: {on: table}", "must be listed before"),
    "empty region": (THING % ", place: {region: {x: [0.3, 0.2], y: [0, 0.1]}}", r"\[low, high\]"),
    "overlap": (
        "objects: [{name: a, kind: egg, place: {at: [0.3, 0]}}, {name: b, kind: egg, place: {at: [0.3, 0.01]}}]",
        "overlaps",
    ),
    "no such parameter": (THING % ", params: {weight: 3}", "weight"),
    "a parameter of the wrong kind": ("objects: [{name: b, kind: block, params: {size: big}}]", "size"),
    "a nested parameter": ("objects: [{name: b, kind: block, params: {size: {x: 1}}}]", "size"),
    "a parameter that is not finite": ("objects: [{name: b, kind: block, params: {size: .nan}}]", "not nan"),
    "a colour that is none": ("objects: [{name: b, kind: block, params: {colour: mauvish}}]", "mauvish"),
    "success of the unknown": (
        (THING % "") + "\nsuccess: [{kind: 'on', object: thing, target: plate}]",
        "no object is named plate",
    ),
}


@pytest.mark.parametrize(("text", "said"), MISTAKES.values(), ids=MISTAKES)
def test_a_scene_file_with_a_mistake_is_refused_with_what_and_where(text: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "scene.yaml"
    path.write_text(text)
    with pytest.raises(UsageError, match=said):
        run("put the carrot on the plate", scene=path)


def test_a_scene_file_that_is_no_text_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "scene.yaml"
    path.write_bytes(bytes(range(256)))
    with pytest.raises(UsageError, match="not valid YAML"):
        run("put the carrot on the plate", scene=path)


# Exit status ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "status"),
    [
        (["put the banana on the plate", "--task", "pepper-on-plate"], 1),
        (["put the pepper on the plate", "--task", "peper-on-plate"], 2),
        (["", "--task", "pepper-on-plate"], 2),
    ],
)
def test_the_command_ends_with_its_documented_status_and_no_traceback(
    arguments: list[str], status: int, tmp_path: Path
) -> None:
    done = CliRunner().invoke(app, ["run", *arguments, "--json", "--out", str(tmp_path / "run")])
    assert done.exit_code == status
    assert "Traceback" not in done.output
    told = json.loads(done.stdout)
    assert told["verdict"] == "cannot" if status == 1 else set(told) == {"error"}
