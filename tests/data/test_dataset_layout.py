"""The small dataset of these tests has the layout that LeRobot writes, and LeRobot's own is read and found sound."""

import json
import subprocess
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest
from made_dataset import CAMERA, FPS, NAMES, SIZE, SUBTASKS, TASKS, made_dataset

from maniagent.data.dataset.reading import Dataset
from maniagent.data.dataset.verifying import verify
from maniagent.data.lerobot.interpreter import find_interpreter
from maniagent.errors import SetupError

pytestmark = pytest.mark.slow

LENGTHS = (12, 15, 11)

WRITER = """
import json, sys
import numpy as np
from lerobot.datasets.lerobot_dataset import LeRobotDataset

a = json.loads(sys.argv[1])
vector = {"dtype": "float32", "shape": (7,), "names": a["names"]}
features = {
    "observation.state": vector,
    "action": vector,
    a["camera"]: {"dtype": "video", "shape": (a["height"], a["width"], 3), "names": ["height", "width", "channels"]},
    "subtask": {"dtype": "string", "shape": (1,), "names": None},
}
dataset = LeRobotDataset.create(
    "made/here", a["fps"], features, root=a["root"], robot_type="widowx_250s", vcodec="h264", streaming_encoding=True
)
for episode, length in enumerate(a["lengths"]):
    for t in range(length):
        image = np.full((a["height"], a["width"], 3), 90, np.uint8)
        image[10:20, 2 * t : 2 * t + 10] = 200
        state = (0.05 + 0.01 * np.sin(0.1 * t * np.arange(1, 8) + episode)).astype(np.float32)
        subtask, task = a["subtasks"][t >= length // 2], a["tasks"][episode % 2]
        dataset.add_frame(
            {"observation.state": state, "action": state, a["camera"]: image, "subtask": subtask, "task": task}
        )
    dataset.save_episode()
dataset.finalize()
"""


@pytest.fixture(scope="module")
def real(tmp_path_factory: pytest.TempPathFactory) -> Path:
    try:
        python = find_interpreter()
    except SetupError as error:
        pytest.skip(str(error))
    root = tmp_path_factory.mktemp("lerobot") / "real"
    width, height = SIZE
    told = {
        "root": str(root), "fps": FPS, "names": NAMES, "camera": CAMERA, "width": width, "height": height,
        "lengths": LENGTHS, "tasks": TASKS, "subtasks": SUBTASKS,
    }  # fmt: skip
    subprocess.run([python, "-c", WRITER, json.dumps(told)], check=True, capture_output=True, timeout=300)
    return root


def test_what_lerobot_writes_is_sound(real: Path) -> None:
    report = verify(real, deep=True)
    assert [finding for check in report.checks for finding in check.findings if finding.is_problem] == []


def test_what_lerobot_writes_can_be_read(real: Path) -> None:
    dataset = Dataset.open(real)
    assert [episode.length for episode in dataset.episodes] == list(LENGTHS)
    episode = dataset.episode(1)
    assert dataset.numbers(episode, ["action"])["action"].shape == (LENGTHS[1], 7)
    assert set(dataset.subtasks(episode)) == set(SUBTASKS)
    (picture,) = dataset.pictures(episode, CAMERA, [4])
    assert picture[15, 12].mean() > 180 > 110 > picture[30, 12].mean()  # the square, and the ground


def test_the_made_dataset_has_lerobots_layout(real: Path, tmp_path: Path) -> None:
    made = made_dataset(tmp_path / "made", LENGTHS, files=1)
    assert files(made) == files(real)
    assert info(made) == info(real)
    for path in sorted(made.rglob("*.parquet")):
        assert columns(path) == columns(real / path.relative_to(made)), path.name
    stats = [json.loads((root / "meta/stats.json").read_text()) for root in (made, real)]
    assert {key: set(value) for key, value in stats[0].items()} == {key: set(value) for key, value in stats[1].items()}


def files(root: Path) -> set[str]:
    return {path.relative_to(root).as_posix() for path in root.rglob("*") if path.is_file()}


def info(root: Path) -> Any:
    return json.loads((root / "meta/info.json").read_text())


def columns(path: Path) -> dict[str, str]:
    return {field.name: str(field.type) for field in pq.read_schema(path)}
