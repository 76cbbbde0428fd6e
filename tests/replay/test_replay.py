"""Replays of scripted runs: the same where nothing changed, the first difference where something did."""

import contextlib
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from recorded import AGAIN, CANNOT, DONE, HIGHER, PEPPER, PLATE, SCENARIOS, TRY, Scenario, record

from maniagent.agents.cache import ActionCache, CacheStore
from maniagent.agents.protocols import Located
from maniagent.agents.rules import rules_agents
from maniagent.errors import UsageError
from maniagent.replay.play import replay

ONCE = SCENARIOS["at once"]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    record(tmp_path / "run", ONCE)
    return tmp_path / "run"


def lines_of(folder: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in (folder / "events.jsonl").read_text().splitlines()]


def rewrite(folder: Path, lines: list[dict[str, Any]]) -> None:
    (folder / "events.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))


# The same ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("scenario", SCENARIOS.values(), ids=SCENARIOS)
def test_a_run_replays_to_the_same_decisions(tmp_path: Path, scenario: Scenario) -> None:
    result = record(tmp_path, scenario)
    found = replay(tmp_path, scenario.agents)
    assert found.difference is None
    assert found.complete
    assert found.turns == len({line["turn"] for line in lines_of(tmp_path) if line.get("turn")})
    assert found.decisions >= len(result.subtasks)


@pytest.mark.parametrize("scenario", SCENARIOS.values(), ids=SCENARIOS)
def test_wherever_a_run_was_cut_short_what_is_there_is_replayed(tmp_path: Path, scenario: Scenario) -> None:
    record(tmp_path, scenario)
    lines = lines_of(tmp_path)
    for count in range(2, len(lines)):
        rewrite(tmp_path, lines[:count])
        with (tmp_path / "events.jsonl").open("a") as log:
            log.write('{"kind": "obs')  # the line that the kill cut
        found = replay(tmp_path, scenario.agents)
        assert found.difference is None, f"{count} lines: {found.difference}"
        assert not found.complete


def test_a_run_that_was_stopped_by_hand_is_replayed_as_far_as_it_came(folder: Path) -> None:
    *lines, finish = lines_of(folder)
    finish["result"]["verdict"] = "aborted"
    rewrite(folder, [*lines[:6], finish])
    found = replay(folder, ONCE.agents)
    assert (found.same, found.complete) == (True, False)


def test_a_run_that_the_clock_ended_is_the_same_as_far_as_it_came(tmp_path: Path) -> None:
    scenario = Scenario([TRY, AGAIN, DONE])
    record(tmp_path, scenario)
    lines = lines_of(tmp_path)
    last_look = max(i for i, line in enumerate(lines) if line["kind"] == "observed")
    lines[-1]["result"] |= {"verdict": "out_of_budget", "reason": "The run took longer than its 900 s."}
    rewrite(tmp_path, [*lines[:last_look], *lines[-2:]])
    found = replay(tmp_path, scenario.agents)
    assert (found.same, found.complete, found.turns) == (True, True, 2)


def test_what_the_cache_served_is_served_again_without_the_cache(tmp_path: Path) -> None:
    path = tmp_path / "cache.sqlite"
    for name in ("first", "second"):
        record(tmp_path / name, ONCE, ActionCache(CacheStore(path)))
    path.unlink()
    forgetful = replace(ONCE, sequences=[HIGHER])
    assert replay(tmp_path / "second", forgetful.agents).same
    different = replay(tmp_path / "first", forgetful.agents).difference
    assert different is not None
    assert (different.kind, different.where) == ("planned", "sequence.skill")


# Different --------------------------------------------------------------------------------------------------------

moved = replace(PEPPER, centre=PEPPER.centre + np.array([0, 1e-16, 0]))


@pytest.mark.parametrize(
    ("scenario", "turn", "where"),
    [
        (replace(ONCE, subtasks=[TRY.model_copy(update={"text": "drop it"}), DONE]), 1, "reasoned subtask.text"),
        (replace(ONCE, subtasks=[TRY, AGAIN, DONE]), 2, "reasoned subtask.previous"),
        (replace(ONCE, subtasks=[TRY, CANNOT]), 2, "reasoned subtask.previous"),
        (replace(ONCE, subtasks=[CANNOT]), 1, "reasoned subtask.previous"),
        (replace(ONCE, sequences=[HIGHER]), 1, "planned sequence.skill"),
        (replace(ONCE, located=[Located((moved, PLATE), ())]), 1, "located objects[0].centre[1]"),
        (replace(ONCE, located=[Located((PEPPER,), ())]), 1, "located objects"),
    ],
)
def test_the_first_difference_is_told(folder: Path, scenario: Scenario, turn: int, where: str) -> None:
    found = replay(folder, scenario.agents).difference
    assert found is not None
    assert found.turn == turn
    assert f"{found.kind} {found.where}" == where


def test_a_key_point_that_differs_in_its_last_bit_is_different(folder: Path) -> None:
    lines = lines_of(folder)
    (planned,) = (line for line in lines if line["kind"] == "planned")
    x = planned["keypoints"][0]["T_base_tcp"][0][3]
    planned["keypoints"][0]["T_base_tcp"][0][3] = x + 2**-53
    rewrite(folder, lines)
    found = replay(folder, ONCE.agents).difference
    assert found is not None
    assert (found.where, found.replayed) == ("keypoints[0].T_base_tcp[0][3]", x)


def test_agents_that_want_more_than_the_recorded_ones_are_different(folder: Path) -> None:
    lines = lines_of(folder)
    last_look = max(i for i, line in enumerate(lines) if line["kind"] == "observed")
    rewrite(folder, [*lines[:last_look], lines[-1]])
    found = replay(folder, ONCE.agents).difference
    assert found is not None
    assert found.kind == "the robot"


def test_another_verdict_is_a_difference(folder: Path) -> None:
    *lines, finish = lines_of(folder)
    finish["result"]["verdict"] = "cannot"
    rewrite(folder, [*lines, finish])
    found = replay(folder, ONCE.agents).difference
    assert found is not None
    assert (found.recorded, found.replayed) == ("cannot: it is there", "achieved: it is there")


# Of no use --------------------------------------------------------------------------------------------------------


def test_only_the_rules_can_be_made_from_their_name(folder: Path) -> None:
    with pytest.raises(UsageError, match="'scripted'; only those that maniagent brings"):
        replay(folder)


def change(of: str, /, **changes: Any) -> Callable[[list[dict[str, Any]]], None]:
    def edit(lines: list[dict[str, Any]]) -> None:
        next(line for line in lines if line["kind"] == of).update(changes)

    return edit


@pytest.mark.parametrize(
    "edit",
    [
        lambda lines: lines.clear(),
        lambda lines: lines.pop(0),
        lambda lines: lines.pop(1),
        change("begun", rig="no rig"),
        change("begun", budget={"turns": "many"}),
        change("begun", kind="over"),
        change("observed", turn="first"),
        change("run_finished", result=None),
        change("run_finished", result={"verdict": "perhaps"}),
        change("executed", report={"completed": "perhaps"}),
        change("homed", report=7),
        change("checked", kind="cache", found="text", sequence={"skill": "none"}),
    ],
)
def test_a_log_that_is_damaged_is_one_clear_error(folder: Path, edit: Callable[[list[Any]], object]) -> None:
    lines = lines_of(folder)
    edit(lines)
    rewrite(folder, lines)
    with pytest.raises(UsageError):
        replay(folder, ONCE.agents)


@pytest.mark.parametrize("name", ["written anew", "blind once"])
def test_whatever_is_missing_in_a_log_a_replay_ends_in_a_result_or_one_clear_error(tmp_path: Path, name: str) -> None:
    record(tmp_path, SCENARIOS[name])
    lines = lines_of(tmp_path)
    first = {(line["kind"], key): number for number, line in reversed(list(enumerate(lines))) for key in line}
    for (_, key), number in first.items():
        without = {other: value for other, value in lines[number].items() if other != key}
        rewrite(tmp_path, [*lines[:number], without, *lines[number + 1 :]])
        with contextlib.suppress(UsageError):
            replay(tmp_path, SCENARIOS[name].agents)


def test_a_look_that_is_gone_is_told(folder: Path) -> None:
    (folder / "observations" / "turn-02.npz").unlink()
    with pytest.raises(UsageError, match=r"turn-02\.npz"):
        replay(folder, ONCE.agents)


def test_no_folder_is_no_run(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no run folder"):
        replay(tmp_path / "nowhere", rules_agents)
