"""One run from end to end, in the real twin."""

import json
from pathlib import Path
from typing import Any

import pytest

from maniagent.app import RunOutcome, run
from maniagent.console.journal import read_lines, to_plain
from maniagent.types import Event, RunVerdict

pytestmark = pytest.mark.slow

TASK = "carrot-on-plate"


class Listener:
    """Every event but the frames, as plain data."""

    def __init__(self) -> None:
        self.heard: list[tuple[str, Any]] = []
        self.frames = 0

    def on_event(self, event: Event) -> None:
        if event.kind == "frame":
            self.frames += 1
            return
        data = to_plain(event.data)
        if event.kind == "run_finished":
            del data["result"]["seconds"]
        self.heard.append((event.kind, data))


@pytest.fixture(scope="module")
def listener() -> Listener:
    return Listener()


@pytest.fixture(scope="module")
def outcome(listener: Listener, tmp_path_factory: pytest.TempPathFactory) -> RunOutcome:
    folder = tmp_path_factory.mktemp("runs") / "one"
    return run(task=TASK, seed=3, out=folder, observers=[listener])


def test_the_outcome_says_what_was_asked_believed_and_true(outcome: RunOutcome) -> None:
    assert (outcome.task, outcome.seed, outcome.instruction) == (TASK, 3, "put the carrot on the plate")
    assert outcome.result.verdict is RunVerdict.ACHIEVED
    assert outcome.achieved is True
    assert outcome.result.instruction == outcome.instruction
    assert outcome.result.subtasks[-1].outcome.completed


def test_the_first_event_starts_the_run_and_the_last_one_ends_it(outcome: RunOutcome, listener: Listener) -> None:
    kinds = [kind for kind, _ in listener.heard]
    assert (kinds[0], kinds[-1]) == ("run_started", "run_finished")
    assert listener.heard[0][1] == {
        "instruction": outcome.instruction, "task": TASK, "seed": 3, "agents": "rules",
    }  # fmt: skip
    assert listener.heard[-1][1]["achieved"] is True
    assert set(kinds) >= {"observed", "described", "reasoned", "located", "planned", "move", "executed"}
    assert listener.frames > 50


def test_the_same_seed_gives_the_same_run(outcome: RunOutcome, listener: Listener) -> None:
    again = Listener()
    second = run(task=TASK, seed=3, observers=[again])
    assert again.heard == listener.heard
    assert second.out is None


def test_the_folder_tells_the_whole_run(outcome: RunOutcome, listener: Listener) -> None:
    assert outcome.out is not None
    lines = read_lines(outcome.out / "events.jsonl")
    assert [line["kind"] for line in lines] == [kind for kind, _ in listener.heard]
    named = [Path(name) for line in lines for name in line.get("files", {}).values()]
    assert named
    for name in [*named, *map(Path, ("video.mp4", "report.html", "summary.json"))]:
        assert (outcome.out / name).stat().st_size > 100
    summary = json.loads((outcome.out / "summary.json").read_text())
    assert (summary["verdict"], summary["achieved"], summary["instruction"]) == (
        "achieved", True, outcome.instruction,
    )  # fmt: skip


def test_a_task_judges_by_its_own_goal_and_a_scene_without_one_by_none(tmp_path: Path) -> None:
    scene = tmp_path / "scene.yaml"
    scene.write_text("objects: [{name: egg, kind: egg}, {name: corn, kind: corn}]")
    nobody_knows = run("pick up the banana", scene=scene)
    assert (nobody_knows.task, nobody_knows.achieved, nobody_knows.out) == (None, None, None)
    elsewhere = run("pick up the banana", task=TASK)
    assert elsewhere.achieved is False
