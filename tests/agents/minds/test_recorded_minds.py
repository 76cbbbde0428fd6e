"""What a strong mind answered, played again: eight tasks, each answer given by someone who saw requests alone.

The answers in `recorded/` came through an OpenAI-compatible relay, by answerers who were shown prompts, pictures and
schemas and nothing of the truth (November 2026; 16 runs, all achieved). They are served role by role, in their order,
to the agents of today: pictures, segments, numbers on pictures, grasps, binding and motion are real.
"""

import json
from pathlib import Path
from typing import Any

import pytest

from maniagent.agents.minds import minds_agents
from maniagent.app import run
from maniagent.perception.detectors.registry import make_detector
from maniagent.testing import ScriptedModel
from maniagent.types import RunVerdict

RECORDED = sorted((Path(__file__).parent / "recorded").glob("*.json"))
PLAYED = {"drag-plate-0", "hungry-0", "lay-the-table-0", "menemen-0", "middle-pepper-1", "write-1"}
"""Of each kind one: the whole set takes minutes."""


def recorded(path: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return found


@pytest.mark.slow
@pytest.mark.parametrize("path", [path for path in RECORDED if path.stem in PLAYED], ids=lambda path: path.stem)
def test_what_a_strong_mind_answered_still_solves_the_task(path: Path) -> None:
    exchange = recorded(path)
    model = ScriptedModel(exchange["answers"])
    outcome = run(
        task=exchange["task"],
        seed=exchange["seed"],
        agents=lambda rig: minds_agents(rig, model, model, make_detector("marks", model)),
    )
    assert outcome.instruction == exchange["instruction"]
    assert outcome.result.verdict is RunVerdict.ACHIEVED, outcome.result.reason
    assert outcome.achieved, outcome.result.reason
    assert model.refusals == []
    assert len(model.asked) == sum(map(len, exchange["answers"].values())), "no more and no fewer questions than then"


def test_all_eight_tasks_are_recorded() -> None:
    exchanges = [recorded(path) for path in RECORDED]
    assert len({exchange["task"] for exchange in exchanges}) == 8
    assert all(set(exchange["answers"]) == {"scene", "reasoning", "objects", "controller"} for exchange in exchanges)
