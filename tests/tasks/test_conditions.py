"""Success predicates, on true states put together by hand: yes exactly where a person would say yes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import TypeAdapter
from scipy.spatial.transform import Rotation

from maniagent import tasks
from maniagent.envs.objects import make_object
from maniagent.envs.scene import place_objects
from maniagent.envs.tabletop import TrueObject
from maniagent.geometry import FloatArray, make_transform
from maniagent.tasks import Episode, Truth
from maniagent.tasks.conditions import AnyCondition, Condition

SPOT = np.array([0.28, 0.04])
conditions: TypeAdapter[Condition] = TypeAdapter(AnyCondition)


def put(
    kind: str,
    x: float = 0.0,
    y: float = 0.0,
    z: float | None = None,
    *,
    yaw: float = 0.0,
    pitch: float = 0.0,
    roll: float = 0.0,
    params: dict[str, Any] | None = None,
    **state: Any,
) -> TrueObject:
    """A thing (x, y) m from SPOT, at rest upright unless told otherwise; `z` (m) is what it stands on. Degrees.

    Pitch lifts the far end of its long axis, roll turns it about that axis; it is lifted to stand on its lowest corner.
    """
    model = make_object(kind, **(params or {}))
    R = Rotation.from_euler("ZYX", [yaw, -pitch, roll], degrees=True).as_matrix()
    half_height = float(np.abs(R[2]) @ model.extent / 2)
    T = make_transform(R, [SPOT[0] + x, SPOT[1] + y, (z or 0.0) + half_height])
    return TrueObject(model, T, **{"speed": 0.0, "angular_speed": 0.0, "touched": False} | state)


def block(size: float, *args: float, **state: Any) -> TrueObject:
    return put("block", *args, params={"size": size}, **state)


def holds(thing: TrueObject, target: TrueObject | None = None, **condition: Any) -> bool:
    truth = {"thing": thing} if target is None else {"thing": thing, "target": target}
    named = {"object": "thing"} | ({} if target is None else {"target": "target"})
    return conditions.validate_python(named | condition).holds(truth, {"goal": SPOT})


PLATE = put("plate")
ON_PLATE = make_object("plate").surface_z


# Released and at rest -----------------------------------------------------------------------------------------------


def test_a_thing_that_lies_on_the_plate_is_on_it() -> None:
    assert holds(put("red_chili", z=ON_PLATE), PLATE, kind="on")


@pytest.mark.parametrize("state", [{"touched": True}, {"speed": 0.05}, {"angular_speed": 1.0}], ids=str)
def test_nothing_holds_while_it_is_held_or_moves(state: dict[str, Any]) -> None:
    assert not holds(put("red_chili", z=ON_PLATE, **state), PLATE, kind="on")
    assert not holds(put("plate", **state), kind="at", point="goal")
    assert not holds(put("fork", y=-0.13, yaw=180, **state), PLATE, kind="beside", side="left")


@pytest.mark.parametrize("state", [{"touched": True}, {"speed": 0.05}], ids=str)
def test_a_plate_in_the_air_with_its_pepper_is_not_done(state: dict[str, Any]) -> None:
    plate = put("plate", z=0.1, **state)
    assert not holds(put("red_chili", z=0.1 + ON_PLATE), plate, kind="on")


# On -----------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("angle", range(0, 360, 45))
@pytest.mark.parametrize("kind", ["egg", "red_chili", "strawberry", "eggplant"])
def test_a_thing_beside_a_round_plate_is_not_on_it(kind: str, angle: float) -> None:
    # Just outside of the rim; at the diagonals that is within the plate's bounding square.
    reach = 0.1 + make_object(kind).extent[1] / 2
    x, y = reach * np.cos(np.radians(angle)), reach * np.sin(np.radians(angle))
    assert not holds(put(kind, x, y, yaw=angle + 90), PLATE, kind="on", inset=0.0)


@given(st.floats(0.0, 0.08), st.floats(0.0, 360.0), st.floats(0.0, 360.0), st.floats(0.0, 360.0))
def test_the_plate_may_lie_anywhere_and_any_way_round(r: float, angle: float, yaw: float, plate_yaw: float) -> None:
    x, y = r * np.cos(np.radians(angle)), r * np.sin(np.radians(angle))
    assert holds(put("egg", x, y, z=ON_PLATE, yaw=yaw), put("plate", yaw=plate_yaw), kind="on")


def test_a_carrot_across_the_rim_of_the_plate_is_on_it() -> None:
    assert holds(put("carrot", 0.05, z=ON_PLATE, pitch=8), PLATE, kind="on")


def test_a_carrot_that_leans_on_the_rim_from_outside_is_not() -> None:
    assert not holds(put("carrot", 0.12, pitch=-10), PLATE, kind="on")


def test_a_thing_beneath_the_plate_is_not_on_it() -> None:
    assert not holds(put("red_chili"), put("plate", z=0.024), kind="on")
    assert not holds(put("red_chili"), put("plate", pitch=12, z=0.005), kind="on")


def test_a_thing_upon_something_else_on_the_plate_is_not_on_it() -> None:
    assert not holds(put("red_chili", z=ON_PLATE + 0.04), PLATE, kind="on")


@pytest.mark.parametrize("roll", [180, 90])
def test_a_toppled_plate_carries_nothing(roll: float) -> None:
    plate = put("plate", roll=roll)
    assert not holds(put("red_chili", z=0.02), plate, kind="on")


def test_a_plate_that_leans_a_little_still_carries() -> None:
    plate = put("plate", pitch=6)
    lifted = replace(plate, T_base_object=plate.T_base_object @ make_transform(np.eye(3), [0, 0, 0.007]))
    assert holds(replace(put("red_chili"), T_base_object=lifted.T_base_object), plate, kind="on")


def test_a_stack_is_a_block_upon_a_block() -> None:
    blue = block(0.055)
    assert holds(block(0.03, z=0.055), blue, kind="on", inset=0.0)
    assert holds(block(0.03, 0.02, -0.02, z=0.055, yaw=30), blue, kind="on", inset=0.0)


@pytest.mark.parametrize(
    "yellow",
    [
        block(0.03, 0.0425),
        block(0.03, 0.046, pitch=-45),
        block(0.03, 0.03, z=0.055),
        block(0.03, z=0.085),
        block(0.03, 0.03, z=0.03, pitch=-40),
    ],
    ids=["beside it", "leaning on it", "off its edge", "with another between", "wedged beside it"],
)
def test_these_are_no_stacks(yellow: TrueObject) -> None:
    assert not holds(yellow, block(0.055), kind="on", inset=0.0)


@pytest.mark.parametrize(("pitch", "roll"), [(90, 0), (-90, 0), (0, 90), (0, 180), (0, -90), (90, 90)])
def test_a_cube_has_no_wrong_side(pitch: float, roll: float) -> None:
    below = block(0.03, yaw=20, pitch=pitch, roll=roll)
    assert holds(block(0.03, 0.005, z=0.03), below, kind="on", inset=0.0)
    assert not holds(block(0.03, 0.03), below, kind="on", inset=0.0)
    assert not holds(block(0.03), replace(below, T_base_object=lifted(below.T_base_object, 0.03)), kind="on")


def lifted(T: FloatArray, height: float) -> FloatArray:
    return make_transform(np.eye(3), [0, 0, height]) @ T


def test_a_spoon_on_a_towel_lies_on_the_towel_itself() -> None:
    towel = put("towel", yaw=35)
    assert holds(put("spoon", z=0.004, yaw=120), towel, kind="on")
    assert holds(put("spoon", z=0.004, pitch=5), towel, kind="on")
    assert not holds(put("spoon", z=0.044), towel, kind="on")
    assert not holds(put("spoon", 0.09), towel, kind="on")


# In -----------------------------------------------------------------------------------------------------------------


def test_what_lies_in_the_basket_is_in_it() -> None:
    basket = put("basket", yaw=15)
    floor = basket.model.surface_z
    assert holds(put("eggplant", z=floor), basket, kind="in", inset=0.0)
    assert holds(put("eggplant", 0.04, z=floor, pitch=35), basket, kind="in", inset=0.0)


@pytest.mark.parametrize("yaw", [0, 90])
def test_what_lies_across_the_rims_or_beside_the_basket_is_not_in_it(yaw: float) -> None:
    basket = put("basket")
    assert not holds(put("eggplant", z=0.06, yaw=yaw), basket, kind="in", inset=0.0)
    assert not holds(put("eggplant", 0.06, z=0.03, pitch=-60), basket, kind="in", inset=0.0)
    assert not holds(put("eggplant", y=0.09), basket, kind="in", inset=0.0)


def test_a_marker_upon_the_palm_or_the_fingers_is_in_the_hand() -> None:
    hand = put("hand")
    palm, fingers = hand.model.surface_z, float(hand.model.extent[2])
    assert holds(put("marker", z=palm, yaw=90), hand, kind="in", inset=0.0)
    assert holds(put("marker", z=fingers, yaw=90), hand, kind="in", inset=0.0)


def test_a_marker_on_the_table_between_the_fingers_is_not() -> None:
    assert not holds(put("marker", 0.06), put("hand"), kind="in", inset=0.0)


# At -----------------------------------------------------------------------------------------------------------------


def test_at_a_point_means_within_the_tolerance() -> None:
    assert holds(put("plate", 0.02, -0.02), kind="at", point="goal")
    assert holds(put("plate"), kind="at", point=tuple(SPOT))
    assert not holds(put("plate", 0.025, -0.025), kind="at", point="goal")
    assert holds(put("plate", 0.025, -0.025), kind="at", point="goal", tolerance=0.04)


def test_above_a_point_is_not_at_it() -> None:
    assert not holds(put("plate", z=0.05), kind="at", point="goal")


# Beside -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("yaw", [0, 180, 25, -155])
def test_knife_and_fork_lie_beside_the_plate_as_the_viewer_sees_it(yaw: float) -> None:
    # The viewer sits at +x and looks at the robot: the right is base +y.
    for y, side, other in ((0.13, "right", "left"), (-0.13, "left", "right")):
        assert holds(put("knife", y=y, yaw=yaw), PLATE, kind="beside", side=side)
        assert not holds(put("knife", y=y, yaw=yaw), PLATE, kind="beside", side=other)


@pytest.mark.parametrize(
    "knife",
    [
        put("knife", y=0.13, yaw=90),
        put("knife", y=0.13, yaw=40),
        put("knife", y=0.19),
        put("knife", y=0.07, z=0.02),
        put("knife", 0.13, 0.13),
        put("knife", 0.09, 0.105, yaw=-30, pitch=-7),
        put("knife", y=0.13, z=0.02),
    ],
    ids=["across", "askew", "too far", "on the plate", "before the plate", "leaning on the rim", "on something else"],
)
def test_these_are_not_laid_beside_the_plate(knife: TrueObject) -> None:
    assert not holds(knife, PLATE, kind="beside", side="right")


# Episodes -----------------------------------------------------------------------------------------------------------


def test_an_episode_is_achieved_when_all_its_conditions_hold() -> None:
    laid = tasks.get("lay-the-table")
    truth: dict[str, TrueObject] = {"plate": PLATE, "fork": put("fork", y=-0.13), "knife": put("knife", y=0.13)}
    episode = Episode(laid.instruction, laid.success, {})
    assert episode.achieved(truth) is True
    assert episode.achieved(truth | {"knife": put("knife", y=-0.16)}) is False


@pytest.mark.parametrize("name", tasks.names())
def test_no_task_is_achieved_from_the_start(name: str) -> None:
    task = tasks.get(name)
    for seed in range(20):
        rng = np.random.default_rng(seed)
        layout = place_objects(task.scene, rng)
        truth: Truth = {
            p.name: TrueObject(
                p.model,
                make_transform(Rotation.from_euler("z", p.yaw).as_matrix(), [*p.xy, p.z]),
                speed=0.0,
                angular_speed=0.0,
                touched=False,
            )
            for p in layout
        }
        assert task.episode(layout, rng).achieved(truth) is False
