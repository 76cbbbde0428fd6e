"""Which episodes are published, and when not; a writer in the place of lerobot's, so that no lerobot is needed."""

from __future__ import annotations

import json
import threading
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from staged import made_info, made_recording, stage

from maniagent.data.lerobot import Published, Writer, WriterFailure, publish
from maniagent.data.lerobot.generation import locked
from maniagent.data.lerobot.ledger import read_ledger
from maniagent.data.lerobot.publish import phrase
from maniagent.data.lerobot.schema import read_schema, schema_of
from maniagent.data.lerobot.writer import read_columns
from maniagent.errors import SetupError, UsageError


class Scribe(Writer):
    """Writes only what the rest looks at: meta/info.json, and the names of the episodes that it was given."""

    def __init__(self) -> None:
        self.batches: list[list[str]] = []
        self.raises: BaseException | None = None

    def append(
        self, dataset: Path, schema: Mapping[str, Any], episodes: Sequence[tuple[Path, str]], codec: str = ""
    ) -> float:
        (dataset / "meta").mkdir(parents=True, exist_ok=True)
        path = dataset / "meta" / "info.json"
        info = json.loads(path.read_text()) if path.exists() else {**schema, "total_episodes": 0}
        info["total_episodes"] += len(episodes)
        path.write_text(json.dumps(info))
        if self.raises is not None:
            raise self.raises
        self.batches.append([folder.name for folder, _ in episodes])
        return 0.5


def keys(collection: Path) -> list[str]:
    return [info.key for info in read_ledger(collection / "dataset") or ()]


@pytest.fixture
def collection(tmp_path: Path) -> Path:
    for key in ("e2", "e0", "e1"):
        stage(tmp_path / "episodes", key)
    return tmp_path


def test_episodes_are_published_in_the_order_of_their_keys_and_leave_their_folder(collection: Path) -> None:
    scribe, told = Scribe(), []
    done = publish(collection, writer=scribe, batch=2, watcher=told.append)
    assert scribe.batches == [["e0", "e1"], ["e2"]]
    assert keys(collection) == ["e0", "e1", "e2"]
    assert done == Published(collection / "dataset", added=3, total=3, processor_seconds=1.0)
    assert [so_far.total for so_far in told] == [2, 3]
    assert list((collection / "episodes").glob("*/episode.json")) == []


def test_publishing_again_adds_what_is_new(collection: Path) -> None:
    publish(collection, writer=Scribe())
    stage(collection / "episodes", "a-late-one")
    assert publish(collection, writer=Scribe()) == Published(
        collection / "dataset", added=1, total=4, processor_seconds=0.5
    )
    assert keys(collection) == ["e0", "e1", "e2", "a-late-one"]


def test_without_anything_staged_nothing_is_made(tmp_path: Path) -> None:
    assert publish(tmp_path, writer=Scribe()).total == 0
    assert not (tmp_path / "dataset").exists()


def test_only_valid_episodes_are_published(collection: Path) -> None:
    stage(collection / "episodes", "failed", label="failed")
    stage(collection / "episodes", "half").rename(collection / "episodes" / ".half")
    stage(collection / "episodes" / "quarantine", "odd")
    publish(collection, writer=Scribe())
    assert keys(collection) == ["e0", "e1", "e2"]
    assert (collection / "episodes" / "failed").exists()
    assert (collection / "episodes" / "quarantine" / "odd").exists()


def test_what_a_kill_left_staged_though_it_is_in_is_not_published_twice(collection: Path) -> None:
    publish(collection, writer=Scribe())
    stage(collection / "episodes", "e1")  # as though the kill had come before its folder was removed
    assert publish(collection, writer=Scribe()).added == 0
    assert keys(collection) == ["e0", "e1", "e2"]
    assert not (collection / "episodes" / "e1").exists()


@pytest.mark.parametrize("error", [WriterFailure("no"), SetupError("full"), KeyboardInterrupt()])
def test_a_batch_that_fails_leaves_the_dataset_and_its_episodes(collection: Path, error: BaseException) -> None:
    scribe = Scribe()
    publish(collection, writer=scribe)
    stage(collection / "episodes", "e9")
    scribe.raises = error
    with pytest.raises(type(error)):
        publish(collection, writer=scribe)
    assert keys(collection) == ["e0", "e1", "e2"]
    assert (collection / "episodes" / "e9").exists()
    scribe.raises = None
    assert publish(collection, writer=scribe).total == 4


@pytest.mark.parametrize(
    ("other", "told"),
    [
        ({"size": (32, 24)}, "observation.images.main is video 24 x 32 x 3 height, width, channels, there video 48"),
        ({"cameras": ("main",)}, "observation.images.side is missing here"),
        ({"cameras": ("main", "side", "top")}, "observation.images.top is missing there"),
        ({"depth": True}, "depth.main is missing there"),
    ],
)
def test_an_episode_of_other_images_is_refused_with_what_differs(
    collection: Path, other: dict[str, Any], told: str
) -> None:
    publish(collection, writer=Scribe())
    stage(collection / "episodes", "e5", made_recording(**other))
    with pytest.raises(UsageError, match=told):
        publish(collection, writer=Scribe())
    assert keys(collection) == ["e0", "e1", "e2"]


def test_an_episode_of_another_rate_or_robot_is_refused(collection: Path) -> None:
    publish(collection, writer=Scribe())
    stage(collection / "episodes", "e5", fps=5)
    with pytest.raises(UsageError, match="5 frames a second, there 10"):
        publish(collection, writer=Scribe())
    with pytest.raises(UsageError, match="robot panda, there widowx_250s"):
        publish(collection, writer=Scribe(), robot_type="panda")


def test_one_that_differs_among_the_first_is_refused_before_anything_is_written(collection: Path) -> None:
    stage(collection / "episodes", "e9", made_recording(size=(32, 24)))
    with pytest.raises(UsageError, match="e9 doesn't fit"):
        publish(collection, writer=Scribe(), batch=1)
    assert not (collection / "dataset").exists()


def test_a_rate_that_videos_cannot_have_is_refused(tmp_path: Path) -> None:
    stage(tmp_path / "episodes", "e0", fps=7.5)
    with pytest.raises(UsageError, match=r"whole number of frames a second, not 7\.5"):
        publish(tmp_path, writer=Scribe())


def test_a_dataset_that_no_collection_made_is_left_alone(collection: Path) -> None:
    publish(collection, writer=Scribe())
    (collection / "dataset" / "meta" / "maniagent.jsonl").unlink()
    with pytest.raises(UsageError, match="no collection made"):
        publish(collection, writer=Scribe())


@pytest.mark.parametrize(
    ("file", "text"),
    [("maniagent.jsonl", "{"), ("maniagent.jsonl", ""), ("info.json", "{"), ("info.json", "[]"), ("info.json", "{}")],
)
def test_a_damaged_dataset_is_told_not_added_to(collection: Path, file: str, text: str) -> None:
    publish(collection, writer=Scribe())
    stage(collection / "episodes", "e5")
    (collection / "dataset" / "meta" / file).write_text(text)
    with pytest.raises(UsageError, match=file):
        publish(collection, writer=Scribe())


def test_a_damaged_episode_is_named(collection: Path) -> None:
    (collection / "episodes" / "e1" / "rgb-main.npy").write_bytes(b"?")
    with pytest.raises(UsageError, match=r"e1/rgb-main\.npy can't be read"):
        publish(collection, writer=Scribe())


def test_two_cannot_publish_at_once(collection: Path) -> None:
    with locked(collection), pytest.raises(UsageError, match="Another process"):
        publish(collection, writer=Scribe(), wait=0.0)


def test_two_that_publish_at_once_with_patience_add_each_episode_once(collection: Path) -> None:
    threads = [threading.Thread(target=publish, args=[collection], kwargs={"writer": Scribe()}) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert keys(collection) == ["e0", "e1", "e2"]


@pytest.mark.parametrize(("number", "told"), [(28, "is full"), (30, "can't be worked in")])
def test_a_disk_that_refuses_is_told(collection: Path, number: int, told: str) -> None:
    scribe = Scribe()
    scribe.raises = OSError(number, "no")
    with pytest.raises(SetupError, match=told):
        publish(collection, writer=scribe)
    scribe.raises = None
    assert publish(collection, writer=scribe).total == 3


def test_wrong_use_is_told(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no folder"):
        publish(tmp_path / "nowhere", writer=Scribe())
    with pytest.raises(UsageError, match="at least one"):
        publish(tmp_path, writer=Scribe(), batch=0)


@given(st.lists(st.text(min_size=1), max_size=4), st.integers(0, 10**6))
def test_the_phrase_is_one_of_the_episodes_own_and_always_the_same(paraphrases: list[str], number: int) -> None:
    info = made_info(f"e{number}", paraphrases=tuple(paraphrases))
    assert phrase(info) in (info.instruction, *paraphrases)
    assert phrase(info) == phrase(info.model_copy(update={"seed": 7}))


def test_all_phrases_get_their_turn() -> None:
    said = {phrase(made_info(f"e{n}", paraphrases=("a", "b"))) for n in range(50)}
    assert said == {"put the carrot on the plate", "a", "b"}


def test_the_schema_is_of_what_the_writer_reads(tmp_path: Path) -> None:
    folder = stage(tmp_path, "e0", made_recording(depth=True))
    features = schema_of(folder, made_info("e0")).features
    columns = read_columns(folder)
    assert features.keys() == columns.keys()
    for name, feature in features.items():
        if feature["dtype"] != "string":
            assert list(columns[name].shape[1:]) == feature["shape"]
        if feature["dtype"] == "float32":
            assert columns[name].dtype.name == "float32"
            assert len(feature["names"]) == feature["shape"][0]


def test_a_schema_is_read_as_it_was_written(collection: Path) -> None:
    want = schema_of(collection / "episodes" / "e0", made_info("e0"))
    publish(collection, writer=Scribe())
    assert read_schema(collection / "dataset") == want
