"""Recording: rows at a fixed rate, actions that say what comes, no wrong frame, and a run that doesn't notice."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from maniagent.data.recording import (
    EpisodeRecorder,
    RecorderSettings,
    to_deltas,
    to_millimetres,
    to_poses,
    to_recording,
)
from maniagent.data.staging import load
from maniagent.envs.cameras import MAIN_CAMERA, SIDE_CAMERA, CameraSpec
from maniagent.envs.scene import Scene
from maniagent.envs.tabletop import TabletopEnv
from maniagent.errors import CameraFailure, StageFailure, UsageError
from maniagent.geometry import FloatArray, make_transform, top_down_rotation
from maniagent.motion import ArmModel
from maniagent.robots.sampling import Metronome, Picture, Sample, SampleListener, Sampling
from maniagent.robots.simulated import SimulatedRobot
from maniagent.testing import FakeRobot
from maniagent.types import Event, Gripper, KeyPoint, Subtask, Verdict

PERIOD = 0.02
SMALL = (MAIN_CAMERA.resized(64, 48), SIDE_CAMERA.resized(64, 48))
TINY = Sampling(width=32, height=24)


def pose(x: float, yaw: float = 0.0) -> FloatArray:
    return make_transform(top_down_rotation(yaw), [x, 0.0, 0.2])


def made_sample(row: int, joint: float = 0.0, *, camera_stopped_at: float = np.inf, depth: bool = False) -> Sample:
    """Row `row` at 10 Hz, its joints all at `joint`; the command is one step of 0.1 ahead of the joints."""
    time = row / 10
    picture = Picture(
        rgb=np.full((2, 3, 3), row, np.uint8),
        time=min(time, camera_stopped_at),
        depth=np.full((2, 3), 0.5 + row / 100, np.float32) if depth else None,
    )
    return Sample(
        time=time,
        moving_time=time,
        joints=np.full(6, joint),
        opening=0.03,
        T_base_tcp=pose(joint),
        joint_targets=np.full(6, joint + 0.1),
        opening_target=0.03 + row / 1000 * (joint > 0),
        T_base_target=pose(joint + 0.1, yaw=row / 10),
        pictures={"main": picture},
    )


class TellingRobot(FakeRobot):
    """A robot whose samples are told by the test."""

    listener: SampleListener | None = None
    sampling: Sampling | None = None

    def start_sampling(self, listener: SampleListener, sampling: Sampling) -> None:
        self.listener, self.sampling = listener, sampling

    def stop_sampling(self) -> None:
        self.listener = None

    def tell(self, *samples: Sample) -> None:
        assert self.listener is not None
        for sample in samples:
            self.listener.on_sample(sample)


def moving(count: int, **changed: Any) -> list[Sample]:
    return [made_sample(row, 0.1 * (row + 1), **changed) for row in range(count)]


def recorded(samples: Sequence[Sample], **settings: Any) -> EpisodeRecorder:
    robot = TellingRobot()
    recorder = EpisodeRecorder(robot, settings=RecorderSettings(**settings))
    recorder.begin()
    robot.tell(*samples)
    return recorder


# When ---------------------------------------------------------------------------------------------------------------


@given(st.floats(1.0, 25.0), st.integers(1, 400), st.floats(0.0, 100.0))
def test_samples_are_due_within_half_a_control_period_of_the_fixed_rate(rate: float, ticks: int, start: float) -> None:
    metronome = Metronome(rate, PERIOD)
    due = [moving for k in range(ticks) if (moving := metronome.tick(start + k * PERIOD)) is not None]
    assert due[0] == 0.0
    assert np.abs(np.array(due) - np.arange(len(due)) / rate).max() <= PERIOD / 2 + 1e-9
    last = (ticks - 0.5) * PERIOD * rate  # a sample that is due at the very end of a period may come or not
    assert np.floor(last - 1e-6) + 1 <= len(due) <= np.floor(last + 1e-6) + 1


@given(st.lists(st.floats(0.2, 1000.0), min_size=1, max_size=5))
def test_pauses_in_which_the_robot_stands_by_dont_count(pauses: list[float]) -> None:
    plain, interrupted = Metronome(10.0, PERIOD), Metronome(10.0, PERIOD)
    time = 0.0
    for k in range(40 * (len(pauses) + 1)):
        time += pauses[k // 40 - 1] if k and k % 40 == 0 else PERIOD
        expected, found = plain.tick(k * PERIOD), interrupted.tick(time)
        assert (expected is None) == (found is None)
        assert expected is None or found == pytest.approx(expected, abs=1e-9)


# What a row says ----------------------------------------------------------------------------------------------------


def test_the_action_of_a_row_is_the_command_in_force_at_the_next() -> None:
    samples = moving(5)
    steps = to_recording(samples, ["go"] * 5).steps
    for row in range(4):
        np.testing.assert_array_equal(steps.joint_targets[row], samples[row + 1].joint_targets)
        assert steps.opening_target[row] == samples[row + 1].opening_target
    np.testing.assert_array_equal(steps.joint_targets[4], samples[4].joint_targets)


def test_deltas_lead_from_the_measured_pose_through_the_commanded_ones() -> None:
    samples = moving(5)
    steps = to_recording(samples, ["go"] * 5).steps
    T_base_tcp = samples[0].T_base_tcp
    for row, delta in enumerate(steps.tcp_delta):
        turn = Rotation.from_rotvec(delta[3:]).as_matrix()
        T_base_tcp = make_transform(turn @ T_base_tcp[:3, :3], T_base_tcp[:3, 3] + delta[:3])
        np.testing.assert_allclose(T_base_tcp, samples[min(row + 1, 4)].T_base_target, atol=1e-9)
    np.testing.assert_allclose(steps.tcp_delta[4], 0.0, atol=1e-12)


poses = st.tuples(
    st.tuples(*[st.floats(-1, 1)] * 3), st.tuples(*[st.floats(-np.pi, np.pi)] * 3).map(Rotation.from_rotvec)
).map(lambda p: make_transform(p[1].as_matrix(), p[0]))


@given(st.lists(poses, min_size=2, max_size=5))
def test_poses_and_deltas_lose_nothing(chain: list[FloatArray]) -> None:
    stacked = np.stack(chain)
    rows = to_poses(stacked)
    assert (rows[:, 6] >= 0.0).all()
    np.testing.assert_allclose(Rotation.from_quat(rows[:, 3:]).as_matrix(), stacked[:, :3, :3], atol=1e-9)
    deltas = to_deltas(stacked)
    for here, delta, there in zip(stacked, deltas, stacked[1:], strict=False):
        np.testing.assert_allclose(Rotation.from_rotvec(delta[3:]).as_matrix() @ here[:3, :3], there[:3, :3], atol=1e-6)
        np.testing.assert_allclose(here[:3, 3] + delta[:3], there[:3, 3], atol=1e-9)


def test_depth_is_kept_in_whole_millimetres_and_nothing_is_made_of_what_is_unknown() -> None:
    depth = np.array([[0.1234, np.nan, 65.535, 65.6, np.inf, -1.0]], np.float32)
    np.testing.assert_array_equal(to_millimetres(depth), [[123, 0, 65535, 0, 0, 0]])


def test_depth_is_recorded_where_it_is_asked_for_and_only_there() -> None:
    assert to_recording(moving(2), ["", ""]).depth == {}
    depth = to_recording(moving(2, depth=True), ["", ""]).depth["main"]
    assert depth.dtype == np.uint16
    np.testing.assert_array_equal(depth[:, 0, 0], [500, 510])


# Texts --------------------------------------------------------------------------------------------------------------

LIFT = Subtask(previous=Verdict.INITIAL, reason="", text="lift the carrot", objects=("carrot",))
DONE = Subtask(previous=Verdict.SUCCESS, reason="it hangs there", done=True)


def texts(by_move: bool) -> tuple[str, ...]:
    robot = TellingRobot()
    recorder = EpisodeRecorder(robot, settings=RecorderSettings(by_move=by_move))
    recorder.begin("get ready")
    samples = moving(4)
    robot.tell(samples[0])
    recorder.on_event(Event("reasoned", 0.0, {"subtask": LIFT}))
    robot.tell(samples[1])
    recorder.on_event(Event("move", 0.0, {"description": "Go up", "seconds": 1.0}))
    robot.tell(samples[2])
    recorder.on_event(Event("reasoned", 0.0, {"subtask": DONE}))
    robot.tell(samples[3])
    return recorder.finish().steps.subtasks


def test_every_row_says_what_the_robot_was_doing() -> None:
    assert texts(by_move=False) == ("get ready", "lift the carrot", "lift the carrot", "lift the carrot")


def test_rows_before_the_first_sub_task_belong_to_it() -> None:
    robot = TellingRobot()
    recorder = EpisodeRecorder(robot)
    recorder.begin()
    robot.tell(*moving(2))
    recorder.subtask = "lift the carrot"
    robot.tell(*moving(4)[2:])
    assert recorder.finish().steps.subtasks == ("lift the carrot",) * 4


def test_rows_may_tell_of_single_moves_instead() -> None:
    assert texts(by_move=True) == ("get ready", "lift the carrot", "Go up", "Go up")


# Beginning and end --------------------------------------------------------------------------------------------------


def standing_moving_standing() -> list[Sample]:
    joints = [0.1] * 8 + [0.2, 0.3, 0.4, 0.5] + [0.5] * 8
    return [made_sample(0, joint) for joint in joints]


@pytest.mark.parametrize(("trim", "rows"), [(None, 20), (0.0, 5), (0.3, 11), (9.0, 20)])
def test_standing_still_is_cut_off_at_both_ends(trim: float | None, rows: int) -> None:
    steps = recorded(standing_moving_standing(), trim=trim).finish().steps
    assert len(steps.time) == rows
    assert steps.joints[0, 0] == 0.1
    assert steps.joints[-1, 0] == 0.5


def test_an_episode_in_which_nothing_moves_is_none() -> None:
    with pytest.raises(StageFailure, match="Nothing moved"):
        recorded([made_sample(0, 0.1)] * 10).finish()
    with pytest.raises(StageFailure, match="Nothing moved"):
        recorded([], trim=None).finish()
    with pytest.raises(StageFailure, match="Nothing moved"):
        recorded([]).finish()


def test_time_begins_with_the_first_row_that_is_kept() -> None:
    steps = recorded(moving(12)[4:]).finish().steps
    np.testing.assert_allclose(steps.time, np.arange(8) / 10, atol=1e-12)


def test_beginning_again_drops_what_was_not_finished() -> None:
    robot = TellingRobot()
    recorder = EpisodeRecorder(robot)
    recorder.begin()
    robot.tell(*moving(9))
    recorder.begin(seed=7)
    robot.tell(*moving(3))
    assert robot.sampling == Sampling(seed=7)
    assert len(recorder.finish().steps.time) == 3
    assert robot.listener is None


# Cameras that stop --------------------------------------------------------------------------------------------------


def test_an_old_picture_ends_the_recording() -> None:
    recorder = recorded(moving(10, camera_stopped_at=0.4))
    assert recorder.failure is not None
    with pytest.raises(CameraFailure, match=r"main camera stopped: its last picture is 0\.2 s old"):
        recorder.finish()


def test_the_next_episode_may_be_a_good_one() -> None:
    robot = TellingRobot()
    recorder = EpisodeRecorder(robot)
    recorder.begin()
    robot.tell(*moving(10, camera_stopped_at=0.4))
    recorder.begin()
    robot.tell(*moving(4))
    assert len(recorder.finish().steps.time) == 4


# The twin -----------------------------------------------------------------------------------------------------------

SCENE = Scene.model_validate(
    {"objects": [{"name": "block", "kind": "block", "place": {"at": [0.3, 0.05], "yaw": 0.0}}]}
)


class FailingEnv(TabletopEnv):
    """A twin whose side camera stops after some pictures."""

    pictures_left = 8

    def take(self, camera: CameraSpec, *, depth: bool, rng: np.random.Generator | None) -> Any:
        self.pictures_left -= camera.name == "side"
        if self.pictures_left < 0:
            raise CameraFailure("The side camera doesn't answer.")
        return super().take(camera, depth=depth, rng=rng)


@pytest.fixture
def env() -> Iterator[TabletopEnv]:
    env = TabletopEnv(SCENE, cameras=SMALL)
    env.reset(seed=3)
    yield env
    env.close()


def there_and_back(robot: SimulatedRobot) -> None:
    """Go to the block, close on it, lift it, go home with it."""
    down = make_transform(top_down_rotation(0.0), [0.3, 0.05, 0.02])
    up = make_transform(top_down_rotation(0.0), [0.3, 0.05, 0.12])
    keypoints = [
        KeyPoint(up, Gripper.OPEN, "Go above"),
        KeyPoint(down, Gripper.CLOSE, "Take it"),
        KeyPoint(up, Gripper.KEEP, "Lift it"),
    ]
    assert robot.execute(keypoints, {}).completed
    assert robot.go_home().completed


@pytest.mark.slow
def test_the_documented_example_records_an_episode(tmp_path: Path) -> None:
    text = (Path(__file__).parents[2] / "docs/recording.md").read_text(encoding="utf-8")
    (example,) = re.findall(r"^```python\n(.*?)^```", text, re.M | re.S)
    subprocess.run([sys.executable, "-c", example], cwd=tmp_path, check=True)
    info, recording = load(tmp_path / "staged/carrot-s3")
    assert recording is not None
    assert info.label == "valid"
    assert set(recording.steps.subtasks) == {"put the carrot on the plate"}
    assert recording.rgb["side"].shape == (len(recording.steps.time), 240, 320, 3)


@pytest.mark.slow
def test_a_recorded_run_is_to_the_bit_the_run_without_a_recorder() -> None:
    def played(sampling: Sampling | None) -> list[Any]:
        env = TabletopEnv(SCENE, cameras=SMALL)
        env.reset(seed=3)
        film: list[NDArray[np.uint8]] = []
        way: list[bytes] = []
        advance = env.advance
        env.advance = lambda *command: (advance(*command), way.append(env.data.qpos.tobytes()))  # type: ignore[method-assign]  # spy
        robot = SimulatedRobot(env, on_frame=lambda rgb, time: film.append(rgb))
        if sampling is not None:
            EpisodeRecorder(robot, sampling).begin()
        there_and_back(robot)
        seen = robot.observe().main_frame
        env.close()
        return [way, [rgb.tobytes() for rgb in film], seen.rgb.tobytes(), seen.depth.tobytes()]

    plain, with_recorder = played(None), played(Sampling(width=32, height=24, depth=True))
    assert len(plain[0]) > 300
    assert len(plain[1]) > 50
    assert plain == with_recorder


def test_the_twin_is_recorded_at_ten_hertz_through_grasping_and_the_way_home(env: TabletopEnv) -> None:
    robot = SimulatedRobot(env)
    recorder = EpisodeRecorder(robot, TINY)
    recorder.begin()
    there_and_back(robot)
    recording = recorder.finish()
    steps = recording.steps
    rows = len(steps.time)
    np.testing.assert_allclose(steps.time, np.arange(rows) / 10, atol=1e-9)
    assert steps.opening.max() > 0.045
    assert steps.opening[-1] == pytest.approx(0.04, abs=0.005), "the block is in the gripper on the way home"
    assert steps.opening_target[-1] < 0.03, "and the fingers are told to press"
    np.testing.assert_allclose(steps.joints[-1], env.home, atol=0.02)
    model = ArmModel()
    np.testing.assert_allclose(steps.tcp, to_poses(np.stack([model.forward(q) for q in steps.joints])), atol=1e-9)
    commanded = [model.forward(steps.joints[0]), *map(model.forward, steps.joint_targets)]
    np.testing.assert_allclose(steps.tcp_delta, to_deltas(np.stack(commanded)), atol=1e-9)
    lag = np.abs(steps.joint_targets[:-1] - steps.joints[1:]).max()
    assert lag < 0.1, "what a row commands is where the arm is at the next"
    assert {name: rgb.shape for name, rgb in recording.rgb.items()} == dict.fromkeys(
        ("main", "side"), (rows, 24, 32, 3)
    )


def test_pictures_show_the_moment_of_their_row_and_the_same_seed_draws_the_same_noise(env: TabletopEnv) -> None:
    def pictures(seed: int, noise: bool) -> NDArray[np.uint8]:
        env.reset(seed=3)
        robot = SimulatedRobot(env)
        recorder = EpisodeRecorder(robot, TINY.model_copy(update={"noise": noise}))
        recorder.begin(seed=seed)
        joints = np.concatenate([np.linspace(0.0, 0.3, 30), np.full(10, 0.3)])
        for joint in joints:  # as the executor does it
            robot._arm.command(env.home + joint, 0.03)
            robot._after_tick(robot._arm.read())
        return recorder.finish().rgb["main"]

    clean = pictures(0, noise=False)
    assert (np.abs(np.diff(clean[:5].astype(int), axis=0)).max(axis=(1, 2, 3)) > 20).all(), "the arm moves in them"
    noisy = pictures(1, noise=True)
    np.testing.assert_array_equal(noisy, pictures(1, noise=True))
    assert (noisy != pictures(2, noise=True)).any()
    assert np.abs(noisy.astype(int) - clean).mean() < 5.0


def test_a_camera_that_stops_ends_the_recording_but_not_the_run() -> None:
    env = FailingEnv(SCENE, cameras=SMALL, noise=None)
    env.reset(seed=3)
    env.pictures_left = 8
    robot = SimulatedRobot(env)
    recorder = EpisodeRecorder(robot, TINY)
    recorder.begin()
    there_and_back(robot)
    with pytest.raises(CameraFailure, match="side camera doesn't answer"):
        recorder.finish()
    env.close()


def test_pictures_larger_than_the_cameras_own_are_refused(env: TabletopEnv) -> None:
    with pytest.raises(UsageError, match="record at 64x48 or less"):
        EpisodeRecorder(SimulatedRobot(env), Sampling(width=65, height=48)).begin()


def test_a_resized_camera_looks_at_the_same_things() -> None:
    half = MAIN_CAMERA.resized(320, 240)
    assert half.fovy == pytest.approx(MAIN_CAMERA.fovy)
    square = MAIN_CAMERA.resized(240, 240)
    assert square.fovy == half.fovy
    assert square.K[0, 2] == square.K[1, 2] == 119.5
