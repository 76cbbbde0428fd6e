"""What was seen reads back bit by bit, or not at all."""

import zipfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from PIL import Image

from maniagent.console.folder import picture_name
from maniagent.errors import UsageError
from maniagent.geometry import make_transform, top_down_rotation
from maniagent.replay.looks import load_look, save_look
from maniagent.types import CameraFrame, Observation, RobotState

numbers = st.floats(width=64)
shapes = st.tuples(st.integers(1, 5), st.integers(1, 5))


@st.composite
def observations(draw: st.DrawFn) -> Observation:
    frames = {}
    for name in draw(st.lists(st.sampled_from(["main", "side", "cam a", "cam_a", "../x"]), min_size=1, unique=True)):
        height, width = draw(shapes)
        depth = draw(arrays.arrays(np.float32, (height, width), elements=st.floats(width=32)))
        rgb = draw(arrays.arrays(np.uint8, (height, width, 3)))
        K = draw(arrays.arrays(np.float64, (3, 3), elements=numbers))
        frames[name] = CameraFrame(name, rgb, depth, K, draw(arrays.arrays(np.float64, (4, 4), elements=numbers)))
    state = RobotState(
        draw(arrays.arrays(np.float64, 6, elements=numbers)),
        make_transform(top_down_rotation(draw(st.floats(-3, 3))), [0.2, 0, 0.1]),
        draw(numbers),
        draw(numbers),
    )
    return Observation(frames, draw(st.sampled_from(sorted(frames))), state)


def write(folder: Path, observation: Observation) -> Path:
    for view, frame in observation.frames.items():
        Image.fromarray(frame.rgb).save(folder / picture_name(1, view))
    save_look(folder / "look.npz", observation)
    return folder / "look.npz"


def read(path: Path) -> Observation:
    return load_look(path, lambda view: path.parent / picture_name(1, view))


def bits(value: object) -> object:
    return np.asarray(value).tobytes()


@given(observations())
@settings(deadline=None)
def test_what_was_seen_reads_back_bit_by_bit(tmp_path_factory: pytest.TempPathFactory, seen: Observation) -> None:
    again = read(write(tmp_path_factory.mktemp("look"), seen))
    assert (list(again.frames), again.main) == (list(seen.frames), seen.main)
    for view, frame in seen.frames.items():
        other = again.frames[view]
        assert other.name == frame.name
        for field in ("rgb", "depth", "K", "T_base_camera"):
            assert bits(getattr(other, field)) == bits(getattr(frame, field)), field
    for field in ("joint_positions", "T_base_tcp", "gripper_opening", "time"):
        assert bits(getattr(again.robot, field)) == bits(getattr(seen.robot, field)), field


@pytest.fixture
def look(tmp_path: Path) -> Path:
    frame = CameraFrame("main", np.zeros((4, 6, 3)), np.ones((4, 6)), np.eye(3), np.eye(4))
    return write(tmp_path, Observation({"main": frame}, "main", RobotState(np.zeros(6), np.eye(4), 0.0, 0.0)))


def missing(look: Path) -> None:
    look.unlink()


def no_picture(look: Path) -> None:
    (look.parent / picture_name(1, "main")).unlink()


def torn(look: Path) -> None:
    look.write_bytes(look.read_bytes()[:-200])


def blotted(look: Path) -> None:
    content = bytearray(look.read_bytes())
    content[60:400] = bytes(340)
    look.write_bytes(bytes(content))


def other_size(look: Path) -> None:
    Image.fromarray(np.zeros((9, 9, 3), np.uint8)).save(look.parent / picture_name(1, "main"))


def pickled(look: Path) -> None:
    np.savez(look, names=np.array([{"code": print}], dtype=object), keys=np.array(["main"]))


def no_arrays(look: Path) -> None:
    with zipfile.ZipFile(look, "w") as archive:
        archive.writestr("names.npy", b"nonsense")


@pytest.mark.parametrize("damage", [missing, no_picture, torn, blotted, other_size, pickled, no_arrays])
def test_what_is_damaged_is_one_clear_error(look: Path, damage: object) -> None:
    assert callable(damage)
    damage(look)
    with pytest.raises(UsageError, match="can't be read back"):
        read(look)


def test_a_file_that_unpacks_to_more_than_any_camera_sees_is_refused(
    look: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("maniagent.replay.looks._LARGEST", 100)
    with pytest.raises(UsageError, match="too large"):
        read(look)
