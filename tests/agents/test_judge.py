"""Verdicts on made-up looks: what was moved, from where, and what is seen afterwards."""

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from maniagent.agents.rules.commands import Action, Command, Direction, Relation
from maniagent.agents.rules.judge import judge
from maniagent.testing import made_object
from maniagent.types import ExecutionReport, ObjectInfo, SubtaskRecord, Verdict

RED, GREEN, WHITE = (200, 40, 30), (50, 140, 60), (235, 235, 230)
COMPLETED = ExecutionReport(completed=True, reached=6)
REFUSED = ExecutionReport(completed=False, reached=0, reason="It is out of the workspace.", stage="planning")

PEPPER = made_object(0, "pepper", (0.20, 0.15), colour=RED)
PLATE = replace(
    made_object(1, "plate", (0.30, -0.10), size=(0.20, 0.20, 0.02), colour=WHITE, grasps=0), surface_z=0.008
)
YELLOW = made_object(0, "yellow block", (0.2, 0.1), size=(0.03, 0.03, 0.03), colour=(220, 190, 40))
BLUE = made_object(1, "blue block", (0.3, 0.0), size=(0.055, 0.055, 0.055), colour=(40, 70, 180))


def put(relation: Relation, action: Action = Action.PLACE) -> Command:
    return Command(action=action, object="pepper", relation=relation, target="plate")


def tried(*objects: ObjectInfo, outcome: ExecutionReport = COMPLETED) -> SubtaskRecord:
    return SubtaskRecord("put it there", objects, outcome)


def at(thing: ObjectInfo, x: float, y: float, base_z: float = 0.0, **changes: object) -> ObjectInfo:
    """The same thing seen elsewhere."""
    return replace(thing, centre=[x, y, base_z + thing.extent[2] / 2], surface_z=base_z + thing.extent[2], **changes)


def verdict(command: Command, record: SubtaskRecord, *now: ObjectInfo) -> Verdict:
    return judge(command, record, now)[0]


def test_what_was_never_found_failed_for_the_reason_it_was_not_found() -> None:
    outcome = ExecutionReport(completed=False, reached=0, reason="No pepper is in view.", stage="detection")
    assert judge(put(Relation.ON), tried(outcome=outcome), [PEPPER, PLATE]) == (
        Verdict.FAILURE,
        "No pepper is in view.",
    )


# on and in ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("relation", [Relation.ON, Relation.IN])
@given(st.floats(-0.06, 0.06), st.floats(-0.06, 0.06), st.floats(-math.pi / 2, math.pi / 2))
def test_a_thing_over_the_targets_middle_is_on_it(relation: Relation, dx: float, dy: float, yaw: float) -> None:
    seen = at(PEPPER, 0.30 + dx, -0.10 + dy, 0.008, yaw=yaw)
    assert verdict(put(relation), tried(PEPPER, PLATE), PLATE, seen) is Verdict.SUCCESS


def test_the_target_may_have_been_pushed_along() -> None:
    assert verdict(
        put(Relation.ON), tried(PEPPER, PLATE), at(PLATE, 0.33, -0.05), at(PEPPER, 0.33, -0.05, 0.008)
    ) is Verdict.SUCCESS  # fmt: skip


def test_a_thing_beside_the_target_is_not_on_it() -> None:
    found, evidence = judge(put(Relation.ON), tried(PEPPER, PLATE), [PLATE, at(PEPPER, 0.30, 0.03)])
    assert found is Verdict.FAILURE
    assert "No pepper is seen on the plate" in evidence


def test_what_lies_in_a_basket_may_hide_its_bottom() -> None:
    basket = replace(PLATE, surface_z=0.01, extent=[0.20, 0.14, 0.10], centre=[0.30, -0.10, 0.05])
    rim = replace(basket, surface_z=0.10)
    assert verdict(put(Relation.IN), tried(PEPPER, basket), rim, at(PEPPER, 0.31, -0.09, 0.05)) is Verdict.SUCCESS


def test_a_thing_under_the_target_is_not_on_it() -> None:
    flat = at(PEPPER, 0.30, -0.10, extent=[0.10, 0.03, 0.004])
    assert verdict(put(Relation.ON), tried(PEPPER, PLATE), PLATE, flat) is Verdict.FAILURE


def test_something_else_on_the_target_is_no_success() -> None:
    lime = at(PEPPER, 0.30, -0.10, 0.008, colour=GREEN)
    assert verdict(put(Relation.ON), tried(PEPPER, PLATE), PLATE, lime) is Verdict.FAILURE


def test_another_one_like_it_on_the_target_is_no_success_while_this_one_has_not_moved() -> None:
    other = at(PEPPER, 0.30, -0.10, 0.008)
    found, evidence = judge(put(Relation.ON), tried(PEPPER, PLATE, outcome=REFUSED), [PLATE, other, PEPPER])
    assert found is Verdict.FAILURE
    assert "still lies where it was" in evidence
    assert REFUSED.reason in evidence


def test_what_was_there_before_is_there_whatever_the_motion_said() -> None:
    there = at(PEPPER, 0.30, -0.10, 0.008)
    assert verdict(put(Relation.ON), tried(there, PLATE, outcome=REFUSED), PLATE, there) is Verdict.SUCCESS


def test_a_thing_that_vanished_is_a_failure() -> None:
    assert verdict(put(Relation.ON), tried(PEPPER, PLATE), PLATE) is Verdict.FAILURE


def test_an_empty_table_is_a_failure_for_every_command() -> None:
    for command in (
        put(Relation.ON), put(Relation.NEXT_TO), TURN, LIFT, to_point((0.3, 0.1)), shift(0.1),
    ):  # fmt: skip
        assert verdict(command, tried(PEPPER, PLATE, outcome=REFUSED)) is Verdict.FAILURE


def test_a_block_that_hides_the_one_below_is_on_it() -> None:
    stack = Command(action=Action.STACK, object="yellow block", relation=Relation.ON, target="blue block")
    seen = at(YELLOW, 0.30, 0.0, 0.055)  # the blue block under it is not seen at all
    assert verdict(stack, tried(YELLOW, BLUE), seen) is Verdict.SUCCESS


def test_a_pile_of_one_colour_as_high_as_both_is_a_stack() -> None:
    stack = Command(action=Action.STACK, object="block", relation=Relation.ON, target="blue block")
    small = replace(YELLOW, colour=BLUE.colour)
    pile = replace(BLUE, centre=[0.30, 0.0, 0.0425], extent=[0.055, 0.055, 0.085])
    assert verdict(stack, tried(small, BLUE), pile) is Verdict.SUCCESS
    assert verdict(stack, tried(small, BLUE), BLUE) is Verdict.FAILURE


def test_a_taller_thing_on_the_target_hides_nothing() -> None:
    spoon = made_object(0, "spoon", (0.2, 0.1), size=(0.15, 0.03, 0.01), colour=(170, 170, 175))
    egg = at(made_object(0, "egg", size=(0.05, 0.04, 0.04), colour=(230, 200, 170)), 0.30, -0.10, 0.008)
    dropped = at(spoon, 0.25, 0.2)
    assert verdict(put(Relation.ON), tried(spoon, PLATE), PLATE, egg, dropped) is Verdict.FAILURE


# beside ---------------------------------------------------------------------------------------------------------

BESIDE = [Relation.NEXT_TO, Relation.LEFT_OF, Relation.RIGHT_OF, Relation.IN_FRONT_OF, Relation.BEHIND]


@pytest.mark.parametrize("relation", BESIDE)
def test_beside_is_near_the_border_and_no_longer_where_it_was(relation: Relation) -> None:
    laid = at(PEPPER, 0.30, 0.05)
    assert verdict(put(relation), tried(PEPPER, PLATE), PLATE, laid) is Verdict.SUCCESS
    assert verdict(put(relation), tried(PEPPER, PLATE), PLATE, at(PEPPER, 0.30, 0.20)) is Verdict.FAILURE
    assert verdict(put(relation), tried(laid, PLATE), PLATE, laid) is Verdict.FAILURE


def test_beside_but_not_by_the_arm_does_not_count_because_the_side_is_not_known() -> None:
    laid = at(PEPPER, 0.30, 0.05)
    found, evidence = judge(put(Relation.LEFT_OF), tried(PEPPER, PLATE, outcome=REFUSED), [PLATE, laid])
    assert found is Verdict.FAILURE
    assert REFUSED.reason in evidence


# at a point, by a distance --------------------------------------------------------------------------------------


def to_point(point: tuple[float, float]) -> Command:
    return Command(action=Action.DRAG, object="plate", relation=Relation.AT, point=point)


def shift(distance: float) -> Command:
    return Command(
        action=Action.PUSH,
        object="pepper",
        relation=Relation.TOWARDS,
        direction=Direction.LEFT,
        distance=distance,
    )


@given(st.floats(0.0, 0.1))
def test_a_point_is_reached_within_two_and_a_half_centimetres(off: float) -> None:
    found = verdict(to_point((0.25, 0.10)), tried(PLATE), at(PLATE, 0.25 + off, 0.10))
    if abs(off - 0.025) > 1e-6:
        assert found is (Verdict.SUCCESS if off < 0.025 else Verdict.FAILURE)


def test_a_refused_way_to_a_point_tells_why() -> None:
    _, evidence = judge(to_point((0.30, 0.20)), tried(PLATE, outcome=REFUSED), [PLATE])
    assert evidence == f"The plate lies 30.0 cm from (0.30, 0.20). {REFUSED.reason}"


def test_a_shift_counts_by_its_length() -> None:
    for went, wanted in ((0.10, Verdict.SUCCESS), (0.11, Verdict.SUCCESS), (0.0, Verdict.FAILURE)):
        assert verdict(shift(0.1), tried(PEPPER), at(PEPPER, 0.20, 0.15 - went)) is wanted


# turning, lifting -----------------------------------------------------------------------------------------------

TURN = Command(action=Action.ROTATE, object="pepper", angle=math.pi / 2)
LIFT = Command(action=Action.PICK_UP, object="pepper")


@given(st.floats(-math.pi / 2, math.pi / 2), st.floats(-math.pi / 2, math.pi / 2))
def test_a_turn_counts_by_the_yaw_whichever_end_is_named_first(yaw: float, off: float) -> None:
    before = replace(PEPPER, yaw=yaw)
    seen = replace(PEPPER, yaw=yaw + math.pi / 2 + off)
    record = tried(before)
    if abs(abs(off) - math.radians(20)) > 1e-6:
        wanted = Verdict.SUCCESS if abs(off) < math.radians(20) else Verdict.FAILURE
        assert verdict(TURN, record, seen) is wanted
        assert verdict(TURN, record, replace(seen, yaw=seen.yaw - math.pi)) is wanted


@pytest.mark.parametrize(
    ("thing", "angle"), [(PEPPER, math.pi), (PEPPER, 2 * math.pi), (PLATE, math.pi / 2), (YELLOW, math.pi / 4)]
)
def test_of_a_turn_that_nobody_can_see_the_arm_is_believed(thing: ObjectInfo, angle: float) -> None:
    turn = replace(TURN, angle=angle)
    assert verdict(turn, tried(thing), thing) is Verdict.SUCCESS
    assert verdict(turn, tried(thing, outcome=REFUSED), thing) is Verdict.FAILURE


def test_a_thing_that_was_lifted_is_no_longer_where_it_was() -> None:
    assert verdict(LIFT, tried(PEPPER), PLATE) is Verdict.SUCCESS
    assert verdict(LIFT, tried(PEPPER), PLATE, PEPPER) is Verdict.FAILURE
    assert verdict(LIFT, tried(PEPPER, outcome=REFUSED), PLATE) is Verdict.FAILURE


def test_a_thing_held_up_above_its_old_place_was_lifted() -> None:
    assert verdict(LIFT, tried(PEPPER), at(PEPPER, 0.21, 0.14, 0.2)) is Verdict.SUCCESS
