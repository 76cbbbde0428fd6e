"""What a thing lies on doesn't keep the hand from taking it."""

from __future__ import annotations

import numpy as np
import pytest

from maniagent.agents.supports import allow_supports
from maniagent.app import run
from maniagent.testing import made_object
from maniagent.types import Gripper, KeyPoint

PEPPER = made_object(0, "pepper", (0.30, 0.02), size=(0.08, 0.03, 0.04), yaw=0.5)
PLATE = made_object(1, "plate", (0.30, 0.00), size=(0.18, 0.18, 0.02))
CUP = made_object(2, "cup", (0.30, 0.14), size=(0.07, 0.07, 0.09))


def point(touches: frozenset[int], held: int | None = None) -> KeyPoint:
    return KeyPoint(np.eye(4), Gripper.KEEP, "a move", touches=touches, held=held)


def test_the_empty_hand_may_touch_what_the_thing_it_takes_lies_on_and_nothing_else() -> None:
    approach, carry, elsewhere = allow_supports(
        [point(frozenset({0})), point(frozenset({0}), held=0), point(frozenset({2}))], (PEPPER, PLATE, CUP)
    )
    assert approach.touches == {0, 1}
    assert carry.touches == {0}
    assert elsewhere.touches == {2}


def test_what_lies_in_a_container_may_be_taken_although_the_rim_is_higher_and_not_what_lies_on_what_is_taken() -> None:
    basket = made_object(1, "basket", (0.30, 0.00), size=(0.18, 0.18, 0.10))
    (taken,) = allow_supports([point(frozenset({0}))], (PEPPER, basket))
    assert taken.touches == {0, 1}
    (dragged,) = allow_supports([point(frozenset({1}))], (PEPPER, PLATE))
    assert dragged.touches == {1}


@pytest.mark.slow
def test_what_was_put_on_a_plate_can_be_taken_off_again() -> None:
    outcome = run("put the carrot on the plate, then put the carrot at (0.30, -0.20)", task="carrot-on-plate", seed=1)
    assert outcome.result.verdict == "achieved", outcome.result.reason
