"""Records an episode while the robot carries it out: rows at a fixed rate, made of what the robot tells as it moves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ..errors import CameraFailure, StageFailure
from ..geometry import FloatArray
from ..robots.sampling import RecordableRobot, Sample, Sampling
from ..types import Event
from .episode import Recording, Steps

STILL_JOINT = 0.002
"""rad from one row to the next up to which a joint stands still: about the arm's encoder step."""
STILL_OPENING = 0.0005
"""m, likewise for the fingers."""


@dataclass(frozen=True)
class RecorderSettings:
    """What becomes of the samples."""

    trim: float | None = 0.3
    """s in which nothing moves that are left at the beginning and at the end; None keeps all."""
    by_move: bool = False
    """Whether a row's text is the move's description ("Lift it") instead of the sub-task's."""
    max_age: float = 0.1
    """s by which a picture may be older than its sample."""


class EpisodeRecorder:
    """Turns one robot's samples into Recordings, one after another: `begin`, let the robot move, `finish`.

    It is an agents' Observer, too: in a run of the loop the rows' texts come by themselves. Whoever moves the robot
    otherwise sets `subtask`.
    """

    def __init__(
        self,
        robot: RecordableRobot,
        sampling: Sampling = Sampling(),  # noqa: B008 - frozen
        settings: RecorderSettings = RecorderSettings(),
    ) -> None:
        self._robot, self._sampling, self._settings = robot, sampling, settings
        self._samples: list[Sample] = []
        self._texts: list[str] = []
        self.subtask = ""
        """What the robot is doing; goes into every row from now on."""
        self.failure: CameraFailure | None = None
        """Why the recording ended before the episode; None while all is well."""

    def begin(self, subtask: str = "", seed: int | None = None) -> None:
        """Record from the next movement on; whatever was recorded and not finished is dropped.

        `seed`, where given, draws the pictures' noise instead of the settings' own.
        """
        self._samples, self._texts = [], []
        self.subtask, self.failure = subtask, None
        sampling = self._sampling if seed is None else self._sampling.model_copy(update={"seed": seed})
        self._robot.start_sampling(self, sampling)

    def finish(self) -> Recording:
        """End the recording and return it.

        Raises CameraFailure where a camera stopped on the way: what came after would have been recorded blindly.
        Raises StageFailure where nothing moved.
        """
        samples, texts = self._samples, self._texts
        self.cancel()
        if self.failure is not None:
            raise self.failure
        kept = range(len(samples)) if self._settings.trim is None else self._moving_rows(samples)
        if not kept:
            raise StageFailure("Nothing moved while the episode was recorded.")
        # What the robot did before it was told of a sub-task, it did to get ready for that.
        first = next(filter(None, texts), "")
        texts = [text or first for text in texts]
        return to_recording(samples[kept.start : kept.stop], texts[kept.start : kept.stop])

    def cancel(self) -> None:
        """End the recording and drop it."""
        self._robot.stop_sampling()
        self._samples, self._texts = [], []

    # What the robot and the loop tell ------------------------------------------------------------------------------

    def on_sample(self, sample: Sample) -> None:
        """Add a row, unless a picture of it is an old one."""
        if self.failure is not None:
            return
        for name, picture in sample.pictures.items():
            if (age := sample.time - picture.time) > self._settings.max_age:
                self.on_camera_failure(
                    CameraFailure(f"The {name} camera stopped: its last picture is {age:.1f} s old; see its cable.")
                )
                return
        self._samples.append(sample)
        self._texts.append(self.subtask)

    def on_camera_failure(self, failure: CameraFailure) -> None:
        """End the recording: there will be no row without its pictures."""
        self.failure = self.failure or failure
        self._samples, self._texts = [], []

    def on_event(self, event: Event) -> None:
        """Hear from the loop what the robot does next."""
        if event.kind == "reasoned":
            # The agents' last word names no sub-task: on its way home the robot still finishes the one before.
            self.subtask = event.data["subtask"].text or self.subtask
        elif event.kind == "move" and self._settings.by_move:
            self.subtask = event.data["description"]

    def _moving_rows(self, samples: Sequence[Sample]) -> range:
        """The rows from the first to the last in which anything moves, and `trim` seconds around them."""
        if not samples:
            return range(0)
        moving = np.flatnonzero(_moves(samples))
        if not len(moving):
            return range(0)
        margin = round((self._settings.trim or 0.0) * self._sampling.rate)
        return range(max(0, moving[0] - margin), min(len(samples), moving[-1] + 2 + margin))


def _moves(samples: Sequence[Sample]) -> NDArray[np.bool_]:
    """(T - 1,): whether anything moves, or is told to, between a row and the next."""
    joints = np.array([[sample.joints, sample.joint_targets] for sample in samples])
    openings = np.array([[sample.opening, sample.opening_target] for sample in samples])
    turned = (np.abs(np.diff(joints, axis=0)) > STILL_JOINT).any(axis=(1, 2))
    return np.asarray(turned | (np.abs(np.diff(openings, axis=0)) > STILL_OPENING).any(axis=1))


def to_recording(samples: Sequence[Sample], texts: Sequence[str]) -> Recording:
    """Rows of these samples, at least one, each with its text.

    What is in force when a sample is taken was commanded before it; a row's action is what is commanded from it on, and
    that is what is in force at the next. The last row's action is what was in force already.
    """
    cameras = samples[0].pictures
    return Recording(
        steps=_steps(samples, texts),
        rgb={name: np.stack([sample.pictures[name].rgb for sample in samples]) for name in cameras},
        depth={
            name: np.stack([to_millimetres(depth) for depth in depths])
            for name in cameras
            if len(depths := [d for sample in samples if (d := sample.pictures[name].depth) is not None])
        },
    )


def _steps(samples: Sequence[Sample], texts: Sequence[str]) -> Steps:
    times = np.array([sample.moving_time for sample in samples])
    T_base_tcp = np.stack([sample.T_base_tcp for sample in samples])
    following = [*samples[1:], samples[-1]]
    T_base_target = np.stack([sample.T_base_target for sample in following])
    return Steps(
        time=times - times[0],
        joints=np.stack([sample.joints for sample in samples]),
        opening=np.array([sample.opening for sample in samples]),
        tcp=to_poses(T_base_tcp),
        joint_targets=np.stack([sample.joint_targets for sample in following]),
        opening_target=np.array([sample.opening_target for sample in following]),
        tcp_delta=to_deltas(np.concatenate([T_base_tcp[:1], T_base_target])),
        subtasks=tuple(texts),
    )


def to_poses(T_base_tcp: FloatArray) -> FloatArray:
    """(T, 7) x, y, z (m) and unit quaternion x, y, z, w, of (T, 4, 4) transforms.

    Of the two quaternions that mean the same rotation it is the one with w >= 0: the same pose, the same numbers.
    """
    quaternions = Rotation.from_matrix(T_base_tcp[:, :3, :3]).as_quat(canonical=True)
    return np.hstack([T_base_tcp[:, :3, 3], quaternions])


def to_deltas(T_base_tcp: FloatArray) -> FloatArray:
    """(T - 1, 6) from each of (T, 4, 4) poses to the next: translation (m) and rotation vector (rad), base axes."""
    rotations = T_base_tcp[:, :3, :3]
    turns = Rotation.from_matrix(rotations[1:] @ rotations[:-1].transpose(0, 2, 1)).as_rotvec()
    return np.hstack([np.diff(T_base_tcp[:, :3, 3], axis=0), turns])


def to_millimetres(depth: NDArray[np.float32]) -> NDArray[np.uint16]:
    """A z-depth image (m, NaN where unknown) as depth cameras' files have it: whole millimetres, 0 where unknown."""
    millimetres = np.rint(np.nan_to_num(depth, nan=0.0, posinf=0.0, neginf=0.0) * 1000.0)
    return np.where(millimetres <= np.iinfo(np.uint16).max, millimetres, 0.0).clip(0.0).astype(np.uint16)
