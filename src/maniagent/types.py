"""The nouns every room speaks: what is seen, what is wanted, what is to be done, what happened.

Units are metres, radians, seconds. The base frame is the robot's: x forward, y left, z up, the table top at z = 0.
Transforms are named `T_to_from`. Sensor data are frozen dataclasses over read-only arrays; what a language model
may write (sub-tasks, action sequences) are frozen pydantic models that reject unknown fields, non-finite numbers
and overlong strings.
"""

from __future__ import annotations

import enum
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, model_validator

from .geometry import FloatArray, invert_transform

BoolArray = NDArray[np.bool_]


def _frozen(array: Any, shape: tuple[int | None, ...], dtype: Any, name: str) -> NDArray[Any]:
    """A read-only copy-if-needed of `array`, its shape checked (None matches any length)."""
    out = np.array(array, dtype=dtype)  # a copy: the caller's array stays the caller's
    if len(out.shape) != len(shape) or any(w is not None and w != g for g, w in zip(out.shape, shape, strict=True)):
        raise ValueError(f"{name} has shape {out.shape}, wanted {shape}")
    out.setflags(write=False)
    return out


# What is seen ---------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class CameraFrame:
    """One calibrated RGB-D image; colour and depth are aligned pixel by pixel."""

    name: str
    rgb: NDArray[np.uint8]
    """(H, W, 3) uint8."""
    depth: NDArray[np.float32]
    """(H, W) float32, z-depth in metres, NaN where nothing is known."""
    K: FloatArray
    """(3, 3) pinhole intrinsics, pixels."""
    T_base_camera: FloatArray
    """(4, 4) camera pose in the base frame; OpenCV axes (x right, y down, z forward)."""

    def __post_init__(self) -> None:
        rgb = _frozen(self.rgb, (None, None, 3), np.uint8, "rgb")
        object.__setattr__(self, "rgb", rgb)
        object.__setattr__(self, "depth", _frozen(self.depth, rgb.shape[:2], np.float32, "depth"))
        object.__setattr__(self, "K", _frozen(self.K, (3, 3), np.float64, "K"))
        object.__setattr__(self, "T_base_camera", _frozen(self.T_base_camera, (4, 4), np.float64, "T_base_camera"))

    @property
    def T_camera_base(self) -> FloatArray:
        """(4, 4): base-frame points to camera-frame points."""
        return invert_transform(self.T_base_camera)


@dataclass(frozen=True)
class RobotState:
    """What the robot's own sensors say."""

    joint_positions: FloatArray
    """(6,) rad: waist, shoulder, elbow, forearm_roll, wrist_angle, wrist_rotate."""
    T_base_tcp: FloatArray
    """(4, 4) pose of the tool centre point, between the fingertips; x approach, y closing axis."""
    gripper_opening: float
    """Distance between the finger pads, m."""
    time: float
    """Seconds since the robot was started (simulated time in simulation)."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "joint_positions", _frozen(self.joint_positions, (6,), np.float64, "joint_positions"))
        object.__setattr__(self, "T_base_tcp", _frozen(self.T_base_tcp, (4, 4), np.float64, "T_base_tcp"))


@dataclass(frozen=True)
class Observation:
    """All that agents ever learn about the world: calibrated images and the robot's own state."""

    frames: Mapping[str, CameraFrame]
    main: str
    """Name of the frame that shows the table as the person who instructs sees it."""
    robot: RobotState

    def __post_init__(self) -> None:
        if self.main not in self.frames:
            raise ValueError(f"main view {self.main!r} is not among the frames {sorted(self.frames)}")

    @property
    def main_frame(self) -> CameraFrame:
        """The main view."""
        return self.frames[self.main]


# What is found --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Detection:
    """Where one queried object appears in one view."""

    query: str
    box: tuple[float, float, float, float]
    """x_min, y_min, x_max, y_max in pixels."""
    score: float
    """Confidence in [0, 1]."""
    frame: str
    """Name of the CameraFrame."""
    mask: BoolArray | None = None
    """(H, W), True on the object."""


@dataclass(frozen=True)
class GraspPose:
    """A parallel-jaw grasp: where the TCP goes before the fingers close."""

    T_base_grasp: FloatArray
    """(4, 4) TCP pose in the base frame: x approach, y closing axis."""
    opening: float
    """Finger opening to approach with, m."""
    score: float
    """Quality in [0, 1], larger is better."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_base_grasp", _frozen(self.T_base_grasp, (4, 4), np.float64, "T_base_grasp"))


@dataclass(frozen=True)
class OrientedBox:
    """An upright box turned about z: what motion planning keeps clear of."""

    centre: FloatArray
    """(3,) m, base frame."""
    extent: FloatArray
    """(3,) m, full lengths along the box's own x, its own y, and z."""
    yaw: float
    """rad, direction of the box's own x axis in the base xy plane."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "centre", _frozen(self.centre, (3,), np.float64, "centre"))
        object.__setattr__(self, "extent", _frozen(self.extent, (3,), np.float64, "extent"))


@dataclass(frozen=True)
class ObjectInfo:
    """One object on the table, located in 3-D; what a controller writes action sequences about."""

    index: int
    name: str
    centre: FloatArray
    """(3,) m, base frame, middle of the object's bounding box."""
    extent: FloatArray
    """(3,) m, full lengths: along `yaw`, across it, and height."""
    yaw: float
    """rad in (-pi/2, pi/2], direction of the longer horizontal side."""
    surface_z: float
    """m, base frame: height at the object's middle on which a thing put there comes to rest."""
    colour: tuple[int, int, int]
    """Median RGB, 0 to 255."""
    grasps: tuple[GraspPose, ...] = ()
    """Best first; empty where the object can't be grasped or no grasp was asked for."""
    free_spot: FloatArray | None = None
    """(2,) m, base frame: the middle of what is free of its upper side; None where nothing lies on it yet."""

    def __post_init__(self) -> None:
        if self.free_spot is not None:
            object.__setattr__(self, "free_spot", _frozen(self.free_spot, (2,), np.float64, "free_spot"))
        object.__setattr__(self, "centre", _frozen(self.centre, (3,), np.float64, "centre"))
        object.__setattr__(self, "extent", _frozen(self.extent, (3,), np.float64, "extent"))

    @property
    def grasp(self) -> GraspPose | None:
        """The best grasp, or None."""
        return self.grasps[0] if self.grasps else None

    @property
    def bottom_z(self) -> float:
        """Height of the lowest point, m."""
        return float(self.centre[2] - self.extent[2] / 2)

    @property
    def top_z(self) -> float:
        """Height of the highest point, m."""
        return float(self.centre[2] + self.extent[2] / 2)

    @property
    def box(self) -> OrientedBox:
        """The bounding box."""
        return OrientedBox(self.centre, self.extent, self.yaw)

    def __str__(self) -> str:
        """One line for a language model: metres to the millimetre, degrees."""
        x, y, z = self.centre
        length, width, height = self.extent
        grasp = ""
        if self.grasp is not None:
            gx, gy, gz = self.grasp.T_base_grasp[:3, 3]
            turned = np.degrees(np.arctan2(-self.grasp.T_base_grasp[0, 1], self.grasp.T_base_grasp[1, 1]))
            grasp = f", grasp at ({gx:.3f}, {gy:.3f}, {gz:.3f}) yaw {turned:.0f} deg"
        free = ""
        if self.free_spot is not None:
            free = f", something lies on it, free about ({self.free_spot[0]:.3f}, {self.free_spot[1]:.3f})"
        return (
            f"[{self.index}] {self.name}: centre ({x:.3f}, {y:.3f}, {z:.3f}) m, "
            f"extent {length:.3f} x {width:.3f} x {height:.3f} m, yaw {np.degrees(self.yaw):.0f} deg{grasp}{free}"
        )


@dataclass(frozen=True)
class SceneDescription:
    """What the SceneAgent says of the table: text, and positions where they were asked for."""

    text: str
    objects: tuple[ObjectInfo, ...] = ()


# What is wanted -------------------------------------------------------------------------------------------------

Text = Annotated[str, Field(min_length=1, max_length=500)]
Metres = Annotated[float, Field(ge=-2.0, le=2.0, allow_inf_nan=False)]
Radians = Annotated[float, Field(ge=-2 * np.pi, le=2 * np.pi, allow_inf_nan=False)]


class _Written(BaseModel):
    """Base of what agents write: immutable, nothing unknown, nothing infinite."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class Verdict(enum.StrEnum):
    """What became of the previous sub-task."""

    INITIAL = "initial"
    """There was none."""
    SUCCESS = "success"
    FAILURE = "failure"


class Subtask(_Written):
    """The ReasoningAgent's answer: a judgement of the past and the one next thing to do."""

    previous: Verdict
    reason: Annotated[str, Field(max_length=2000)]
    """Evidence for `previous`; with `done` or `cannot`, why."""
    done: bool = False
    """The whole instruction is carried out; `text` and `objects` are empty."""
    cannot: bool = False
    """The instruction can't be carried out; `reason` says why."""
    text: Annotated[str, Field(max_length=500)] = ""
    """The sub-task in one imperative sentence."""
    objects: Annotated[tuple[Text, ...], Field(max_length=64)] = ()
    """Queries for the objects the sub-task needs, in the order of their indices."""

    @model_validator(mode="after")
    def _one_of_three(self) -> Subtask:
        if self.done and self.cannot:
            raise ValueError("a sub-task can't be both done and cannot")
        if not (self.done or self.cannot) and not (self.text and self.objects):
            raise ValueError("a sub-task that is neither done nor cannot needs text and objects")
        return self


class Part(enum.StrEnum):
    """Which point of an object an anchor means. Sides are as seen in the main view."""

    CENTRE = "centre"
    """Middle of the bounding box."""
    GRASP = "grasp"
    """Where its best grasp puts the TCP."""
    SURFACE = "surface"
    """Middle of the object's upper side, at the height where a thing put onto it comes to rest."""
    FREE = "free"
    """Middle of what is still free of its upper side; the same as SURFACE where nothing lies on it."""
    TOP = "top"
    """Middle of the object at the height of its highest point."""
    BASE = "base"
    """Middle of its underside."""
    LEFT = "left"
    """On the table beside the object, a hand's gap clear of it; likewise the other three."""
    RIGHT = "right"
    NEAR = "near"
    """On the viewer's side."""
    FAR = "far"
    """On the far side from the viewer."""


class ObjectAnchor(_Written):
    """A point that moves with object `index`."""

    index: Annotated[int, Field(ge=0, le=63)]
    part: Part = Part.CENTRE


class PointAnchor(_Written):
    """A fixed point on or above the table, base frame."""

    x: Metres
    y: Metres
    z: Metres = 0.0


class HereAnchor(_Written):
    """Where the step before leaves the TCP; for ways straight up."""

    here: Literal[True]


class Orientation(_Written):
    """How the gripper is turned at a step."""

    kind: Literal["grasp", "top-down", "turn", "align", "keep"] = "keep"
    """grasp: as the best grasp of object `index`. top-down: straight down, closing axis at `yaw`. turn: the
    orientation of the step before, turned by `yaw` about the vertical. align: turned about the vertical until the
    long side of what is in the gripper points along `yaw`, counter-clockwise from the viewer's right or, with `frame`
    "base", from base x; the shorter way round unless `end` says which end shall point there. keep: as at the step
    before."""
    index: Annotated[int, Field(ge=0, le=63)] | None = None
    yaw: Radians = 0.0
    end: Radians | None = None
    """For align: the end that pointed nearest to this direction (measured as `yaw` is) when it was taken."""
    frame: Literal["viewer", "base"] = "viewer"
    """For align: what `yaw` and `end` count from."""

    @model_validator(mode="after")
    def _grasp_has_index(self) -> Orientation:
        if (self.kind == "grasp") != (self.index is not None):
            raise ValueError("orientation needs an object index with kind 'grasp', and only then")
        if self.end is not None and self.kind != "align":
            raise ValueError("orientation says an end with kind 'align' only")
        return self


class Gripper(enum.StrEnum):
    """What the fingers do once a step's pose is reached."""

    OPEN = "open"
    CLOSE = "close"
    KEEP = "keep"


class ActionStep(_Written):
    """One Cartesian key point, stated relative to objects, so that it holds when they move."""

    description: Text
    anchor: ObjectAnchor | PointAnchor | HereAnchor
    offset: tuple[Metres, Metres, Metres] = (0.0, 0.0, 0.0)
    """m, added to the anchor: along base x, y, z; or, with `offset_frame` "viewer", to the viewer's right, away from
    the viewer, and up."""
    offset_frame: Literal["base", "viewer"] = "base"
    carrying: Annotated[int, Field(ge=0, le=63)] | None = None
    """Index of the object in the gripper: then the middle of its underside, not the TCP, arrives at the target."""
    orientation: Orientation = Orientation()
    gripper: Gripper = Gripper.KEEP


class ActionSequence(_Written):
    """What the ControllerAgent writes and the cache keeps."""

    skill: Annotated[str, Field(min_length=1, max_length=40)]
    """pick-and-place, drag, rotate, or a model's own name for it."""
    steps: Annotated[tuple[ActionStep, ...], Field(min_length=1, max_length=40)]


@dataclass(frozen=True)
class KeyPoint:
    """An ActionStep bound to today's objects."""

    T_base_tcp: FloatArray
    """(4, 4) where the TCP goes."""
    gripper: Gripper
    """What the fingers do there, after arriving."""
    description: str
    opening: float | None = None
    """m, finger opening for `Gripper.OPEN`; None opens fully."""
    touches: frozenset[int] = frozenset()
    """Indices of the objects that the move towards this key point may come into contact with."""
    held: int | None = None
    """Index of the object that is in the gripper on the way to this key point."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_base_tcp", _frozen(self.T_base_tcp, (4, 4), np.float64, "T_base_tcp"))


# What happened --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class ExecutionReport:
    """What the robot says after it was asked to visit key points."""

    completed: bool
    """All key points were reached and what had to be held was held."""
    reached: int
    """How many key points were reached."""
    reason: str = ""
    """Why it stopped early, in one sentence; empty when completed."""
    stage: str = ""
    """A FailureStage value when not completed."""


@dataclass(frozen=True)
class SubtaskRecord:
    """One remembered turn: what was tried, on which objects, and what came of it."""

    text: str
    objects: tuple[ObjectInfo, ...]
    """As they were before the attempt; empty when they were not found."""
    outcome: ExecutionReport
    verdict: Verdict = Verdict.INITIAL
    """As judged on the following turn; INITIAL until then."""
    evidence: str = ""
    queries: tuple[str, ...] = ()
    surroundings: tuple[ObjectInfo, ...] = ()
    """Everything else that was on the table, as it was before the attempt."""
    sequence: ActionSequence | None = None
    """What the robot was told to do; None where no sequence was accepted, so that nothing moved."""


@dataclass(frozen=True)
class Event:
    """One line of a run's log."""

    kind: str
    time: float
    """Seconds since the run began (wall clock)."""
    data: Mapping[str, Any] = field(default_factory=dict)


class RunVerdict(enum.StrEnum):
    """What the agents believe at the end of a run."""

    ACHIEVED = "achieved"
    CANNOT = "cannot"
    """The agents gave up and say why."""
    OUT_OF_BUDGET = "out_of_budget"
    ABORTED = "aborted"
    """Stopped from outside (Ctrl-C) or by an unrecoverable fault."""


@dataclass(frozen=True)
class RunResult:
    """The outcome of one instruction, as the agents see it."""

    instruction: str
    verdict: RunVerdict
    reason: str
    subtasks: tuple[SubtaskRecord, ...]
    seconds: Mapping[str, float]
    """Wall seconds by stage: observe, scene, reasoning, detection, control, planning, execution."""
