from __future__ import annotations

from collections.abc import Iterator

import mujoco
import numpy as np
import pytest
from arms import top_down
from hypothesis import given, settings
from hypothesis import strategies as st

from maniagent.errors import MotionRejected
from maniagent.geometry import make_transform
from maniagent.motion import ArmModel, IKSolver
from maniagent.motion.collision import MAX_OBSTACLES, OBSTACLE_SLACK, CollisionModel, HeldBox, PlacedBox
from maniagent.types import OrientedBox

MODEL = ArmModel()
SOLVER = IKSolver(MODEL)
COLLISIONS = CollisionModel(MODEL)


@pytest.fixture
def collisions() -> Iterator[CollisionModel]:
    yield COLLISIONS
    COLLISIONS.set_scene({})


def box(x: float, y: float, z: float, size: float = 0.04, yaw: float = 0.0) -> PlacedBox:
    return PlacedBox.of(OrientedBox(np.array([x, y, z]), np.full(3, size), yaw))


def words(collisions: CollisionModel, *target: float, opening: float = 0.048) -> set[str]:
    return {str(contact) for contact in collisions.contacts(SOLVER.solve(top_down(*target), MODEL.home), opening)}


def test_home_touches_nothing(collisions: CollisionModel) -> None:
    collisions.set_scene({})
    assert collisions.contacts(MODEL.home, MODEL.max_opening) == []


def test_names_the_fingers_that_would_hit_the_table(collisions: CollisionModel) -> None:
    collisions.set_scene({})
    assert words(collisions, 0.3, 0.0, 0.015) == set()
    assert words(collisions, 0.3, 0.0, 0.004) == {
        "the left finger would hit the table",
        "the right finger would hit the table",
    }


def test_fingers_fit_around_a_box_that_is_narrower_than_their_opening(collisions: CollisionModel) -> None:
    collisions.set_scene({7: box(0.3, 0.0, 0.02)})
    assert words(collisions, 0.3, 0.0, 0.02) == set()
    assert words(collisions, 0.3, 0.0, 0.02, opening=0.02) == {
        "the left finger would hit object 7",
        "the right finger would hit object 7",
    }


def test_a_carried_box_hits_what_the_hand_alone_would_clear(collisions: CollisionModel) -> None:
    wall = {3: box(0.3, 0.06, 0.02)}
    collisions.set_scene(wall)
    assert words(collisions, 0.3, 0.0, 0.1) == set()
    collisions.set_scene(wall, HeldBox(make_transform(np.eye(3), [0.05, 0.0, 0.0]), np.array([0.04, 0.06, 0.02])))
    assert words(collisions, 0.3, 0.0, 0.1) == {"the carried object would hit object 3"}
    assert words(collisions, 0.3, -0.1, 0.05) == {"the carried object would hit the table"}


def test_a_carried_box_is_no_obstacle_to_the_hand_that_carries_it(collisions: CollisionModel) -> None:
    collisions.set_scene({}, HeldBox(np.eye(4), np.full(3, 0.02)))
    assert words(collisions, 0.3, 0.0, 0.2) == set()


def test_a_scene_replaces_the_one_before(collisions: CollisionModel) -> None:
    collisions.set_scene({1: box(0.3, 0.0, 0.1, 0.1)}, HeldBox(np.eye(4), np.full(3, 0.2)))
    collisions.set_scene({})
    assert words(collisions, 0.3, 0.0, 0.1) == set()


def test_folding_the_hand_into_the_base_is_a_collision(collisions: CollisionModel) -> None:
    collisions.set_scene({})
    assert any("the base would hit" in w for w in words(collisions, 0.07, 0.0, 0.03))


def test_refuses_more_obstacles_than_it_can_hold(collisions: CollisionModel) -> None:
    with pytest.raises(MotionRejected, match=f"more than the {MAX_OBSTACLES}"):
        collisions.set_scene({i: box(0.3, 0.0, 0.1) for i in range(MAX_OBSTACLES + 1)})


@settings(max_examples=40)
@given(
    st.lists(st.floats(0.1, 0.9), min_size=6, max_size=6),
    st.tuples(st.floats(0.1, 0.4), st.floats(-0.2, 0.2), st.floats(0.0, 0.3)),
    st.floats(0.02, 0.2),
    st.floats(-1.5, 1.5),
)
def test_agrees_with_exact_distances(
    shares: list[float], at: tuple[float, float, float], size: float, yaw: float
) -> None:
    """Broad phase and resizing at run time must not lose a contact: compare with pairwise distances."""
    q = MODEL.lower + np.array(shares) * (MODEL.upper - MODEL.lower)
    obstacle = box(*at, size, yaw)
    COLLISIONS.set_scene({0: obstacle})
    reported = {contact.part for contact in COLLISIONS.contacts(q, 0.03) if contact.obstacle == 0}
    spec = mujoco.MjSpec.from_file(str(MODEL.xml))
    body = spec.worldbody.add_body(name="box", pos=obstacle.T_base_box[:3, 3])
    body.quat = [np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)]
    body.add_geom(name="box", type=mujoco.mjtGeom.mjGEOM_BOX, size=obstacle.half_extent - OBSTACLE_SLACK)
    exact = spec.compile()
    data = mujoco.MjData(exact)
    data.qpos[:6], data.qpos[6:8] = q, MODEL.finger_position(0.03)
    mujoco.mj_kinematics(exact, data)
    moving = [g for g in range(exact.ngeom) if exact.geom_contype[g] and exact.geom_bodyid[g] not in (0, 1)]
    distances = {
        g: mujoco.mj_geomDistance(exact, data, g, exact.geom("box").id, 0.01, None)
        for g in moving
        if g != exact.geom("box").id
    }
    names = {g: exact.body(exact.geom_bodyid[g]).name for g in distances}
    assert {names[g] for g, d in distances.items() if d < -1e-4} <= reported
    assert reported <= {names[g] for g, d in distances.items() if d < 1e-4}
