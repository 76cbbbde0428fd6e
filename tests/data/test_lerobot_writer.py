"""What lerobot itself writes and reads again; needs a Python that has it."""

from __future__ import annotations

import base64
import hashlib
import io
import json
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from lerobot_python import PYTHON, needs_lerobot
from numpy.typing import NDArray
from PIL import Image
from staged import FPS, made_recording, stage

from maniagent.data.episode import JOINTS, Recording
from maniagent.data.lerobot import Writer, merge, publish, split
from maniagent.data.lerobot.ledger import read_ledger
from maniagent.data.lerobot.writer import moments, quantiles
from maniagent.errors import UsageError

pytestmark = [needs_lerobot, pytest.mark.slow]
LENGTHS = (12, 9, 15, 11, 10)
"""Rows of the episodes, all different, so that none can pass for another."""
SAID = "put the carrot on the plate"


@dataclass(frozen=True)
class Made:
    """A collection published in two batches, and what was made of it."""

    root: Path
    recordings: dict[str, Recording]
    first_batch: dict[str, str]
    """Hashes of the large files after the first batch."""

    @property
    def datasets(self) -> dict[str, Path]:
        names = {"whole": "demos/dataset", "other": "more/dataset", "merged": "merged", "train": "parts/train"}
        return {name: self.root / path for name, path in {**names, "val": "parts/val"}.items()}

    def read(self, name: str) -> dict[str, Any]:
        """What lerobot reads of a dataset."""
        number = list(self.datasets).index(name)
        with np.load(self.root / "read" / f"{number}.npz") as held:
            return {**{key: held[key] for key in held.files}, "facts": json.loads(str(held["facts"]))}

    def expected(self, name: str) -> list[tuple[str, Recording]]:
        """The episodes of a dataset, as its own meta/maniagent.jsonl has them."""
        return [(info.key, self.recordings[info.key]) for info in read_ledger(self.datasets[name]) or ()]


def large_files(dataset: Path) -> dict[str, str]:
    paths = [path for kind in ("parquet", "mp4") for path in dataset.rglob(f"*.{kind}") if path.name != "tasks.parquet"]
    return {str(path.relative_to(dataset)): hashlib.sha256(path.read_bytes()).hexdigest() for path in paths}


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Made:
    root = tmp_path_factory.mktemp("lerobot")
    recordings: dict[str, Recording] = {}
    first: dict[str, str] = {}
    for collection, keys in (("demos", "abcde"), ("more", "vw")):
        for number, key in enumerate(keys):
            recordings[key] = made_recording(LENGTHS[number], seed=ord(key), depth=True)
            stage(root / collection / "episodes", key, recordings[key], paraphrases=["carrot to plate"])
    with Writer(PYTHON) as writer:
        publish(root / "demos", writer=writer, batch=3, watcher=lambda p: first or first.update(large_files(p.dataset)))
        publish(root / "more", writer=writer)
        merge([root / "demos" / "dataset", root / "more" / "dataset"], root / "merged", writer=writer)
        split(root / "demos" / "dataset", {"train": 0.6, "val": 2}, root / "parts", writer=writer)
    made = Made(root, recordings, first)
    (root / "read").mkdir()
    reader = Path(__file__).with_name("lerobot_reader.py")
    assert PYTHON is not None
    subprocess.run([PYTHON, reader, root / "read", *made.datasets.values()], check=True, capture_output=True)
    return made


DATASETS = pytest.mark.parametrize("name", ["whole", "other", "merged", "train", "val"])


@DATASETS
def test_each_number_comes_back_in_its_row(made: Made, name: str) -> None:
    read, expected = made.read(name), made.expected(name)
    steps = [recording.steps for _, recording in expected]
    assert np.array_equal(read["episode_index"], np.repeat(np.arange(len(steps)), [len(s.time) for s in steps]))
    for feature, parts in {
        "observation.state": [np.column_stack([s.joints, s.opening]) for s in steps],
        "observation.ee_pose": [s.tcp for s in steps],
        "action": [np.column_stack([s.joint_targets, s.opening_target]) for s in steps],
        "ee_delta": [np.column_stack([s.tcp_delta, s.opening_target]) for s in steps],
        "timestamp": [s.time for s in steps],
    }.items():
        assert np.array_equal(read[feature], np.concatenate(parts).astype(np.float32)), feature
    assert read["subtask"].tolist() == [text for s in steps for text in s.subtasks]
    assert set(read["task"]) <= {SAID, "carrot to plate"}


@DATASETS
def test_each_image_comes_back_in_its_row(made: Made, name: str) -> None:
    read, expected = made.read(name), made.expected(name)
    for camera in ("main", "side"):
        there = (255 * read[f"observation.images.{camera}"].transpose(0, 2, 3, 1)).round()
        wanted = np.concatenate([recording.rgb[camera] for _, recording in expected])
        assert np.abs(there - wanted).mean() < 6
        assert np.array_equal(nearest(there, wanted), np.arange(len(wanted)))


def nearest(images: NDArray[Any], among: NDArray[Any]) -> NDArray[np.int_]:
    """For each image the number of the one that it is most like."""
    flat, others = (part.reshape(len(part), -1).astype(np.float32) for part in (images, among))
    return np.array([np.abs(others - image).mean(axis=1).argmin() for image in flat])


def test_depth_comes_back_to_the_millimetre(made: Made) -> None:
    read, expected = made.read("merged"), made.expected("merged")
    wanted = np.concatenate([recording.depth["side"] for _, recording in expected])
    decoded = [np.asarray(Image.open(io.BytesIO(base64.b64decode(text)))) for text in read["depth.side"]]
    assert np.array_equal(decoded, wanted)


@DATASETS
def test_image_statistics_are_those_of_the_images(made: Made, name: str) -> None:
    stats = json.loads((made.datasets[name] / "meta" / "stats.json").read_text())["observation.images.main"]
    images = np.concatenate([recording.rgb["main"] for _, recording in made.expected(name)]) / 255
    assert np.allclose(np.ravel(stats["mean"]), images.mean(axis=(0, 1, 2)), atol=1e-3)
    assert np.allclose(np.ravel(stats["std"]), images.std(axis=(0, 1, 2)), atol=1e-3)


@given(arrays(np.uint8, st.tuples(st.integers(1, 40), st.just(3))))
def test_counted_bytes_have_the_statistics_of_the_bytes(bytes_: NDArray[np.uint8]) -> None:
    counts = np.stack([np.bincount(channel, minlength=256) for channel in bytes_.T])
    found = moments(counts)
    for name in ("min", "max", "mean", "std"):
        assert np.allclose(found[name], getattr(bytes_, name)(axis=0)), name
    assert found["count"] == [len(bytes_)]
    shares = [0.01, 0.5, 0.99]
    expected = np.quantile(bytes_, shares, axis=0, method="inverted_cdf")
    assert np.allclose(quantiles(counts, shares), expected)


def test_the_dataset_says_what_it_is(made: Made) -> None:
    facts = made.read("whole")["facts"]
    assert (facts["robot"], facts["fps"], facts["episodes"]) == ("widowx_250s", FPS, len(LENGTHS))
    assert facts["names"]["action"] == [*JOINTS, "opening"]
    assert facts["names"]["ee_delta"] == ["dx", "dy", "dz", "rx", "ry", "rz", "opening"]


def test_lerobot_only_adds_files_where_they_are_hard_links(made: Made) -> None:
    assert made.first_batch.items() <= large_files(made.datasets["whole"]).items()


def test_a_split_leaves_no_episode_out_and_has_none_twice(made: Made) -> None:
    keys = [key for name in ("train", "val") for key, _ in made.expected(name)]
    assert sorted(keys) == list("abcde")
    assert len(made.expected("val")) == 2


def test_what_does_not_fit_is_not_merged(made: Made, tmp_path: Path) -> None:
    whole, other = made.datasets["whole"], made.datasets["other"]
    with Writer(PYTHON) as writer:
        with pytest.raises(UsageError, match="5 episodes are in more than one"):
            merge([whole, other, whole], tmp_path / "out", writer=writer)
        with pytest.raises(UsageError, match="there already"):
            merge([whole, other], made.root / "parts", writer=writer)
        with pytest.raises(UsageError, match="at least two"):
            merge([whole], tmp_path / "out", writer=writer)
    assert list(tmp_path.iterdir()) == []


_PUBLISHING = """
import sys, pathlib
from maniagent.data.lerobot import Writer, publish
with Writer(pathlib.Path(sys.argv[2])) as writer:
    print("started", flush=True)
    publish(pathlib.Path(sys.argv[1]), writer=writer, batch=1, watcher=lambda p: print(p.total, flush=True))
"""


def test_killed_at_any_moment_every_episode_is_in_once(tmp_path: Path) -> None:
    keys = [f"e{n}" for n in range(6)]
    for key in keys:
        stage(tmp_path / "episodes", key, made_recording(10))
    draw = np.random.default_rng(0)
    command = [sys.executable, "-c", _PUBLISHING, str(tmp_path), str(PYTHON)]
    for kill in range(3):
        with subprocess.Popen(command, stdout=subprocess.PIPE) as process:
            assert process.stdout is not None
            process.stdout.readline()
            process.stdout.readline()  # one more is in, and the next is being written
            time.sleep(draw.uniform(0, 0.6))
            process.send_signal(signal.SIGKILL)
        there = [info.key for info in read_ledger(tmp_path / "dataset") or ()]
        left = {path.name for path in (tmp_path / "episodes").glob("e*")}
        assert there == keys[: len(there)]
        assert len(there) > kill
        assert set(there) | left == set(keys)
    with Writer(PYTHON) as writer:
        assert publish(tmp_path, writer=writer).total == len(keys)
    assert [info.key for info in read_ledger(tmp_path / "dataset") or ()] == keys
