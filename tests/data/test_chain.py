"""The chain of one demonstration: when a start counts, when a person is needed, and what an episode is called."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import pytest
from paper_table import SLIPPED, WENT, Table

from maniagent.data.chain import DOUBT, Chain, ChainSettings, Stuck
from maniagent.data.moves import moves_of
from maniagent.data.outcome import THRESHOLD
from maniagent.data.starts import Start
from maniagent.envs.tabletop import TabletopEnv
from maniagent.errors import CameraFailure
from maniagent.robots.sampling import Sampling
from maniagent.robots.simulated import SimulatedRobot
from maniagent.tasks import task_named
from maniagent.types import KeyPoint

START = Start(0, (0.25, 0.05), 0.3)
SMALL = Sampling(width=64, height=48)
EGG, PEPPER = (0.20, 0.15), (0.35, 0.15)
BOTH = "put the egg on the plate, then put the pepper left of the plate"


@pytest.fixture
def table(monkeypatch: pytest.MonkeyPatch) -> Table:
    table = Table(egg=EGG, pepper=PEPPER, plate=(0.30, -0.10))
    monkeypatch.setattr("maniagent.data.moves.rules_agents", table.eyes)
    return table


def chain(table: Table, do: str = "put the egg on the plate", **settings: Any) -> Chain:
    return Chain(table, moves_of(do), SMALL, ChainSettings(**settings))


# Bringing the object to its start -------------------------------------------------------------------------------


def test_the_object_is_brought_to_its_start(table: Table) -> None:
    assert chain(table).bring(START) == ""
    assert table.at("egg") == START.xy


def test_a_start_that_is_refused_is_no_reason_to_call_a_person(table: Table) -> None:
    table.refuse = lambda keypoints: "It is out of reach."
    assert "out of reach" in chain(table).bring(START)
    assert table.at("egg") == EGG
    assert not any(text.startswith("drag") for text in table.tried)


def test_what_can_not_be_lifted_is_pulled_and_then_brought(table: Table) -> None:
    table.flat = {"egg"}
    assert chain(table).bring(START) == ""
    assert [text.split()[0] for text in table.tried] == ["put", "put", "put", "drag", "put"]
    assert table.at("egg") == START.xy


def test_what_is_away_takes_a_person_after_it_was_sought_to_pull(table: Table) -> None:
    table.hidden = {"egg"}
    with pytest.raises(Stuck, match=r"The egg can't be brought to its next start: .*No egg is in view"):
        chain(table).bring(START)
    assert table.tried[-1] == "drag the egg to (0.25, 0.05)"


# What an episode is called --------------------------------------------------------------------------------------


def test_an_object_in_its_place_is_a_valid_episode(table: Table) -> None:
    attempt = chain(table).perform(seed=7)
    assert (attempt.label, attempt.reason, attempt.began) == ("valid", "", EGG)
    assert attempt.distance == pytest.approx(0.0, abs=1e-9)
    assert attempt.recording is not None
    assert set(attempt.recording.steps.subtasks) == {"put the egg on the plate"}
    assert table.listener is None


@pytest.mark.parametrize(
    ("off", "label"),
    [
        (THRESHOLD - DOUBT - 1e-6, "valid"),
        (THRESHOLD - DOUBT + 1e-6, "doubtful"),
        (THRESHOLD, "doubtful"),
        (THRESHOLD + DOUBT - 1e-6, "doubtful"),
        (THRESHOLD + DOUBT + 1e-6, "failed"),
    ],
)
def test_near_the_threshold_the_look_does_not_decide(table: Table, off: float, label: str) -> None:
    table.off = off
    attempt = chain(table).perform(seed=0)
    assert (attempt.label, attempt.distance) == (label, pytest.approx(off))
    assert attempt.recording is not None
    assert bool(attempt.reason) == (label != "valid")


def vanish(table: Table) -> None:
    table.hidden = {"egg"}


def test_an_object_that_is_not_seen_any_more_is_doubtful(table: Table) -> None:
    table.while_moving = vanish
    attempt = chain(table).perform(seed=0)
    assert (attempt.label, attempt.distance) == ("doubtful", None)
    assert "isn't seen any more" in attempt.reason


def test_one_that_was_lost_on_the_way_is_not_doubtful(table: Table) -> None:
    table.while_moving, table.report = vanish, SLIPPED
    attempt = chain(table).perform(seed=0)
    assert (attempt.label, attempt.distance) == ("failed", None)
    assert "It slipped." in attempt.reason


def test_where_nothing_moves_there_is_no_episode(table: Table) -> None:
    table.hidden = {"plate"}
    attempt = chain(table).perform(seed=0)
    assert (attempt.label, attempt.recording, attempt.began) == ("failed", None, None)
    assert "No plate is in view" in attempt.reason


def test_an_episode_is_as_good_as_the_worst_of_its_moves(table: Table) -> None:
    offs = iter([0.001, 0.02])
    table.while_moving = lambda table: setattr(table, "off", next(offs))
    attempt = chain(table, BOTH).perform(seed=0)
    assert (attempt.label, attempt.distance) == ("valid", pytest.approx(0.02))


# Recording ------------------------------------------------------------------------------------------------------


def test_a_camera_that_fails_makes_the_episode_a_failed_one(table: Table) -> None:
    def fail(table: Table) -> None:
        assert table.listener is not None
        table.listener.on_camera_failure(CameraFailure("The side camera doesn't answer."))

    table.while_moving = fail
    attempt = chain(table).perform(seed=0)
    assert (attempt.label, attempt.recording) == ("failed", None)
    assert attempt.reason == "The side camera doesn't answer."
    assert attempt.began == EGG
    assert table.listener is None
    table.while_moving = lambda table: None
    assert chain(table).perform(seed=0).label == "valid"


@pytest.mark.parametrize("error", [KeyboardInterrupt(), MemoryError()])
def test_whatever_stops_the_task_ends_its_recording(table: Table, error: BaseException) -> None:
    def stop(table: Table) -> None:
        raise error

    table.while_moving = stop
    with pytest.raises(type(error)):
        chain(table).perform(seed=0)
    assert table.listener is None
    assert table.calls[-1] == "stop"


def test_rows_may_tell_of_single_moves(table: Table) -> None:
    recording = chain(table, by_move=True).perform(seed=0).recording
    assert recording is not None
    assert {"Go down and take the egg", "Lower it and let go"} < set(recording.steps.subtasks)


def test_a_long_collection_keeps_nothing_of_what_was_seen(table: Table) -> None:
    again = chain(table)
    listening = len(table._hooks)
    for _ in range(3):
        again.perform(seed=0)
        again.bring(START)
    assert len(table._hooks) == listening


# Several objects ------------------------------------------------------------------------------------------------


def test_all_that_the_task_moved_goes_back_what_was_moved_last_first(table: Table) -> None:
    both = chain(table, BOTH)
    assert both.perform(seed=0).label == "valid"
    assert table.at("pepper") != PEPPER
    table.tried.clear()
    assert both.bring(START) == ""
    assert [text[:14] for text in table.tried] == ["put the pepper", "put the egg at"]
    assert table.at("pepper") == pytest.approx(PEPPER, abs=1e-3)
    assert table.at("egg") == START.xy


def test_the_same_words_may_stand_for_two_moves(table: Table) -> None:
    there, back = (moves_of(f"put the egg at {place}")[0] for place in ("(0.30, 0.00)", "(0.20, 0.00)"))
    same = back.model_copy(update={"text": there.text})
    assert Chain(table, [there, same], SMALL).perform(seed=0).label == "valid"
    assert table.at("egg") == (0.2, 0.0)


def test_where_things_began_is_not_forgotten_from_one_episode_to_the_next(table: Table) -> None:
    both = chain(table, BOTH)
    table.off = 0.01
    for _ in range(4):
        assert both.perform(seed=0).label == "valid"
        both.bring(START)
    x, y = table.at("pepper")
    assert np.hypot(x - PEPPER[0], y - PEPPER[1]) < 0.011


def test_what_was_not_moved_stays(table: Table) -> None:
    both = chain(table, BOTH)
    table.report = SLIPPED  # of the egg, so that the pepper's turn doesn't come
    assert both.perform(seed=0).label == "failed"
    table.report = WENT
    table.tried.clear()
    both.bring(START)
    assert all("egg" in text for text in table.tried)


def test_what_is_in_the_way_home_goes_first(table: Table) -> None:
    both = chain(table, BOTH)
    both.perform(seed=0)
    table.put("egg", PEPPER)  # as though it had rolled to where the pepper has to go
    table.refuse = lambda keypoints: "It would hit the egg." if blocked(table, keypoints) else ""
    table.tried.clear()
    assert both.bring(START) == ""
    assert [text.split()[2] for text in table.tried] == ["pepper", "pepper", "pepper", "egg", "pepper"]
    assert table.at("pepper") == pytest.approx(PEPPER, abs=1e-3)
    assert table.at("egg") == START.xy


def blocked(table: Table, keypoints: Sequence[KeyPoint]) -> bool:
    """Whether something else lies where an object is to be let go."""
    place = [point.T_base_tcp[:2, 3] for point in keypoints if point.held is not None][-1]
    held = table.sought
    return any(np.hypot(*(thing.centre[:2] - place)) < 0.05 for name, thing in table.things.items() if name != held)


def test_what_can_not_be_brought_back_takes_a_person_who_puts_all_of_it_back(table: Table) -> None:
    both = chain(table, BOTH)
    both.perform(seed=0)
    table.hidden = {"pepper"}
    with pytest.raises(Stuck, match=r"The pepper can't be brought back to where it began, \(0\.35, 0\.15\)"):
        both.bring(START)
    table.tried.clear()
    assert both.bring(START) == ""
    assert not any("pepper" in text for text in table.tried)


# The twin -------------------------------------------------------------------------------------------------------


@pytest.fixture
def env() -> Iterator[TabletopEnv]:
    env = TabletopEnv(task_named("carrot-on-plate").scene)
    env.reset(seed=3)
    yield env
    env.close()


@pytest.mark.slow
def test_the_twin_s_robot_brings_and_performs(env: TabletopEnv) -> None:
    real = Chain(SimulatedRobot(env), moves_of("put the carrot on the plate"), SMALL)
    start = Start(0, (0.22, 0.12), 0.5)
    assert real.bring(start) == ""
    brought = env.truth()["carrot"].T_base_object[:2, 3]
    assert np.linalg.norm(brought - start.xy) < THRESHOLD
    attempt = real.perform(seed=0)
    assert attempt.label == "valid"
    assert attempt.began == pytest.approx(brought, abs=0.01)
    assert attempt.recording is not None
    assert attempt.recording.rgb["main"].shape[1:] == (48, 64, 3)


@pytest.mark.slow
def test_a_carrot_out_of_the_twin_s_reach_takes_a_person(env: TabletopEnv) -> None:
    env.put("carrot", (0.55, 0.30), 0.0)
    real = Chain(SimulatedRobot(env), moves_of("put the carrot on the plate"), SMALL)
    with pytest.raises(Stuck, match="The carrot can't be brought to its next start"):
        real.bring(Start(0, (0.22, 0.12), 0.5))
