"""The object library: what a camera sees, what fingers feel and what the scene is told agree."""

from __future__ import annotations

import time

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from maniagent.envs.objects import ObjectModel, attach, make_object, object_names
from maniagent.envs.objects.bodies import COLLISION_GROUP, VISUAL_GROUP
from maniagent.envs.objects.implicit import ball, limb, slab
from maniagent.envs.objects.mesh import merge
from maniagent.envs.objects.pieces import Piece
from maniagent.envs.objects.things import BLOCK_COLOURS
from maniagent.errors import UnknownNameError, UsageError
from maniagent.geometry import FloatArray

HEAVY = {"towel", "hand"}
VESSELS = {"plate", "dish", "basket"}

# Where a small gripper that closes along y takes each thing, from the body's origin along x and y (m).
GRASPS: dict[str, tuple[float, float]] = {
    "red_chili": (0.0, 0.0),
    "green_chili": (0.0, 0.0),
    "carrot": (-0.005, 0.0),
    "eggplant": (0.0, 0.0),
    "banana": (0.0, 0.0085),
    "strawberry": (-0.001, 0.0),
    "egg": (0.0, 0.0),
    "corn": (0.005, 0.0),
    "plate": (0.0, 0.0955),
    "dish": (0.0, 0.0515),
    "basket": (0.0, 0.068),
    "spoon": (-0.005, 0.0),
    "fork": (-0.005, 0.003),
    "knife": (-0.008, 0.0),
    "block": (0.0, 0.0),
    "marker": (0.0, 0.0),
    "toy": (-0.003, 0.0),
}


def scene(*models: ObjectModel, fingers: tuple[float, float, float] | None = None) -> mujoco.MjModel:
    """A table with the models on it side by side, and two fingers with their tips at `fingers` where asked for."""
    spec = mujoco.MjSpec()
    spec.option.timestep = 0.002
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = 10.0
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_BOX, size=[1, 1, 0.02], pos=[0, 0, -0.02], friction=[0.7, 0.005, 0.0001]
    )
    for index, model in enumerate(models):
        attach(spec, model, f"thing{index}")
        spec.body(f"thing{index}").pos[0] = 0.3 * index
    if fingers is not None:
        add_fingers(spec, *fingers)
    return spec.compile()


def add_fingers(spec: mujoco.MjSpec, x: float, y: float, z: float) -> None:
    """Two box fingers, pads 10 mm wide and 24 mm tall, 48 mm apart, their tips at (x, y, z) m."""
    box, slide = mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtJoint.mjJNT_SLIDE
    wrist = spec.worldbody.add_body(name="wrist", pos=[x, y, z], gravcomp=1)
    wrist.add_geom(type=box, size=[0.01, 0.03, 0.01], pos=[0, 0, 0.12], mass=0.5)
    for name, axis in (("lift", [0, 0, 1]), ("drag", [1, 0, 0])):
        wrist.add_joint(name=name, type=slide, axis=axis, damping=50)
        motor = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        motor.set_to_position(kp=2000)
    for side in (-1, 1):
        name = f"finger{side}"
        finger = wrist.add_body(name=name, pos=[0, side * 0.027, 0.012], gravcomp=1)
        finger.add_joint(
            name=name, type=slide, axis=[0, -side, 0], range=[0, 0.0265], limited=True, damping=20, armature=0.02
        )
        finger.add_geom(
            type=box, size=[0.005, 0.003, 0.012], mass=0.03, condim=4, priority=1,
            friction=[1.0, 0.006, 0.0002], solref=[0.006, 1.0], solimp=[0.9, 0.98, 0.001, 0.5, 2.0],
        )  # fmt: skip
        spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT).gainprm[0] = 1.0


def squeeze(compiled: mujoco.MjModel, newtons: float = 12.0) -> mujoco.MjData:
    """Let the scene settle, then close the fingers."""
    data = settled(compiled, 0.2)
    for side in (-1, 1):
        data.actuator(f"finger{side}").ctrl[0] = newtons
    mujoco.mj_step(compiled, data, 250)
    return data


def travel(compiled: mujoco.MjModel, data: mujoco.MjData, actuator: str, metres: float) -> None:
    """Move at 0.2 m/s and stop for half a second."""
    for target in np.linspace(0.0, metres, round(abs(metres) / 0.2 / compiled.opt.timestep)):
        data.actuator(actuator).ctrl[0] = target
        mujoco.mj_step(compiled, data)
    mujoco.mj_step(compiled, data, 250)


def settled(model: mujoco.MjModel, seconds: float) -> mujoco.MjData:
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, round(seconds / model.opt.timestep))
    return data


def bounds_of(parts: list[tuple[FloatArray, FloatArray]]) -> tuple[FloatArray, FloatArray]:
    return np.min([low for low, _ in parts], axis=0), np.max([high for _, high in parts], axis=0)


def distance_to(piece: Piece, points: FloatArray) -> FloatArray:
    """Signed distance (N,) of points (N, 3) from a piece's surface, m, negative inside."""
    local = (points - piece.centre) @ piece.rotation
    radius, half_length, _ = piece.size
    match piece.shape:
        case mujoco.mjtGeom.mjGEOM_BOX:
            return slab(2 * piece.size, (0, 0, 0), 0.0)(local)
        case mujoco.mjtGeom.mjGEOM_ELLIPSOID:
            return ball(2 * piece.size, (0, 0, 0))(local)
        case mujoco.mjtGeom.mjGEOM_CAPSULE:
            return limb((0, 0, -half_length), (0, 0, half_length), radius, radius)(local)
        case _:
            away = np.column_stack([np.hypot(local[:, 0], local[:, 1]) - radius, np.abs(local[:, 2]) - half_length])
            return np.linalg.norm(np.maximum(away, 0), axis=1) + np.minimum(away.max(axis=1), 0)


@pytest.fixture(params=object_names())
def model(request: pytest.FixtureRequest) -> ObjectModel:
    return make_object(request.param)


def test_what_is_seen_fills_the_stated_extent_about_the_origin(model: ObjectModel) -> None:
    low, high = bounds_of([visual.mesh.bounds for visual in model.visuals])
    np.testing.assert_allclose(high - low, model.extent, atol=1e-9)
    np.testing.assert_allclose(low + high, 0.0, atol=1e-9)
    assert model.rest_z == pytest.approx(model.extent[2] / 2)
    corner = np.linalg.norm(model.extent[:2]) / 2
    assert max(model.extent[:2]) / 2 - 1e-9 <= model.radius <= corner + 1e-9


def test_what_is_felt_has_the_extent_of_what_is_seen(model: ObjectModel) -> None:
    seen = np.array(bounds_of([visual.mesh.bounds for visual in model.visuals]))
    felt = np.array(bounds_of([piece.bounds for piece in model.pieces]))
    np.testing.assert_allclose(felt, seen, atol=0.0025)


def test_hardly_anything_that_is_seen_sticks_out_of_what_is_felt(model: ObjectModel) -> None:
    mesh = merge([visual.mesh for visual in model.visuals])
    corners = mesh.vertices[mesh.faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    outside = np.min([distance_to(piece, corners.mean(axis=1)) for piece in model.pieces], axis=0)
    assert area[outside > 0.003].sum() < 0.06 * area.sum()
    assert area[outside > 0.006].sum() == 0.0
    assert abs(np.median(outside)) < 0.001


def test_the_long_axis_is_x(model: ObjectModel) -> None:
    assert model.extent[0] >= model.extent[1] - 1e-9


def test_meshes_are_closed_light_and_right_side_out(model: ObjectModel) -> None:
    for visual in model.visuals:
        mesh = visual.mesh
        corners = mesh.vertices[mesh.faces]
        volume = np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6
        assert volume > 0
        assert len(mesh.faces) <= 6000
        normals = mesh.normals()
        np.testing.assert_allclose(np.linalg.norm(normals, axis=-1), 1.0, atol=1e-6)
        facing = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        assert (np.einsum("ij,icj->ic", facing, normals) > 0).mean() > 0.999
        if visual.finish.texture is not None:
            assert max(visual.finish.texture.shape) <= 256


def test_it_comes_to_rest_where_it_says_and_stays_there(model: ObjectModel) -> None:
    compiled = scene(model)
    data = settled(compiled, 1.0)
    start = data.body("thing0").xpos.copy()
    assert abs(start[2] - model.rest_z) < 0.003
    mujoco.mj_step(compiled, data, 1000)
    assert np.linalg.norm(data.body("thing0").xpos - start) < 0.002
    upright = data.body("thing0").xmat[8]
    assert np.degrees(np.arccos(min(1.0, upright))) < 2.0


def test_it_weighs_what_it_says(model: ObjectModel) -> None:
    compiled = scene(model)
    assert compiled.body("thing0").mass[0] == pytest.approx(model.mass)
    assert 0.005 < model.mass < 5.0


def test_cameras_see_visuals_and_fingers_feel_pieces(model: ObjectModel) -> None:
    compiled = scene(model)
    of_thing = compiled.geom_bodyid == compiled.body("thing0").id
    collides = (compiled.geom_contype != 0) | (compiled.geom_conaffinity != 0)
    assert np.array_equal(collides[of_thing], compiled.geom_group[of_thing] == COLLISION_GROUP)
    assert np.array_equal(~collides[of_thing], compiled.geom_group[of_thing] == VISUAL_GROUP)
    assert collides[of_thing].sum() <= 26


@pytest.mark.parametrize("kind", sorted(set(GRASPS) - VESSELS))
def test_two_fingers_can_lift_it_and_hold_it(kind: str) -> None:
    compiled = scene(make_object(kind), fingers=(*GRASPS[kind], 0.002))
    data = squeeze(compiled)
    travel(compiled, data, "lift", 0.10)
    assert data.body("thing0").xpos[2] > 0.09, "it was left behind"
    in_hand = data.body("thing0").xpos - data.body("wrist").xpos
    mujoco.mj_step(compiled, data, 1000)
    assert np.linalg.norm(data.body("thing0").xpos - data.body("wrist").xpos - in_hand) < 0.002


@pytest.mark.parametrize("kind", sorted(VESSELS))
def test_two_fingers_on_its_rim_can_drag_it_sideways(kind: str) -> None:
    compiled = scene(make_object(kind), fingers=(*GRASPS[kind], 0.008))
    data = squeeze(compiled)
    start = data.body("thing0").xpos.copy()
    travel(compiled, data, "drag", 0.12)
    np.testing.assert_allclose(data.body("thing0").xpos - start, [0.12, 0.0, 0.0], atol=0.010)


def test_every_kind_can_be_taken_but_the_heavy_ones() -> None:
    assert {kind for kind in object_names() if make_object(kind).fixed} == HEAVY
    assert set(GRASPS) == set(object_names()) - HEAVY


@pytest.mark.parametrize("kind", sorted(VESSELS))
def test_things_laid_on_it_rest_at_its_surface(kind: str) -> None:
    below, above = make_object(kind), make_object("block", size=0.03, colour="yellow")
    compiled = scene(below, above)
    data = mujoco.MjData(compiled)
    data.joint("thing1").qpos[:3] = [0.0, 0.0, below.surface_z + above.rest_z + 0.005]
    mujoco.mj_step(compiled, data, 500)
    assert data.body("thing1").xpos[2] - above.rest_z == pytest.approx(below.surface_z, abs=0.002)


@pytest.mark.parametrize(
    ("below", "above"),
    [("towel", "fork"), ("towel", "knife"), ("towel", "spoon"), ("plate", "egg"), ("plate", "carrot"), ("dish", "egg")],
)
def test_what_is_dropped_from_two_centimetres_lies_where_it_fell(below: str, above: str) -> None:
    base, thing = make_object(below), make_object(above)
    compiled = scene(base, thing)
    data = mujoco.MjData(compiled)
    target = np.array([0.0, 0.0, base.surface_z + thing.rest_z])
    data.joint("thing1").qpos[:3] = target + np.array([0.0, 0.0, 0.02])
    mujoco.mj_step(compiled, data, 1000)
    assert np.linalg.norm(data.body("thing1").xpos - target) < 0.002
    assert data.body("thing1").xmat[8] > np.cos(np.radians(2.0))


def test_a_marker_laid_into_the_palm_stays_there() -> None:
    hand, marker = make_object("hand"), make_object("marker")
    compiled = scene(hand, marker)
    for yaw in (0.0, 0.6, np.pi / 2):
        data = mujoco.MjData(compiled)
        palm = np.array([0.0, 0.0, hand.surface_z + marker.rest_z + 0.010])
        data.joint("thing1").qpos[:] = [*palm, np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)]
        mujoco.mj_step(compiled, data, 1000)
        at = data.body("thing1").xpos
        assert np.linalg.norm(at[:2]) < 0.03
        assert at[2] > hand.surface_z


@pytest.mark.parametrize("kind", sorted(VESSELS))
def test_it_slides_when_pushed(kind: str) -> None:
    model = make_object(kind)
    compiled = scene(model)
    data = settled(compiled, 0.2)
    data.body("thing0").xfrc_applied[0] = 9.81 * model.mass
    mujoco.mj_step(compiled, data, 100)
    assert data.body("thing0").xpos[0] > 0.005


def test_one_scene_holds_many_of_a_kind() -> None:
    names = [f"{kind}{copy}" for kind in ("red_chili", "block", "plate") for copy in range(2)]
    spec = mujoco.MjSpec()
    for name in names:
        attach(spec, make_object(name[:-1]), name)
    compiled = spec.compile()
    assert [compiled.body(name).name for name in names] == names
    assert compiled.nq == 7 * len(names)


def test_a_scene_of_six_compiles_quickly() -> None:
    models = [make_object(kind) for kind in ("plate", "red_chili", "banana", "toy", "corn", "hand")]
    started = time.perf_counter()
    scene(*models)
    assert time.perf_counter() - started < 1.0  # about 0.1 s; a loaded machine takes longer


@given(
    size=st.tuples(*[st.floats(0.01, 0.2)] * 3),
    colour=st.sampled_from(sorted(BLOCK_COLOURS)),
)
@settings(max_examples=25, deadline=None)
def test_blocks_have_the_size_they_were_asked_for(size: tuple[float, float, float], colour: str) -> None:
    block = make_object("block", size=size, colour=colour)
    np.testing.assert_allclose(block.extent, size, atol=1e-9)
    assert block.title == f"{colour} block"
    assert block.surface_z == pytest.approx(size[2])


def test_models_are_made_once() -> None:
    assert make_object("block", size=[0.03, 0.03, 0.03]) is make_object("block", size=(0.03, 0.03, 0.03))


def test_an_unknown_kind_names_the_nearest_one() -> None:
    with pytest.raises(UnknownNameError, match="'banana'"):
        make_object("bananna")


@pytest.mark.parametrize(
    ("kind", "params", "says"),
    [
        ("block", {"colour": "mauve"}, "mauve"),
        ("block", {"size": 1.0}, "edges"),
        ("block", {"size": float("nan")}, "edges"),
        ("block", {"size": (0.03, 0.03)}, "size"),
        ("block", {"size": "big"}, "size"),
        ("block", {"material": "oak"}, "size, colour"),
        ("plate", {"size": 0.3}, "no parameters"),
        ("red_chili", {"colour": "green"}, "no parameters"),
    ],
)
def test_bad_parameters_are_the_callers_to_fix(kind: str, params: dict[str, object], says: str) -> None:
    with pytest.raises(UsageError, match=says):
        make_object(kind, **params)
