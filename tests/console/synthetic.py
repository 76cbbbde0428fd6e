"""A made-up run as the loop would tell it: two attempts at one sub-task, the first fails, then all is done."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from PIL import Image, ImageDraw

from maniagent.geometry import (
    FloatArray,
    invert_transform,
    look_at,
    make_transform,
    project,
    top_down_rotation,
    transform_points,
)
from maniagent.types import (
    ActionSequence,
    ActionStep,
    CameraFrame,
    Detection,
    Event,
    ExecutionReport,
    GraspPose,
    Gripper,
    KeyPoint,
    ObjectAnchor,
    ObjectInfo,
    Observation,
    Orientation,
    Part,
    RobotState,
    RunResult,
    RunVerdict,
    SceneDescription,
    Subtask,
    SubtaskRecord,
    Verdict,
)

WIDTH, HEIGHT = 640, 480
INSTRUCTION = "put the carrot on the plate"
CARROT, PLATE = (0.26, 0.10, 0.015), (0.30, -0.10, 0.01)
EYES = {"main": (0.85, 0.0, 0.55), "side": (0.25, 0.75, 0.45)}


def camera(name: str, width: int = WIDTH, height: int = HEIGHT) -> CameraFrame:
    """A view of a table with a carrot and a plate, drawn by projecting their outlines."""
    K = np.array([[1.1 * width, 0, width / 2], [0, 1.1 * width, height / 2], [0, 0, 1]])
    T_base_camera = look_at(EYES[name], (0.25, 0.0, 0.0))
    rows = np.linspace(0, 1, height)[:, None, None]
    table = np.array([176, 141, 104]) * (0.75 + 0.35 * rows) + np.zeros((height, width, 3))
    image = Image.fromarray(table.clip(0, 255).astype(np.uint8))
    draw = ImageDraw.Draw(image)
    for centre, (length, breadth), colour in (
        (PLATE, (0.10, 0.10), (238, 238, 232)),
        (CARROT, (0.06, 0.016), (233, 120, 34)),
    ):
        outline = _outline(K, T_base_camera, centre, length, breadth)
        draw.polygon([tuple(point) for point in outline.tolist()], fill=colour)
    depth = np.linspace(1.1, 0.55, height, dtype=np.float32)[:, None] + np.zeros((height, width), np.float32)
    depth[:, : width // 40] = np.nan
    return CameraFrame(name, np.asarray(image), depth, K, T_base_camera)


def _outline(K: FloatArray, T_base_camera: FloatArray, centre: Any, length: float, breadth: float) -> FloatArray:
    angle = np.linspace(0, 2 * np.pi, 48)
    ring = np.stack([length * np.cos(angle), breadth * np.sin(angle), np.zeros(48)], axis=1) + centre
    return project(K, transform_points(invert_transform(T_base_camera), ring))


def observation(width: int = WIDTH, height: int = HEIGHT) -> Observation:
    state = RobotState(np.zeros(6), make_transform(top_down_rotation(0), (0.2, 0, 0.24)), 0.048, 1.5)
    return Observation({name: camera(name, width, height) for name in EYES}, "main", state)


def detection(frame: CameraFrame, query: str, centre: Any, size: tuple[float, float], score: float) -> Detection:
    outline = _outline(frame.K, frame.T_base_camera, centre, *size)
    mask = Image.new("1", (frame.rgb.shape[1], frame.rgb.shape[0]))
    ImageDraw.Draw(mask).polygon([tuple(point) for point in outline.tolist()], fill=1)
    (x0, y0), (x1, y1) = outline.min(axis=0), outline.max(axis=0)
    return Detection(query, (float(x0), float(y0), float(x1), float(y1)), score, frame.name, np.asarray(mask))


def grasp(point: Any, yaw: float = 0.0) -> GraspPose:
    return GraspPose(make_transform(top_down_rotation(yaw), point), 0.044, 0.91)


def objects() -> tuple[ObjectInfo, ...]:
    carrot = ObjectInfo(
        0, "carrot", np.array(CARROT), np.array((0.12, 0.03, 0.03)), 0.0, 0.03, (233, 120, 34), (grasp(CARROT),)
    )
    plate = ObjectInfo(1, "plate", np.array(PLATE), np.array((0.2, 0.2, 0.02)), 0.0, 0.008, (238, 238, 232))
    return carrot, plate


def sequence() -> ActionSequence:
    held = Orientation(kind="grasp", index=0)

    def step(text: str, index: int, part: Part, up: float, gripper: Gripper = Gripper.KEEP, **more: Any) -> ActionStep:
        anchor = ObjectAnchor(index=index, part=part)
        return ActionStep(description=text, anchor=anchor, offset=(0, 0, up), gripper=gripper, **more)

    steps = (
        step("go above the carrot with open fingers", 0, Part.GRASP, 0.1, Gripper.OPEN, orientation=held),
        step("go down to the carrot", 0, Part.GRASP, 0.0, Gripper.CLOSE, orientation=held),
        step("lift the carrot", 0, Part.GRASP, 0.12),
        step("carry the carrot above the plate", 1, Part.SURFACE, 0.1, carrying=0),
        step("put the carrot down", 1, Part.SURFACE, 0.01, Gripper.OPEN, carrying=0),
        step("move away", 1, Part.SURFACE, 0.15),
    )
    return ActionSequence(skill="pick-and-place", steps=steps)


def keypoints() -> tuple[KeyPoint, ...]:
    pose = make_transform(top_down_rotation(0), CARROT)
    return tuple(KeyPoint(pose, step.gripper, step.description) for step in sequence().steps)


def result(instruction: str = INSTRUCTION, verdict: RunVerdict = RunVerdict.ACHIEVED) -> RunResult:
    slipped = ExecutionReport(False, 3, "the carrot slipped out of the fingers while it was lifted", "grasp")
    records = (
        SubtaskRecord(
            instruction, objects(), slipped, Verdict.FAILURE, "the carrot still lies on the table", ("carrot", "plate")
        ),
        SubtaskRecord(
            instruction,
            objects(),
            ExecutionReport(True, 6),
            Verdict.SUCCESS,
            "the carrot lies on the plate",
            ("carrot", "plate"),
        ),
    )
    stages = ("observe", "scene", "reasoning", "detection", "control", "planning", "execution")
    seconds = dict(zip(stages, (0.41, 0.32, 0.02, 0.55, 0.01, 0.24, 6.9), strict=True))
    return RunResult(instruction, verdict, "The carrot lies on the plate.", records, seconds)


def events(
    instruction: str = INSTRUCTION,
    *,
    achieved: bool | None = True,
    size: tuple[int, int] = (WIDTH, HEIGHT),
    frames: int = 12,
) -> Iterator[Event]:
    """All events of the run in order; `frames` video frames a turn of moving, pictures of `size`."""
    clock, robot_time = 0.0, 0.0

    def event(kind: str, later: float = 0.0, /, **data: Any) -> Event:
        nonlocal clock
        clock += later
        return Event(kind, clock, data)

    yield event("run_started", instruction=instruction, task="carrot-on-plate", seed=3, agents="rules")
    seen = observation(*size)
    for turn in (1, 2, 3):
        yield event("observed", 0.13, turn=turn, observation=seen)
        yield event(
            "described", 0.11, turn=turn, scene=SceneDescription("A carrot lies to the right of a plate.", objects())
        )
        yield event("reasoned", 0.02, turn=turn, subtask=_subtask(turn, instruction))
        if turn == 3:
            break
        found = (
            detection(seen.main_frame, "carrot", CARROT, (0.06, 0.016), 0.93),
            detection(seen.main_frame, "plate", PLATE, (0.10, 0.10), 0.88),
        )
        yield event("located", 0.27, turn=turn, objects=objects(), detections=found)
        yield event("planned", 0.01, turn=turn, sequence=sequence(), keypoints=keypoints())
        for step in sequence().steps[: 3 if turn == 1 else 6]:
            yield event("move", 0.12, turn=turn, description=step.description, seconds=1.2)
            for _ in range(frames):
                robot_time += 0.1
                yield event("frame", 0.05, rgb=seen.main_frame.rgb, robot_time=robot_time)
        report = result().subtasks[turn - 1].outcome
        yield event("executed", 0.05, turn=turn, report=report)
        if not report.completed:
            yield event("failed", turn=turn, stage=report.stage, reason=report.reason)
    yield event("run_finished", 0.01, result=result(instruction), achieved=achieved)


def _subtask(turn: int, instruction: str) -> Subtask:
    text, wanted = instruction[:500], ("carrot", "plate")
    if turn == 1:
        return Subtask(previous=Verdict.INITIAL, reason="Nothing has been done yet.", text=text, objects=wanted)
    if turn == 2:
        return Subtask(
            previous=Verdict.FAILURE, reason="The carrot still lies on the table.", text=text, objects=wanted
        )
    return Subtask(previous=Verdict.SUCCESS, reason="The carrot lies on the plate.", done=True)
