"""Runs on language models replay with the recorded answers in the models' place."""

import json
from pathlib import Path

import pytest

from maniagent.app import run
from maniagent.crew import ModelCrew
from maniagent.replay.play import replay
from models.fake_server import says, serving


@pytest.mark.slow
def test_recorded_answers_stand_in_for_the_models(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    scene = {"objects": [{"name": "marker", "state": "on the table"}], "summary": "Nothing to eat."}
    give_up = {"evidence": "", "previous": "none", "remaining": "There is nothing to eat.", "next": "cannot"}
    with serving(says(json.dumps(scene)), says(json.dumps(give_up))) as server:
        run(task="hungry", crew=ModelCrew(vlm="vllm:a", llm="vllm:b", base_url=f"{server.url}/v1"), out=folder)

    found = replay(folder)
    assert (found.same, found.complete, found.turns, found.decisions) == (True, True, 1, 2)
    recorded = (folder / "exchanges.jsonl").read_text()
    (folder / "exchanges.jsonl").write_text(recorded.replace("There is nothing to eat.", "I give up."))
    different = replay(folder).difference
    assert different is not None
    assert (different.kind, different.where) == ("reasoned", "subtask.reason")
