"""The rules' sequences: three skills, numbers that depend on the command and never on where things are."""

import itertools
import math

import numpy as np
import pytest

from maniagent.agents.binding import bind
from maniagent.agents.rules.commands import Action, Command, Direction, Relation
from maniagent.agents.rules.controller import CARRY, HOVER, PICK_UP_HEIGHT, RulesControllerAgent, direction_of
from maniagent.errors import ReasoningFailure
from maniagent.geometry import yaw_of_top_down
from maniagent.perception.viewpoint import Viewpoint
from maniagent.testing import made_object
from maniagent.types import ActionSequence, Gripper, KeyPoint, ObjectInfo, Subtask, Verdict

VIEWPOINT = Viewpoint(np.array([0.0, 1.0]), np.array([-1.0, 0.0]))
PEPPER = made_object(0, "pepper", (0.20, 0.15), size=(0.10, 0.02, 0.02))
PLATE = made_object(1, "plate", (0.30, -0.10), size=(0.20, 0.16, 0.01))
OBJECTS = (PEPPER, PLATE)


def write(command: Command, feedback: str = "", objects: tuple[ObjectInfo, ...] = OBJECTS) -> ActionSequence:
    queries = (command.object,) if command.target is None else (command.object, command.target)
    subtask = Subtask(previous=Verdict.INITIAL, reason="", text=str(command), objects=queries)
    return RulesControllerAgent().write(subtask, objects, feedback)


def keypoints(command: Command) -> tuple[KeyPoint, ...]:
    return bind(write(command), OBJECTS, VIEWPOINT)


def positions(command: Command) -> np.ndarray:
    return np.array([point.T_base_tcp[:3, 3] for point in keypoints(command)])


def put(relation: Relation) -> Command:
    return Command(action=Action.PLACE, object="pepper", relation=relation, target="plate")


DRAG = Command(action=Action.DRAG, object="pepper", relation=Relation.AT, point=(0.25, -0.05))
PUSH = Command(action=Action.PUSH, object="pepper", relation=Relation.TOWARDS, direction=Direction.RIGHT, distance=0.08)
TURN = Command(action=Action.ROTATE, object="pepper", angle=math.radians(-60))
LIFT = Command(action=Action.PICK_UP, object="pepper")
EVERY = [
    *map(put, (Relation.ON, Relation.IN, Relation.NEXT_TO, Relation.LEFT_OF, Relation.RIGHT_OF)),
    *map(put, (Relation.IN_FRONT_OF, Relation.BEHIND)),
    DRAG, PUSH, TURN, LIFT,
]  # fmt: skip


@pytest.mark.parametrize("command", EVERY, ids=str)
def test_the_same_command_gets_the_same_sequence_wherever_things_lie(command: Command) -> None:
    elsewhere = (made_object(0, "pepper", (0.33, -0.2), yaw=1.0), made_object(1, "plate", (0.2, 0.0), yaw=0.3))
    assert write(command) == write(command, objects=elsewhere)


@pytest.mark.parametrize("command", EVERY, ids=str)
def test_every_sequence_opens_above_closes_on_the_grasp_and_leaves_upwards(command: Command) -> None:
    points = keypoints(command)
    above, down = points[0], points[1]
    assert (above.gripper, down.gripper) == (Gripper.OPEN, Gripper.CLOSE)
    np.testing.assert_allclose(down.T_base_tcp, PEPPER.grasps[0].T_base_grasp)
    np.testing.assert_allclose(above.T_base_tcp[:3, 3] - down.T_base_tcp[:3, 3], [0, 0, HOVER])
    rise = points[-1].T_base_tcp[:3, 3] - points[-2].T_base_tcp[:3, 3]
    np.testing.assert_allclose(rise[:2], 0, atol=1e-12)
    assert rise[2] >= min(HOVER, PICK_UP_HEIGHT)


@pytest.mark.parametrize("command", EVERY, ids=str)
def test_what_is_taken_is_let_go_but_for_a_pick_up(command: Command) -> None:
    last = [point.gripper for point in keypoints(command) if point.gripper is not Gripper.KEEP][-1]
    assert last is (Gripper.CLOSE if command is LIFT else Gripper.OPEN)


def test_onto_means_over_the_middle_and_down_to_just_above_the_surface() -> None:
    places = positions(put(Relation.ON))
    carry, lower = places[3], places[4]
    np.testing.assert_allclose(carry - lower, [0, 0, CARRY])
    np.testing.assert_allclose(lower[:2], PLATE.centre[:2])
    underside = lower[2] - PEPPER.centre[2]
    assert 0 < underside - PLATE.surface_z < 0.01


def test_into_means_below_the_rim() -> None:
    lower = positions(put(Relation.IN))[4]
    assert lower[2] - PEPPER.centre[2] < PLATE.top_z


@pytest.mark.parametrize(
    ("relation", "direction"),
    [
        (Relation.LEFT_OF, -VIEWPOINT.right),
        (Relation.RIGHT_OF, VIEWPOINT.right),
        (Relation.NEXT_TO, VIEWPOINT.right),
        (Relation.IN_FRONT_OF, -VIEWPOINT.away),
        (Relation.BEHIND, VIEWPOINT.away),
    ],
)
def test_sides_are_the_viewers(relation: Relation, direction: np.ndarray) -> None:
    offset = positions(put(relation))[4][:2] - PLATE.centre[:2]
    assert offset @ direction == pytest.approx(np.linalg.norm(offset))


def test_next_to_changes_sides_when_the_right_one_is_out_of_the_workspace() -> None:
    feedback = "Key point 4 ('Carry it right of the plate'): y = 0.400 m is outside the workspace (-0.36 to 0.36 m)."
    lower = bind(write(put(Relation.NEXT_TO), feedback), OBJECTS, VIEWPOINT)[4].T_base_tcp[:3, 3]
    assert (lower[:2] - PLATE.centre[:2]) @ VIEWPOINT.right < 0
    assert write(put(Relation.RIGHT_OF), feedback) == write(put(Relation.RIGHT_OF)), "who says right means right"


def test_a_drag_stays_on_the_table_all_the_way() -> None:
    places = positions(DRAG)
    np.testing.assert_allclose(places[2], [0.25, -0.05, PEPPER.centre[2]])
    assert places[1][2] == pytest.approx(places[2][2])


def test_a_push_goes_so_far_to_the_viewers_side() -> None:
    places = positions(PUSH)
    np.testing.assert_allclose((places[2] - places[1])[:2], 0.08 * VIEWPOINT.right, atol=1e-12)
    assert places[2][2] == pytest.approx(places[1][2])


def test_a_turn_is_made_in_the_air_and_put_down_where_it_was() -> None:
    points = keypoints(TURN)
    yaws = [yaw_of_top_down(point.T_base_tcp[:3, :3]) for point in points]
    assert [b - a for a, b in itertools.pairwise(yaws)] == pytest.approx([0, 0, TURN.angle, 0, 0])
    assert points[3].T_base_tcp[2, 3] > points[1].T_base_tcp[2, 3] + 0.03
    np.testing.assert_allclose(points[4].T_base_tcp[:2, 3], points[1].T_base_tcp[:2, 3], atol=1e-12)


def test_a_direction_is_a_unit_vector_or_nothing() -> None:
    start = np.array([0.25, 0.05])
    np.testing.assert_allclose(direction_of(DRAG, start, VIEWPOINT), [0.0, -1.0])
    np.testing.assert_allclose(direction_of(PUSH, start, VIEWPOINT), VIEWPOINT.right)
    np.testing.assert_array_equal(direction_of(LIFT, start, VIEWPOINT), [0.0, 0.0])


def test_what_is_no_command_is_refused() -> None:
    with pytest.raises(ReasoningFailure):
        RulesControllerAgent().write(
            Subtask(previous=Verdict.INITIAL, reason="", text="be nice", objects=("it",)), OBJECTS
        )
