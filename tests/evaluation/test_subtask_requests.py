"""`benchmarks/subtask_requests.py`: real scenes, agents, loop and gate; a server that answers as it is told."""

import json
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from maniagent.agents.minds import Prompts
from maniagent.agents.rules.language import parse_instruction
from maniagent.envs.scene import Scene
from maniagent.errors import ModelFailure
from maniagent.geometry import make_transform, top_down_rotation
from maniagent.perception.lexicon import Lexicon
from maniagent.perception.sight import Sight
from maniagent.perception.viewpoint import Viewpoint
from maniagent.tasks import get
from maniagent.testing import ScriptedModel
from maniagent.types import ActionSequence, Gripper, KeyPoint
from models.fake_server import Asked, FakeServer, Raw, fails, says, serving

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
sys.path.insert(0, str(BENCHMARKS))

from requesting.cases import CASES, Request, requests  # noqa: E402 - the benchmarks are no package
from requesting.results import Line, ResultsFile  # noqa: E402
from requesting.runner import Settings, run  # noqa: E402
from requesting.table import laid  # noqa: E402
from requesting.watch import Door, WatchedEnv, point_faults, sequence_faults  # noqa: E402

ACTS = {
    "evidence": "The red pepper lies on the table.",
    "previous": "none",
    "remaining": "The red pepper is not on the plate.",
    "next": "act",
    "subtask": "put the red pepper on the plate",
    "objects": ["red pepper", "plate"],
}
INVENTS = ACTS | {"objects": ["red pepper", "golden tray"]}
PLACES: dict[str, Any] = {
    "skill": "pick-and-place",
    "steps": [
        {"do": "above it, open", "to": "grasp", "object": 0, "up": 0.1, "gripper": "open"},
        {"do": "take it", "to": "grasp", "object": 0, "gripper": "close"},
        {"do": "lift", "to": "here", "up": 0.1},
        {"do": "over the plate", "to": "surface", "object": 1, "up": 0.1},
        {"do": "lower, let go", "to": "surface", "object": 1, "up": 0.006, "gripper": "open"},
        {"do": "leave upwards", "to": "here", "up": 0.1},
    ],
}
FAR_OFF = PLACES | {"steps": [*PLACES["steps"][:5], {"do": "leave", "to": "here", "up": 0.9}]}
UNKNOWN = PLACES | {"steps": [*PLACES["steps"][:3], {"do": "over it", "to": "surface", "object": 7}]}


@contextmanager
def answering(thoughts: list[Any], movements: list[Any]) -> Iterator[FakeServer]:
    """A server that gives each role its answers in turn, the last one for ever."""
    left = {"Thought": list(thoughts), "Written": list(movements)}

    def script(asked: Asked) -> Raw:
        answers = left[asked.body["response_format"]["json_schema"]["name"]]
        answer = answers.pop(0) if len(answers) > 1 else answers[0]
        return says(json.dumps(answer))(asked)

    with serving(script) as server:
        yield server


def settings(server: FakeServer, out: Path, **more: Any) -> Settings:
    return Settings(**{"llm": f"openai-compatible:fake@{server.url}/v1", "out": out, "count": 1} | more)


def lines(out: Path) -> list[Line]:
    return [Line.model_validate_json(text) for text in (out / "requests.jsonl").read_text().splitlines()]


# What is counted --------------------------------------------------------------------------------------------------


def test_good_answers_count_as_such_and_are_carried_out(tmp_path: Path) -> None:
    with answering([ACTS], [PLACES]) as server:
        page = run(settings(server, tmp_path))
    reasoning, controller = lines(tmp_path)
    assert (reasoning.fits_first, reasoning.next, reasoning.right) == (True, "act", True)
    assert (controller.source, controller.fits_first, controller.sequences) == ("model", True, 1)
    assert (controller.passes_first, controller.passes, controller.rules_pass) == (True, True, True)
    assert (controller.executed, controller.completed, controller.malformed) == (True, True, ())
    assert (controller.calls, controller.tokens_in, controller.tokens_out) == (1, 100, 20)
    assert page == (tmp_path / "requests.md").read_text(encoding="utf-8")


def test_where_the_reasoning_fails_the_controller_is_asked_about_the_rule_made_sub_task(tmp_path: Path) -> None:
    with answering([INVENTS], [PLACES]) as server:
        run(settings(server, tmp_path))
    reasoning, controller = lines(tmp_path)
    assert (reasoning.fits_first, reasoning.fits, reasoning.unfit, reasoning.stage) == (False, False, 3, "format")
    assert "golden tray" in reasoning.complaint
    assert (controller.source, controller.instead, controller.passes) == ("rules", "no answer fitted", True)


def test_an_answer_that_is_repaired_counts_as_repaired(tmp_path: Path) -> None:
    with answering([INVENTS, ACTS], [UNKNOWN, PLACES]) as server:
        run(settings(server, tmp_path))
    for line in lines(tmp_path):
        assert (line.fits_first, line.fits, line.unfit, line.calls) == (False, True, 1, 2)


def test_a_request_that_fails_after_measurements_fits_neither_at_first_nor_later(tmp_path: Path) -> None:
    with answering([ACTS | {"next": "measure"}, INVENTS], [PLACES]) as server:
        run(settings(server, tmp_path, limit=1))
    (reasoning,) = lines(tmp_path)
    assert (reasoning.fits_first, reasoning.fits, reasoning.unfit, reasoning.calls) == (False, False, 3, 4)


def test_a_sequence_that_the_gate_refuses_goes_back_and_is_no_first_pass(tmp_path: Path) -> None:
    with answering([ACTS], [FAR_OFF, PLACES]) as server:
        run(settings(server, tmp_path))
    controller = lines(tmp_path)[1]
    assert (controller.fits_first, controller.passes_first, controller.sequences) == (True, False, 2)
    assert (controller.passes, controller.completed, controller.malformed) == (True, True, ())


@pytest.mark.parametrize("movement", [UNKNOWN, FAR_OFF, {"skill": "none"}])
def test_what_never_passes_never_reaches_the_robot(movement: dict[str, Any], tmp_path: Path) -> None:
    with answering([ACTS], [movement]) as server:
        run(settings(server, tmp_path))
    controller = lines(tmp_path)[1]
    assert (controller.passes, controller.executed, controller.malformed) == (False, False, ())
    assert controller.stage in ("format", "planning")


def test_asked_again_only_what_is_open_is_asked(tmp_path: Path) -> None:
    with answering([ACTS], [PLACES]) as server:
        run(settings(server, tmp_path, limit=1))
        assert [line.role for line in lines(tmp_path)] == ["reasoning"]
        run(settings(server, tmp_path))
        run(settings(server, tmp_path))
    assert [line.role for line in lines(tmp_path)] == ["reasoning", "controller"]
    assert len(server.asked) == 2


def test_a_model_that_is_gone_is_no_wrong_answer(tmp_path: Path) -> None:
    with serving(fails(401)) as server, pytest.raises(ModelFailure):
        run(settings(server, tmp_path, count=3))
    assert lines(tmp_path) == []


def test_a_line_that_a_crash_cut_short_is_asked_again(tmp_path: Path) -> None:
    with answering([ACTS], [PLACES]) as server:
        run(settings(server, tmp_path))
        kept = (tmp_path / "requests.jsonl").read_text()
        (tmp_path / "requests.jsonl").write_text(kept[:-20])
        again = ResultsFile(tmp_path)
        assert [again.get(json.loads(text)["key"]) is not None for text in kept.splitlines()] == [True, False]
        run(settings(server, tmp_path))
    assert len(server.asked) == 3
    assert ResultsFile(tmp_path).get(json.loads(kept.splitlines()[1])["key"]) is not None


# What is asked ----------------------------------------------------------------------------------------------------


def test_every_kind_of_sub_task_is_asked_for_in_words_that_the_rules_know() -> None:
    assert {case.kind for case in CASES} == {
        "on", "into", "stack", "beside", "drag to", "drag by", "rotate", "alikes",
    }  # fmt: skip
    for case in CASES:
        get(case.task)
        for command in case.commands:
            assert len(parse_instruction(command.replace("{goal}", "(0.3, 0.1)"))) == 1


def test_requests_share_no_scene() -> None:
    assert [request.number for request in requests(45)] == list(range(45))
    assert [request.case for request in requests(45)][20:40] == list(CASES)


def test_look_alikes_have_names_of_their_own_that_mean_them() -> None:
    case = next(case for case in CASES if case.task == "middle-pepper")
    with laid(Request(3, case), ScriptedModel({}), Prompts.load()) as table:
        names, view = table.scene.names, Sight(table.door.rig).look(table.observation)
        assert len(set(names)) == len(names) == 4
        viewpoint, lexicon = Viewpoint.of(table.observation), Lexicon.load()
        assert [lexicon.ground(name, view.segments, viewpoint) for name in names] == list(range(4))


# The watch --------------------------------------------------------------------------------------------------------


@pytest.fixture
def env() -> Iterator[WatchedEnv]:
    env = WatchedEnv(Scene.model_validate({"objects": [{"name": "egg", "kind": "egg"}]}))
    env.reset(seed=0)
    yield env
    env.close()


def test_the_servos_watch_sees_jumps_limits_and_what_is_no_number(env: WatchedEnv) -> None:
    assert env.faults == []
    env.advance(env.home + np.eye(6)[0] * 0.5, 0.05)
    env.advance(env.home + np.eye(6)[0] * 9.0, 0.05)
    env.advance(env.home, float("nan"))
    assert ["jump" in env.faults[0], "limits" in env.faults[1], "nan" in env.faults[2]] == [True] * 3


def test_the_servos_watch_sees_the_arm_leave_the_workspace(env: WatchedEnv) -> None:
    way = np.linspace(env.home, [1.5, 0.0, 0.0, 0.0, 0.0, 0.0], 400)
    for posture in way:
        env.advance(posture, 0.05)
    assert any("outside the workspace" in fault for fault in env.faults)


def test_the_door_sees_what_was_not_accepted(env: WatchedEnv) -> None:
    door = Door(env)
    report = door.execute([KeyPoint(np.eye(4), Gripper.KEEP, "into the base")], {})
    assert not report.completed
    assert door.faults == [
        "door: key points that the gate didn't accept last",
        "door: key point 1 is outside the workspace",
    ]


def test_key_points_are_judged_by_their_numbers() -> None:
    good = KeyPoint(make_transform(top_down_rotation(0.0), [0.3, 0.0, 0.1]), Gripper.OPEN, "above", opening=0.05)
    assert point_faults(1, good) == []
    mirrored = good.T_base_tcp @ np.diag([1.0, 1.0, -1.0, 1.0])
    assert len(point_faults(1, replace(good, T_base_tcp=mirrored))) == 1
    assert len(point_faults(1, replace(good, T_base_tcp=np.full((4, 4), np.nan)))) == 1
    assert len(point_faults(1, replace(good, opening=0.3))) == 1


def test_sequences_are_judged_by_their_json() -> None:
    step: dict[str, Any] = {"description": "go", "anchor": {"index": 1, "part": "surface"}}
    sequence = ActionSequence.model_validate({"skill": "go", "steps": [step]})
    assert sequence_faults(sequence, objects=2) == []
    assert sequence_faults(sequence, objects=1) == ["sequence: step 1 speaks of object 1"]
    far = sequence.steps[0].model_copy(update={"offset": (0.0, 0.0, 1e9)})
    assert len(sequence_faults(sequence.model_copy(update={"steps": (far,)}), objects=2)) == 1


def test_without_a_model_it_says_what_it_needs() -> None:
    script = str(BENCHMARKS / "subtask_requests.py")
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, check=False, timeout=60)
    assert (done.returncode, done.stderr) == (0, "")
    assert "--llm" in done.stdout
