"""Binding: what makes one sequence fit every scene, stated as laws."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maniagent.agents.binding import SIDE_GAP, bind
from maniagent.agents.rules.commands import Action, Command, Relation
from maniagent.agents.rules.controller import RulesControllerAgent
from maniagent.errors import FormatFailure, GraspFailure
from maniagent.geometry import invert_transform, make_transform, rotation_z, transform_points
from maniagent.perception.viewpoint import Viewpoint
from maniagent.testing import made_object
from maniagent.types import (
    ActionSequence,
    ActionStep,
    GraspPose,
    Gripper,
    HereAnchor,
    KeyPoint,
    ObjectAnchor,
    ObjectInfo,
    Orientation,
    Part,
    PointAnchor,
    Subtask,
    Verdict,
)

VIEWPOINT = Viewpoint(np.array([0.0, 1.0]), np.array([-1.0, 0.0]))
"""Of a person who sits opposite the robot."""
AS_GRASP = Orientation(kind="grasp", index=0)
DOWN = Orientation(kind="top-down")

metres = st.floats(-0.3, 0.3)
angles = st.floats(-math.pi, math.pi)
sizes = st.tuples(st.floats(0.02, 0.2), st.floats(0.01, 0.2), st.floats(0.005, 0.1))
offsets = st.tuples(metres, metres, metres)


def step(anchor: ObjectAnchor | PointAnchor | HereAnchor, **fields: object) -> ActionStep:
    return ActionStep.model_validate({"description": "go", "anchor": anchor.model_dump(), **fields})


def take(**fields: object) -> ActionStep:
    return step(ObjectAnchor(index=0, part=Part.GRASP), orientation=AS_GRASP, gripper=Gripper.CLOSE, **fields)


def bound(
    *steps: ActionStep, objects: tuple[ObjectInfo, ...], viewpoint: Viewpoint = VIEWPOINT
) -> tuple[KeyPoint, ...]:
    return bind(ActionSequence(skill="test", steps=steps), objects, viewpoint)


@st.composite
def made_objects(draw: st.DrawFn) -> tuple[ObjectInfo, ...]:
    pepper, plate = (
        made_object(i, name, draw(st.tuples(metres, metres)), size=draw(sizes), yaw=draw(angles))
        for i, name in enumerate(("pepper", "plate"))
    )
    return pepper, replace(plate, free_spot=draw(st.none() | st.tuples(metres, metres)))


@st.composite
def anchored_steps(draw: st.DrawFn) -> tuple[ActionStep, ...]:
    """A grasp of object 0, then places at objects 0 and 1 and straight above, offsets in the viewer's frame."""
    parts = st.sampled_from(list(Part))
    rest = []
    for index, part, up, turned, offset in draw(
        st.lists(st.tuples(st.integers(0, 1), parts, st.booleans(), st.booleans(), offsets), max_size=5)
    ):
        turn = {"kind": "turn", "yaw": draw(angles)} if turned else {"kind": "keep"}
        anchor: ObjectAnchor | HereAnchor = HereAnchor(here=True) if up else ObjectAnchor(index=index, part=part)
        carrying = None if up else draw(st.sampled_from([None, 0]))
        rest.append(step(anchor, offset=offset, offset_frame="viewer", orientation=turn, carrying=carrying))
    return (take(offset=draw(offsets), offset_frame="viewer"), *rest)


def moved(thing: ObjectInfo, turn: float, shift: tuple[float, float]) -> ObjectInfo:
    T = make_transform(rotation_z(turn), [*shift, 0.0])
    grasps = tuple(GraspPose(T @ g.T_base_grasp, g.opening, g.score) for g in thing.grasps)
    spot = None if thing.free_spot is None else transform_points(T, np.array([*thing.free_spot, 0.0]))[:2]
    centre = transform_points(T, thing.centre)
    return replace(thing, centre=centre, yaw=thing.yaw + turn, free_spot=spot, grasps=grasps)


@given(made_objects(), anchored_steps(), angles, st.tuples(metres, metres))
def test_when_objects_and_viewer_move_together_the_key_points_move_along(
    objects: tuple[ObjectInfo, ...], steps: tuple[ActionStep, ...], turn: float, shift: tuple[float, float]
) -> None:
    T = make_transform(rotation_z(turn), [*shift, 0.0])
    R = T[:2, :2]
    before = bound(*steps, objects=objects)
    after = bound(
        *steps,
        objects=tuple(moved(thing, turn, shift) for thing in objects),
        viewpoint=Viewpoint(R @ VIEWPOINT.right, R @ VIEWPOINT.away),
    )
    for old, new in zip(before, after, strict=True):
        np.testing.assert_allclose(new.T_base_tcp, T @ old.T_base_tcp, atol=1e-9)
        assert (new.held, new.touches, new.gripper, new.opening) == (old.held, old.touches, old.gripper, old.opening)


@given(made_objects(), anchored_steps())
def test_bound_poses_are_rigid_and_finite(objects: tuple[ObjectInfo, ...], steps: tuple[ActionStep, ...]) -> None:
    for point in bound(*steps, objects=objects):
        assert np.isfinite(point.T_base_tcp).all()
        np.testing.assert_allclose(point.T_base_tcp @ invert_transform(point.T_base_tcp), np.eye(4), atol=1e-9)


@given(made_objects(), offsets, st.tuples(metres, metres, metres), angles)
def test_carrying_brings_the_middle_of_the_underside_to_the_target(
    objects: tuple[ObjectInfo, ...], held_off: tuple[float, ...], goal: tuple[float, float, float], turn: float
) -> None:
    way = step(PointAnchor(x=goal[0], y=goal[1], z=goal[2]), carrying=0, orientation=Orientation(kind="turn", yaw=turn))
    taken, there = bound(take(offset=held_off), way, objects=objects)
    underside = [*objects[0].centre[:2], objects[0].bottom_z]
    in_hand = transform_points(invert_transform(taken.T_base_tcp), np.array(underside))
    np.testing.assert_allclose(transform_points(there.T_base_tcp, in_hand), goal, atol=1e-9)


@pytest.mark.parametrize("relation", [Relation.ON, Relation.IN, Relation.NEXT_TO, Relation.LEFT_OF, Relation.BEHIND])
@given(objects=made_objects())
def test_the_rules_sequences_bind_to_whatever_lies_there(relation: Relation, objects: tuple[ObjectInfo, ...]) -> None:
    command = Command(action=Action.PLACE, object="pepper", relation=relation, target="plate")
    subtask = Subtask(previous=Verdict.INITIAL, reason="", text=str(command), objects=("pepper", "plate"))
    points = bind(RulesControllerAgent().write(subtask, objects), objects, VIEWPOINT)
    assert [p.gripper for p in points] == [
        Gripper.OPEN, Gripper.CLOSE, Gripper.KEEP, Gripper.KEEP, Gripper.OPEN, Gripper.KEEP,
    ]  # fmt: skip
    assert [p.held for p in points] == [None, None, 0, 0, 0, None]


PARTS_BY_SIDE = {
    Part.LEFT: -VIEWPOINT.right,
    Part.RIGHT: VIEWPOINT.right,
    Part.NEAR: -VIEWPOINT.away,
    Part.FAR: VIEWPOINT.away,
}


@pytest.mark.parametrize("side", list(PARTS_BY_SIDE))
@given(objects=made_objects(), turn=angles)
def test_a_side_is_where_the_viewer_sees_it_with_a_gap_between_the_two(
    side: Part, objects: tuple[ObjectInfo, ...], turn: float
) -> None:
    direction = PARTS_BY_SIDE[side]
    carried, target = objects
    beside = step(ObjectAnchor(index=1, part=side), carrying=0, orientation=Orientation(kind="turn", yaw=turn))
    taken, there = bound(take(), beside, objects=objects)
    T = there.T_base_tcp @ invert_transform(taken.T_base_tcp)
    laid = transform_points(T, _corners(carried))
    gap = (laid[:, :2] @ direction).min() - (_corners(target)[:, :2] @ direction).max()
    assert gap == pytest.approx(SIDE_GAP, abs=1e-9)
    middle = laid.mean(axis=0)[:2] - target.centre[:2]
    assert abs(middle @ [-direction[1], direction[0]]) < 1e-9


def _corners(thing: ObjectInfo) -> np.ndarray:
    signs = np.array([[x, y, -1.0] for x in (-1, 1) for y in (-1, 1)])
    return signs * thing.extent / 2 @ rotation_z(thing.yaw).T + thing.centre


@pytest.mark.parametrize(
    ("part", "height"), [(Part.CENTRE, 0.05), (Part.TOP, 0.06), (Part.BASE, 0.04), (Part.SURFACE, 0.06)]
)
def test_parts_are_at_their_heights_over_the_middle(part: Part, height: float) -> None:
    pepper = made_object(0, "pepper", (0.2, 0.1), size=(0.1, 0.03, 0.02), base_z=0.04)
    (point,) = bound(step(ObjectAnchor(index=0, part=part), orientation=DOWN), objects=(pepper,))
    np.testing.assert_allclose(point.T_base_tcp[:3, 3], [0.2, 0.1, height])


def test_what_is_free_of_a_surface_is_its_middle_until_something_lies_on_it() -> None:
    empty = made_object(0, "plate", (0.3, 0.0), size=(0.2, 0.2, 0.01))
    laden = replace(empty, free_spot=[0.33, -0.04])
    for part, plate, wanted in (
        (Part.FREE, empty, [0.3, 0.0, 0.01]),
        (Part.FREE, laden, [0.33, -0.04, 0.01]),
        (Part.SURFACE, laden, [0.3, 0.0, 0.01]),
    ):
        (point,) = bound(step(ObjectAnchor(index=0, part=part), orientation=DOWN), objects=(plate,))
        np.testing.assert_allclose(point.T_base_tcp[:3, 3], wanted)


def test_nothing_is_aligned_that_is_not_held() -> None:
    with pytest.raises(FormatFailure, match="nothing is in the gripper"):
        bound(step(PointAnchor(x=0.2, y=0.0), orientation=Orientation(kind="align")), objects=())


def test_offsets_count_along_base_axes_or_the_viewers() -> None:
    for frame, wanted in (("base", [0.21, 0.02, 0.03]), ("viewer", [0.18, 0.01, 0.03])):
        (point,) = bound(
            step(PointAnchor(x=0.2, y=0.0), offset=(0.01, 0.02, 0.03), offset_frame=frame, orientation=DOWN),
            objects=(),
        )
        np.testing.assert_allclose(point.T_base_tcp[:3, 3], wanted)


def test_here_is_where_the_step_before_ended() -> None:
    first, second = bound(
        step(PointAnchor(x=0.2, y=0.1), orientation=Orientation(kind="top-down", yaw=0.5)),
        step(HereAnchor(here=True), offset=(0.0, 0.0, 0.1)),
        objects=(),
    )
    np.testing.assert_allclose(second.T_base_tcp[:3, 3] - first.T_base_tcp[:3, 3], [0, 0, 0.1], atol=1e-12)
    np.testing.assert_array_equal(second.T_base_tcp[:3, :3], first.T_base_tcp[:3, :3])


@given(angles, angles)
def test_a_turn_adds_to_the_orientation_before(start: float, turn: float) -> None:
    turned, straight = (
        bound(*steps, objects=())[-1].T_base_tcp
        for steps in (
            (
                step(PointAnchor(x=0, y=0), orientation=Orientation(kind="top-down", yaw=start)),
                step(PointAnchor(x=0, y=0), orientation=Orientation(kind="turn", yaw=turn)),
            ),
            (step(PointAnchor(x=0, y=0), orientation=Orientation(kind="top-down", yaw=start + turn)),),
        )
    )
    np.testing.assert_allclose(turned, straight, atol=1e-12)


def test_fingers_open_as_wide_as_the_grasp_asks_before_and_fully_after() -> None:
    pepper = made_object(0, "pepper", size=(0.1, 0.02, 0.02))
    above = step(ObjectAnchor(index=0, part=Part.GRASP), orientation=AS_GRASP, gripper=Gripper.OPEN)
    let_go = step(PointAnchor(x=0.2, y=0), carrying=0, gripper=Gripper.OPEN)
    points = bound(above, take(), let_go, objects=(pepper,))
    assert [p.opening for p in points] == [pytest.approx(0.03), None, None]


def test_a_move_may_touch_what_it_goes_to_what_it_leaves_and_what_it_carries() -> None:
    objects = (made_object(0, "pepper"), made_object(1, "plate", (0.3, 0.2)))
    points = bound(
        take(),
        step(HereAnchor(here=True), offset=(0, 0, 0.1)),
        step(ObjectAnchor(index=1, part=Part.SURFACE), carrying=0, gripper=Gripper.OPEN),
        step(HereAnchor(here=True), offset=(0, 0, 0.1)),
        step(HereAnchor(here=True), offset=(0, 0, 0.1)),
        objects=objects,
    )
    assert [set(p.touches) for p in points] == [{0}, {0}, {0, 1}, {0, 1}, set()]
    assert [p.held for p in points] == [None, 0, 0, None, None]


def test_closing_again_while_something_is_held_changes_nothing() -> None:
    objects = (made_object(0, "pepper"), made_object(1, "plate", (0.3, 0.2)))
    squeeze = step(ObjectAnchor(index=1, part=Part.SURFACE), carrying=0, gripper=Gripper.CLOSE)
    assert [p.held for p in bound(take(), squeeze, squeeze, objects=objects)] == [None, 0, 0]


PEPPER = made_object(0, "pepper")
BARE = made_object(0, "pepper", grasps=0)


@pytest.mark.parametrize(
    ("steps", "said"),
    [
        ((step(ObjectAnchor(index=7), orientation=DOWN),), r"no object 7; the objects are \[0, 1\]"),
        ((step(PointAnchor(x=0, y=0), orientation=Orientation(kind="grasp", index=3)),), "no object 3"),
        ((step(PointAnchor(x=0, y=0), orientation=DOWN, carrying=0),), "object 0 is not in the gripper"),
        ((take(), step(PointAnchor(x=0, y=0), carrying=1)), "object 1 is not in the gripper"),
        (
            (
                take(),
                step(PointAnchor(x=0, y=0), carrying=0, gripper=Gripper.OPEN),
                step(PointAnchor(x=0, y=0.1), carrying=0),
            ),
            "Step 3 .* object 0 is not in the gripper",
        ),
        ((step(ObjectAnchor(index=0)),), "first step must say how the gripper is turned"),
        ((step(ObjectAnchor(index=0), orientation=Orientation(kind="turn", yaw=1.0)),), "first step"),
        ((step(HereAnchor(here=True), orientation=DOWN),), "'here'"),
        ((take(), step(HereAnchor(here=True), carrying=0)), "'here'"),
    ],
)
def test_what_makes_no_sense_is_refused_with_the_step_and_the_reason(steps: tuple[ActionStep, ...], said: str) -> None:
    with pytest.raises(FormatFailure, match=said) as caught:
        bound(*steps, objects=(PEPPER, made_object(1, "plate", (0.3, 0.2))))
    assert str(caught.value).startswith(f"Step {len(steps)} (go)")


@pytest.mark.parametrize(
    "steps",
    [(take(),), (step(ObjectAnchor(index=0, part=Part.GRASP), orientation=DOWN),)],
)
def test_a_grasp_that_nobody_knows_is_a_grasp_failure(steps: tuple[ActionStep, ...]) -> None:
    with pytest.raises(GraspFailure, match="no grasp is known for the pepper"):
        bound(*steps, objects=(BARE,))


SKEWED = np.eye(4)
SKEWED[0, 1] = math.nan


@pytest.mark.parametrize(
    ("broken", "part", "orientation"),
    [
        (replace(PEPPER, centre=np.array([math.inf, 0, 0])), Part.TOP, DOWN),
        (replace(PEPPER, surface_z=math.nan), Part.SURFACE, DOWN),
        (replace(PEPPER, yaw=math.nan), Part.LEFT, DOWN),
        (replace(PEPPER, grasps=(GraspPose(SKEWED, 0.03, 1.0),)), Part.GRASP, AS_GRASP),
    ],
)
def test_what_is_not_finite_never_becomes_a_key_point(broken: ObjectInfo, part: Part, orientation: Orientation) -> None:
    with pytest.raises(FormatFailure, match="not a finite pose"):
        bound(step(ObjectAnchor(index=0, part=part), orientation=orientation), objects=(broken,))
