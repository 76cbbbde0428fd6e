"""The nouns: what they refuse, and that nobody can change them behind another's back."""

from __future__ import annotations

import json
from dataclasses import FrozenInstanceError
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import TypeAdapter, ValidationError

from maniagent.geometry import make_transform, top_down_rotation
from maniagent.types import (
    ActionSequence,
    ActionStep,
    CameraFrame,
    GraspPose,
    Gripper,
    HereAnchor,
    KeyPoint,
    ObjectAnchor,
    ObjectInfo,
    Observation,
    Orientation,
    OrientedBox,
    Part,
    PointAnchor,
    RobotState,
    Subtask,
    Verdict,
)


def frame(**changes: Any) -> CameraFrame:
    parts = {
        "name": "main",
        "rgb": np.zeros((4, 6, 3), np.uint8),
        "depth": np.ones((4, 6), np.float32),
        "K": np.eye(3),
        "T_base_camera": make_transform(np.eye(3), [1.0, 2.0, 3.0]),
    }
    return CameraFrame(**parts | changes)


def robot_state() -> RobotState:
    return RobotState(np.zeros(6), np.eye(4), 0.04, 1.0)


def block(**changes: Any) -> ObjectInfo:
    parts: dict[str, Any] = {
        "index": 2,
        "name": "red block",
        "centre": [0.3, -0.1, 0.015],
        "extent": [0.05, 0.03, 0.03],
        "yaw": np.radians(30.0),
        "surface_z": 0.03,
        "colour": (200, 30, 40),
    }
    return ObjectInfo(**parts | changes)


# Sensor data --------------------------------------------------------------------------------------------------------


def test_a_frame_keeps_its_pictures_when_the_caller_changes_theirs() -> None:
    rgb, depth = np.zeros((4, 6, 3), np.uint8), np.ones((4, 6), np.float32)
    taken = frame(rgb=rgb, depth=depth)
    rgb[:], depth[:] = 255, 9.0
    assert taken.rgb.max() == 0
    assert taken.depth.max() == 1.0


def test_the_callers_arrays_stay_writable() -> None:
    rgb = np.zeros((4, 6, 3), np.uint8)
    frame(rgb=rgb)
    rgb[0, 0] = 1


@pytest.mark.parametrize("name", ["rgb", "depth", "K", "T_base_camera"])
def test_nobody_writes_into_a_frame(name: str) -> None:
    with pytest.raises(ValueError, match="read-only"):
        getattr(frame(), name)[0] = 0


def test_a_box_keeps_its_place_when_the_caller_moves_on() -> None:
    centre = np.zeros(3)
    box = OrientedBox(centre, np.ones(3), 0.0)
    centre[:] = 1.0
    assert not box.centre.any()
    with pytest.raises(ValueError, match=r"extent has shape \(2,\), wanted \(3,\)"):
        OrientedBox(centre, np.ones(2), 0.0)


def test_what_is_free_of_an_object_is_a_point_of_its_upper_side() -> None:
    spot = block(free_spot=[0.3, 0.1]).free_spot
    assert spot is not None
    np.testing.assert_array_equal(spot, [0.3, 0.1])
    with pytest.raises(ValueError, match="free_spot has shape"):
        block(free_spot=[0.3, 0.1, 0.0])


def test_nobody_writes_into_state_poses_and_objects() -> None:
    for array in (
        robot_state().joint_positions,
        robot_state().T_base_tcp,
        GraspPose(np.eye(4), 0.04, 1.0).T_base_grasp,
        KeyPoint(np.eye(4), Gripper.KEEP, "here").T_base_tcp,
        block().centre,
        block().box.extent,
    ):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0


def test_fields_can_not_be_replaced() -> None:
    with pytest.raises(FrozenInstanceError):
        robot_state().time = 2.0  # type: ignore[misc]  # the point of the test


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"rgb": np.zeros((4, 6))}, "rgb has shape"),
        ({"rgb": np.zeros((4, 6, 4))}, "rgb has shape"),
        ({"depth": np.zeros((6, 4))}, r"depth has shape \(6, 4\), wanted \(4, 6\)"),
        ({"K": np.eye(4)}, r"K has shape \(4, 4\), wanted \(3, 3\)"),
        ({"T_base_camera": np.eye(3)}, "T_base_camera has shape"),
    ],
)
def test_wrong_shapes_are_refused_by_name(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        frame(**changes)


def test_five_joints_are_one_too_few() -> None:
    with pytest.raises(ValueError, match="joint_positions has shape"):
        RobotState(np.zeros(5), np.eye(4), 0.04, 0.0)


def test_a_frame_knows_the_inverse_of_its_pose() -> None:
    np.testing.assert_allclose(frame().T_camera_base @ frame().T_base_camera, np.eye(4))


def test_the_main_view_is_one_of_the_frames() -> None:
    main = frame()
    assert Observation({"main": main}, "main", robot_state()).main_frame is main
    with pytest.raises(ValueError, match="main view 'front' is not among the frames"):
        Observation({"main": main}, "front", robot_state())


# Objects ------------------------------------------------------------------------------------------------------------


def test_an_object_is_told_in_one_line() -> None:
    assert str(block()) == (
        "[2] red block: centre (0.300, -0.100, 0.015) m, extent 0.050 x 0.030 x 0.030 m, yaw 30 deg"
    )


def test_the_told_grasp_has_the_yaw_of_the_closing_axis() -> None:
    grasp = GraspPose(make_transform(top_down_rotation(np.radians(-60.0)), [0.3, -0.1, 0.012]), 0.04, 0.9)
    worse = GraspPose(np.eye(4), 0.04, 0.1)
    told = block(grasps=(grasp, worse))
    assert told.grasp is grasp
    assert str(told).endswith("grasp at (0.300, -0.100, 0.012) yaw -60 deg")


def test_an_object_reaches_from_its_bottom_to_its_top() -> None:
    assert (block().bottom_z, block().top_z) == pytest.approx((0.0, 0.03))
    box = block().box
    np.testing.assert_array_equal(box.centre, block().centre)
    assert box.yaw == block().yaw


# What agents write --------------------------------------------------------------------------------------------------

STEP: dict[str, Any] = {"description": "go there", "anchor": {"index": 0}}
anchors: TypeAdapter[ObjectAnchor | PointAnchor | HereAnchor] = TypeAdapter(ObjectAnchor | PointAnchor | HereAnchor)


def step(**changes: Any) -> ActionStep:
    return ActionStep.model_validate_json(json.dumps(STEP | changes))


@pytest.mark.parametrize(
    ("written", "kind"),
    [
        ({"index": 0}, ObjectAnchor),
        ({"index": 3, "part": "grasp"}, ObjectAnchor),
        ({"x": 0.3, "y": 0.1}, PointAnchor),
        ({"x": 0, "y": 0, "z": 0}, PointAnchor),
        ({"here": True}, HereAnchor),
    ],
)
def test_the_three_kinds_of_anchor_are_told_apart(written: dict[str, Any], kind: type) -> None:
    assert type(step(anchor=written).anchor) is kind


@pytest.mark.parametrize(
    "anchor",
    [
        {},
        {"here": False},
        {"index": 0, "x": 0.1, "y": 0.1},
        {"index": 0, "here": True},
        {"x": 0.1},
        {"index": -1},
        {"index": 64},
        {"index": 0.5},
        {"index": 0, "part": "handle"},
        {"x": 2.1, "y": 0.0},
        {"x": "1e400", "y": 0.0},
        {"x": 0.1, "y": 0.1, "frame": "camera"},
        "centre",
        None,
        [0.1, 0.2, 0.3],
    ],
)
def test_wrong_anchors_are_refused(anchor: object) -> None:
    with pytest.raises(ValidationError):
        step(anchor=anchor)


@pytest.mark.parametrize("number", [float("nan"), float("inf"), -float("inf"), 1e300, 2.0001])
@pytest.mark.parametrize("where", ["anchor", "offset", "yaw"])
def test_numbers_that_are_not_finite_or_huge_are_refused(where: str, number: float) -> None:
    written: dict[str, dict[str, Any]] = {
        "anchor": {"anchor": {"x": number, "y": 0.0}},
        "offset": {"offset": (0.0, 0.0, number)},
        "yaw": {"orientation": {"kind": "top-down", "yaw": 10 * number}},
    }
    changes = written[where]
    with pytest.raises(ValidationError):
        ActionStep.model_validate(STEP | changes)
    with pytest.raises(ValidationError):
        step(**changes)


@pytest.mark.parametrize(
    "changes",
    [
        {"speed": 3.0},
        {"description": ""},
        {"description": "x" * 501},
        {"offset": [0.0, 0.0]},
        {"offset_frame": "camera"},
        {"carrying": 64},
        {"gripper": "crush"},
        {"orientation": {"kind": "grasp"}},
        {"orientation": {"kind": "keep", "index": 1}},
        {"orientation": {"kind": "upside-down"}},
        {"orientation": {"kind": "top-down", "roll": 1.0}},
    ],
    ids=str,
)
def test_steps_that_do_not_fit_the_schema_are_refused(changes: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        step(**changes)


def test_a_sequence_has_one_to_forty_steps() -> None:
    assert len(ActionSequence(skill="drag", steps=(step(),) * 40).steps) == 40
    for steps in ((), (step(),) * 41):
        with pytest.raises(ValidationError):
            ActionSequence(skill="drag", steps=steps)
    with pytest.raises(ValidationError):
        ActionSequence(skill="x" * 41, steps=(step(),))


def test_what_is_written_can_not_be_rewritten() -> None:
    with pytest.raises(ValidationError, match="frozen"):
        step().gripper = Gripper.OPEN


metres = st.floats(-2.0, 2.0)
indices = st.integers(0, 63)
orientations = st.one_of(
    st.builds(Orientation, kind=st.just("grasp"), index=indices),
    st.builds(
        Orientation,
        kind=st.sampled_from(["top-down", "turn", "keep"]),
        index=st.none(),
        yaw=st.floats(-2 * np.pi, 2 * np.pi),
    ),
)
steps = st.builds(
    ActionStep,
    description=st.text(min_size=1, max_size=500),
    anchor=st.one_of(
        st.builds(ObjectAnchor, index=indices, part=st.sampled_from(Part)),
        st.builds(PointAnchor, x=metres, y=metres, z=metres),
        st.builds(HereAnchor, here=st.just(True)),
    ),
    offset=st.tuples(metres, metres, metres),
    offset_frame=st.sampled_from(["base", "viewer"]),
    carrying=st.none() | indices,
    orientation=orientations,
    gripper=st.sampled_from(Gripper),
)


@given(st.builds(ActionSequence, skill=st.text(min_size=1, max_size=40), steps=st.lists(steps, min_size=1, max_size=5)))
def test_a_sequence_survives_json(sequence: ActionSequence) -> None:
    assert ActionSequence.model_validate_json(sequence.model_dump_json()) == sequence


subtasks = st.builds(
    Subtask,
    previous=st.sampled_from(Verdict),
    reason=st.text(max_size=2000),
    text=st.text(min_size=1, max_size=500),
    objects=st.lists(st.text(min_size=1, max_size=500), min_size=1, max_size=4),
)


@given(subtasks)
def test_a_subtask_survives_json(subtask: Subtask) -> None:
    assert Subtask.model_validate_json(subtask.model_dump_json()) == subtask


@pytest.mark.parametrize(
    "written",
    [
        {"text": "put it there", "objects": ["every cup"]},
        {"done": True},
        {"cannot": True},
    ],
)
def test_a_subtask_is_something_to_do_or_an_end(written: dict[str, Any]) -> None:
    assert Subtask(previous=Verdict.INITIAL, reason="", **written)


@pytest.mark.parametrize(
    "written",
    [
        {},
        {"text": "put it there"},
        {"objects": ["every cup"]},
        {"text": "put it there", "objects": [""]},
        {"text": "put it there", "objects": ["every cup"] * 65},
        {"done": True, "cannot": True},
        {"done": True, "confidence": 1.0},
        {"text": "x" * 501, "objects": ["every cup"]},
        {"previous": "perhaps", "done": True},
        {"reason": "x" * 2001, "done": True},
    ],
    ids=lambda written: str(written)[:40],
)
def test_a_subtask_that_is_neither_or_both_is_refused(written: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        Subtask.model_validate({"previous": "initial", "reason": ""} | written)
