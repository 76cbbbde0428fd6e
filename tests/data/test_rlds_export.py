"""Exporting as a whole: what is packed, what is refused, what a writer that fails leaves, and the real thing."""

from __future__ import annotations

import functools
import io
import json
import os
import subprocess
import sys
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_collected import hand_path, made_collected
from made_dataset import LENGTHS, SIZE, SUBTASKS, TASKS, VIDEO, edit_json, made_dataset, picture
from PIL import Image
from scipy.spatial.transform import Rotation
from tfds_python import PYTHON, needs_tfds
from typer.testing import CliRunner

from maniagent.cli import app
from maniagent.data.rlds import WriterFailure, export_rlds
from maniagent.data.rlds.client import VARIABLE, find_interpreter, write
from maniagent.data.rlds.episodes import Settings, Source
from maniagent.data.rlds.registration import transforms
from maniagent.data.rlds.writer import Ended, cut, read_episodes
from maniagent.errors import ManiAgentError, SetupError, UsageError

HERE = Path(sys.executable)
READY = 'import sys, json\nprint(json.dumps({"ok": {}}), flush=True)\n'


@pytest.fixture
def dataset(tmp_path: Path) -> Path:
    return made_collected(tmp_path / "demos")


def packed(source: Source, number: int = 0) -> dict[str, Any]:
    with np.load(io.BytesIO(source.pack(source.dataset.episodes[number]).data)) as arrays:
        return dict(arrays)


# What is packed ---------------------------------------------------------------------------------------------------


def test_an_episode_is_packed_with_its_words_numbers_and_pictures(dataset: Path) -> None:
    episode = packed(Source(dataset), 1)
    assert str(episode["language_instruction"]) == TASKS[1]
    assert set(episode["subtask"]) == set(SUBTASKS)
    assert (episode["state"].shape, episode["joint_state"].shape) == ((LENGTHS[1], 7), (LENGTHS[1], 6))
    assert episode["action"][:, 6].tolist() == [1.0] * 5 + [0.0] * 7 + [1.0] * 3
    files = cut(episode["image.bytes"], episode["image.ends"])
    shown = np.asarray(Image.open(io.BytesIO(files[4]))).astype(int)
    assert len(files) == LENGTHS[1]
    assert np.abs(shown - picture(1, 4)).mean() < 6.0


def test_every_third_frame_keeps_its_own_picture_and_words(dataset: Path) -> None:
    whole, thinned = packed(Source(dataset)), packed(Source(dataset, Settings(every=3)))
    assert thinned["subtask"].tolist() == whole["subtask"][::3].tolist()
    np.testing.assert_array_equal(thinned["state"], whole["state"][::3])
    pictures, kept = (cut(e["image.bytes"], e["image.ends"]) for e in (whole, thinned))
    assert kept == pictures[::3]


def test_pictures_are_resized_on_demand(dataset: Path) -> None:
    source = Source(dataset, Settings(size=(32, 16)))
    episode = packed(source)
    assert source.schema()["images"] == {"image": (16, 32, 3)}
    assert Image.open(io.BytesIO(cut(episode["image.bytes"], episode["image.ends"])[0])).size == (32, 16)


def test_pictures_keep_their_size_otherwise(dataset: Path) -> None:
    assert Source(dataset).schema() == {"images": {"image": (SIZE[1], SIZE[0], 3)}, "joints": 6}


# What is refused --------------------------------------------------------------------------------------------------


def test_a_dataset_without_end_effector_actions_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"observation.ee_pose, ee_delta"):
        Source(made_dataset(tmp_path / "another"))


def test_a_folder_that_is_no_dataset_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no folder meta"):
        export_rlds(tmp_path, tmp_path / "out", python=HERE)


def test_a_camera_that_is_not_there_is_refused_with_those_that_are(dataset: Path) -> None:
    with pytest.raises(UsageError, match=r"no camera 'top'.* main"):
        Source(dataset, Settings(camera="top"))


def test_a_gripper_that_nobody_knows_is_refused(dataset: Path) -> None:
    edit_json(dataset / "meta/info.json", lambda info: info.update(robot_type="ur5"))
    with pytest.raises(UsageError, match="'ur5'"):
        Source(dataset)


def test_what_is_there_already_stays(dataset: Path, tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    with pytest.raises(UsageError, match="there already"):
        export_rlds(dataset, tmp_path / "out", python=HERE)


@pytest.mark.parametrize("name", ["Carrots-10", "3d", "_x"])
def test_a_folder_that_tensorflow_could_not_name_is_refused_with_one_that_it_could(name: str, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"can't name an RLDS dataset.*Name it .*[a-z]+, say"):
        export_rlds(tmp_path, tmp_path / name, python=HERE)


def test_no_tensorflow_anywhere_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(VARIABLE, raising=False)
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(SetupError, match=r"maniagent\[rlds\].*--tfds-python"):
        find_interpreter()


def test_a_named_interpreter_that_is_none_says_so(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv(VARIABLE, str(tmp_path / "python"))
    with pytest.raises(SetupError, match="is no Python interpreter"):
        find_interpreter()


# A writer that fails ----------------------------------------------------------------------------------------------


def fake_write(folder: Path, body: str, episodes: Any = (b"one",), limit: float = 20.0) -> dict[str, int]:
    script = folder / "fake.py"
    script.write_text(textwrap.dedent(body))
    return write(HERE, {"name": "x"}, episodes, script=script, limit=limit)


def test_the_writer_gets_the_request_and_the_episodes_and_answers(tmp_path: Path) -> None:
    body = """
    stream = sys.stdin.buffer
    name = json.loads(stream.readline())["name"]
    lengths = []
    while length := int.from_bytes(stream.read(8), "big"):
        lengths.append(len(stream.read(length)))
    print(json.dumps({"ok": {"episodes": len(lengths), "steps": sum(lengths), "name": name}}), flush=True)
    """
    got = fake_write(tmp_path, READY + textwrap.dedent(body), [b"one", b"three", b"x" * 300_000])
    assert got == {"episodes": 3, "steps": 300_008, "name": "x"}


def test_an_interpreter_without_tensorflow_datasets_says_what_to_install(tmp_path: Path) -> None:
    with pytest.raises(SetupError, match=r"has no tensorflow_datasets.*maniagent\[rlds\]"):
        fake_write(tmp_path, "raise ModuleNotFoundError(\"No module named 'tensorflow_datasets'\")")


def test_a_writer_that_dies_is_told_with_its_last_words(tmp_path: Path) -> None:
    with pytest.raises(WriterFailure, match=r"status 3.*out of ideas"):
        fake_write(tmp_path, READY + 'print("out of ideas", file=sys.stderr); sys.exit(3)', [bytes(1 << 20)] * 3)


def test_a_writer_that_is_stuck_is_ended(tmp_path: Path) -> None:
    with pytest.raises(WriterFailure, match=r"took more than 0\.5 s"):
        fake_write(tmp_path, READY + "import time; time.sleep(60)", [bytes(1 << 20)] * 3, limit=0.5)


@pytest.mark.parametrize(
    ("error", "kind", "words"),
    [
        ({"kind": "OSError", "message": "x", "errno": 28}, SetupError, "disk is full"),
        ({"kind": "ResourceError", "message": "No space left on device", "errno": None}, SetupError, "disk is full"),
        ({"kind": "OSError", "message": "x", "errno": 13}, SetupError, "can't be written"),
        ({"kind": "ValueError", "message": "odd", "errno": None}, WriterFailure, "ValueError: odd"),
    ],
)
def test_what_the_writer_refuses_is_told(
    tmp_path: Path, error: dict[str, Any], kind: type[ManiAgentError], words: str
) -> None:
    with pytest.raises(kind, match=words):
        fake_write(tmp_path, READY + f"print(json.dumps({{'error': {error}}}), flush=True)")


def test_an_episode_that_cannot_be_read_ends_the_writer_and_is_told(tmp_path: Path) -> None:
    def episodes() -> Iterator[bytes]:
        yield b"one"
        raise UsageError("broken video")

    with pytest.raises(UsageError, match="broken video"):
        fake_write(tmp_path, READY + "sys.stdin.buffer.read()", episodes())


def test_what_fails_leaves_nothing(dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    script = tmp_path / "fake.py"
    script.write_text(READY + 'print(json.dumps({"ok": {"episodes": 1}}), flush=True); sys.stdin.buffer.read()')
    monkeypatch.setattr("maniagent.data.rlds.export.write", functools.partial(write, script=script))
    with pytest.raises(WriterFailure, match=r"reads back as .*'episodes': 1.*'episodes': 4"):
        export_rlds(dataset, tmp_path / "root/out", python=HERE)
    assert list((tmp_path / "root").iterdir()) == []


def test_a_video_that_is_missing_is_told_and_leaves_nothing(
    dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    script = tmp_path / "fake.py"
    script.write_text(READY + "sys.stdin.buffer.read()")
    monkeypatch.setattr("maniagent.data.rlds.export.write", functools.partial(write, script=script))
    (dataset / VIDEO).unlink()
    with pytest.raises(UsageError, match="is missing"):
        export_rlds(dataset, tmp_path / "root/out", python=HERE)
    assert list((tmp_path / "root").iterdir()) == []


def test_episodes_that_stop_early_are_noticed() -> None:
    with pytest.raises(Ended):
        list(read_episodes(io.BytesIO((9).to_bytes(8, "big") + b"short")))


# The command ------------------------------------------------------------------------------------------------------


def test_the_command_tells_errors_as_json(tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["data", "export", "rlds", str(tmp_path), "--out", str(tmp_path), "--json"])
    assert result.exit_code == 2
    assert "error" in json.loads(result.stdout)


@pytest.mark.parametrize("size", ["256", "0x4", "4x4x4"])
def test_a_size_has_a_width_and_a_height(tmp_path: Path, size: str) -> None:
    out = str(tmp_path / "out")
    result = CliRunner().invoke(app, ["data", "export", "rlds", str(tmp_path), "--out", out, "--size", size])
    assert result.exit_code == 2
    assert "WIDTHxHEIGHT" in result.stderr


# The real thing ---------------------------------------------------------------------------------------------------

READ = """
import json, sys
import numpy as np
import tensorflow_datasets as tfds

by_name = tfds.builder(sys.argv[2], data_dir=sys.argv[1])
builder = tfds.builder_from_directory(f"{sys.argv[1]}/{sys.argv[2]}/1.0.0")
assert by_name.info.features == builder.info.features or str(by_name.info.features) == str(builder.info.features)
told, arrays = {}, {}
for episode in builder.as_dataset(split="train"):
    steps = list(episode["steps"].as_numpy_iterator())
    number = str(int(episode["episode_metadata"]["episode_index"]))
    told[number] = {
        "instruction": steps[0]["language_instruction"].decode(),
        "subtasks": [step["subtask"].decode() for step in steps],
        "flags": [[bool(step[k]) for k in ("is_first", "is_last", "is_terminal", "reward")] for step in steps],
    }
    for key in ("state", "image"):
        arrays[f"{number}.{key}"] = np.stack([step["observation"][key] for step in steps])
    arrays[f"{number}.action"] = np.stack([step["action"] for step in steps])
# As OpenVLA's loader has it: an episode as whole arrays, through the transform that is registered.
space = {"OXE_STANDARDIZATION_TRANSFORMS": {}}
exec(sys.argv[4], space)
raw = next(iter(builder.as_dataset(split="train", decoders={"steps": tfds.decode.SkipDecoding()})))["steps"]
seen = space["OXE_STANDARDIZATION_TRANSFORMS"][sys.argv[2]](raw)
shapes = [seen["observation"][key].shape[1] for key in ("EEF_state", "gripper_state")] + [seen["action"].shape[1]]
assert shapes == [6, 1, 7], shapes
np.savez(sys.argv[3], **arrays)
json.dump(told, open(sys.argv[3] + ".json", "w"))
"""


@needs_tfds
@pytest.mark.slow
def test_tensorflow_datasets_loads_what_was_exported(dataset: Path, tmp_path: Path) -> None:
    seen: list[tuple[int, int, str]] = []
    made = export_rlds(dataset, tmp_path / "root/demos", python=PYTHON, on_progress=lambda *told: seen.append(told))
    assert (made.name, made.episodes, made.steps, made.rate) == ("demos", len(LENGTHS), sum(LENGTHS), 10.0)
    assert [done for done, _, _ in seen] == [0, 1, 2, 3, 4]
    assert sorted(path.name for path in (tmp_path / "root").iterdir()) == ["demos"]
    env = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"} | {"CUDA_VISIBLE_DEVICES": "-1"}
    read = tmp_path / "read.npz"
    arguments = [str(tmp_path / "root"), "demos", str(read), transforms("demos")]
    subprocess.run([str(PYTHON), "-c", READ, *arguments], check=True, env=env)
    told, arrays = json.loads(Path(f"{read}.json").read_text()), np.load(read)
    for number, length in enumerate(LENGTHS):
        about = told[str(number)]
        assert about["instruction"] == TASKS[number % 2]
        assert about["flags"] == [[row == 0, *[row == length - 1] * 3] for row in range(length)]
        assert about["subtasks"] == [SUBTASKS[int(row >= length // 2)] for row in range(length)]
        assert np.abs(arrays[f"{number}.image"][3].astype(int) - picture(number, 3)).mean() < 6.0
        check_path(arrays[f"{number}.state"], arrays[f"{number}.action"], number)


def check_path(state: np.ndarray, action: np.ndarray, number: int) -> None:
    """Obeying the actions leads along the path that the hand was recorded on."""
    path = hand_path(number, len(action))
    position, rotation = state[0, :3].astype(float), Rotation.from_matrix(path[0, :3, :3])
    for row, step in enumerate(action.astype(float), 1):
        position, rotation = position + step[:3], Rotation.from_euler("xyz", step[3:6]) * rotation
        np.testing.assert_allclose(position, path[row, :3, 3], atol=1e-5)
        np.testing.assert_allclose(rotation.as_matrix(), path[row, :3, :3], atol=1e-4)
