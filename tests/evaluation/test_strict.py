"""Success by several measures, on histories made for it."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maniagent.envs.simpler import HORIZON, TrueStep
from maniagent.evaluation.strict import LAST_SECOND, criteria, ever, last, strict
from maniagent.geometry import make_transform, rotation_z

BUDGET = 60
AWAY = TrueStep(on_target=False, touched=False, T_world_object=make_transform(np.eye(3), [0.3, 0.0, 0.0]))
THERE = TrueStep(on_target=True, touched=False, T_world_object=np.eye(4))
HELD = replace(THERE, touched=True)


def history(*parts: tuple[TrueStep, int]) -> list[TrueStep]:
    """So many steps of each, the last one to the end."""
    steps = [step for step, count in parts for _ in range(count)]
    return (steps + [parts[-1][0]] * HORIZON)[:HORIZON]


def moved(millimetres: float = 0.0, degrees: float = 0.0) -> TrueStep:
    return replace(
        THERE, T_world_object=make_transform(rotation_z(np.radians(degrees)), [millimetres / 1000, 0.0, 0.0])
    )


def test_an_object_that_lies_there_from_early_on_is_a_success_by_all_measures() -> None:
    told = history((AWAY, 40), (THERE, 80))
    assert last(told, BUDGET)
    assert all(criteria(told, BUDGET).values())


def test_one_that_is_still_held_is_a_success_that_is_not_strict() -> None:
    told = history((AWAY, 40), (HELD, 80))
    assert last(told, BUDGET)
    assert ever(told, BUDGET)
    assert not strict(told, BUDGET)
    assert not strict(told, HORIZON)


def test_one_that_arrives_late_counts_at_the_end_alone() -> None:
    told = criteria(history((AWAY, BUDGET), (THERE, 60)), BUDGET)
    assert told == {"any": False, "strict": False, "at 120": True, "any at 120": True, "strict at 120": True}


def test_one_that_falls_off_again_was_there_at_some_step() -> None:
    told = history((AWAY, 20), (THERE, 20), (AWAY, 80))
    assert not last(told, BUDGET)
    assert ever(told, BUDGET)
    assert not strict(told, BUDGET)


@pytest.mark.parametrize(("let_go", "true"), [(BUDGET - LAST_SECOND, True), (BUDGET - LAST_SECOND + 1, False)])
def test_strict_asks_for_a_whole_second_without_a_touch(let_go: int, true: bool) -> None:
    assert strict(history((AWAY, 30), (HELD, let_go - 30), (THERE, 80)), BUDGET) is true


@pytest.mark.parametrize(("before", "rests"), [(moved(4.0), True), (moved(6.0), False), (moved(0, 4), True),
                                               (moved(0, 6), False)])  # fmt: skip
def test_strict_asks_for_rest(before: TrueStep, rests: bool) -> None:
    steps = history((before, BUDGET - 1), (THERE, 80))
    assert strict(steps, BUDGET) is rests


def drawn(seed: int) -> list[TrueStep]:
    """A history in which things come and go."""
    rng = np.random.default_rng(seed)
    kinds = [AWAY, THERE, THERE, HELD, moved(4.0), moved(8.0)]
    return history(*((kinds[rng.integers(len(kinds))], int(rng.integers(1, 30))) for _ in range(12)))


@given(st.builds(drawn, st.integers(0, 2**32 - 1)), st.sampled_from([60, HORIZON]))
def test_strict_success_is_success_and_success_was_reached_at_some_step(told: list[TrueStep], budget: int) -> None:
    assert last(told, budget) or not strict(told, budget)
    assert ever(told, budget) or not last(told, budget)
    assert ever(told, HORIZON) or not ever(told, budget)


def test_where_the_budget_is_all_steps_both_cuts_say_the_same() -> None:
    told = criteria(history((AWAY, 100), (THERE, 20)), HORIZON)
    assert told["strict"] == told["strict at 120"]
    assert told["any"] == told["any at 120"]
