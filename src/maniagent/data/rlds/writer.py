"""Writes an RLDS dataset with tensorflow_datasets: a program of its own, not of maniagent.

TensorFlow is heavy, and who trains OpenVLA or CogACT has it in another environment, in versions that those want. This
file therefore imports numpy and tensorflow_datasets alone and is run by an interpreter that has them (client.py does).

On stdin: a line of JSON, {"name", "version", "folder", "description", "images": {NAME: [H, W, 3]}, "joints": J}; then
episodes, each its length in 8 bytes, big-endian, and so many bytes of an npz file; then a length of 0. An npz file has
state (T, 7), joint_state (T, J), action (T, 7), subtask (T,), language_instruction, key, episode_index, and for each
picture NAME.bytes, JPEG files one after another, and NAME.ends (T,), where each of them ends.

On stdout: a line {"ok": {...}} once everything is imported, and one with the counts of what can be read back at the
end; or {"error": {"kind": EXCEPTION, "message": TEXT, "errno": NUMBER or null}}. What libraries print goes to stderr.

Episodes are taken from stdin when they are wanted, one at a time: whoever sends them has to wait meanwhile.
"""

from __future__ import annotations

import io
import json
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

BUFFER = 64 << 20
"""Bytes of episodes that are shuffled in memory; tensorflow_datasets would take a gigabyte before it takes the disk."""
Episode = dict[str, NDArray[Any]]


class Ended(Exception):
    """The episodes stopped before their end: whoever sent them gave up."""


def read_episodes(stream: BinaryIO) -> Iterator[Episode]:
    """The episodes on a stream, up to the length of 0. Raises Ended where it ends earlier."""
    while length := int.from_bytes(_exactly(stream, 8), "big"):
        with np.load(io.BytesIO(_exactly(stream, length)), allow_pickle=False) as arrays:
            yield dict(arrays)


def _exactly(stream: BinaryIO, length: int) -> bytes:
    data = stream.read(length)
    if len(data) != length:
        raise Ended(f"{length} bytes were to come, {len(data)} came")
    return data


def to_example(episode: Episode, images: list[str]) -> dict[str, Any]:
    """An episode as the features of `features` have it."""
    last = len(episode["action"]) - 1
    pictures = {name: cut(episode[f"{name}.bytes"], episode[f"{name}.ends"]) for name in images}
    steps = [
        {
            "observation": {
                **{name: io.BytesIO(files[row]) for name, files in pictures.items()},
                "state": episode["state"][row],
                "joint_state": episode["joint_state"][row],
            },
            "action": episode["action"][row],
            "discount": np.float32(1.0),
            "reward": np.float32(row == last),
            "is_first": row == 0,
            "is_last": row == last,
            "is_terminal": row == last,
            "language_instruction": str(episode["language_instruction"]),
            "subtask": str(episode["subtask"][row]),
        }
        for row in range(last + 1)
    ]
    about = {"key": str(episode["key"]), "episode_index": np.int32(episode["episode_index"])}
    return {"steps": steps, "episode_metadata": about}


def cut(joined: NDArray[np.uint8], ends: NDArray[np.int64]) -> list[bytes]:
    """The files that lie one after another in an array of bytes."""
    whole = joined.tobytes()
    return [whole[start:end] for start, end in zip([0, *ends[:-1]], ends, strict=True)]


def features(images: dict[str, list[int]], joints: int) -> Any:
    """The dataset's features, as RLDS wants them."""
    import tensorflow_datasets as tfds

    def numbers(length: int) -> Any:
        return tfds.features.Tensor(shape=(length,), dtype=np.float32)

    def scalar(kind: Any) -> Any:
        return tfds.features.Scalar(dtype=kind)

    pictures = {
        name: tfds.features.Image(shape=tuple(shape), dtype=np.uint8, encoding_format="jpeg")
        for name, shape in images.items()
    }
    step = {
        "observation": tfds.features.FeaturesDict({**pictures, "state": numbers(7), "joint_state": numbers(joints)}),
        "action": numbers(7),
        **{name: scalar(np.float32) for name in ("discount", "reward")},
        **{name: scalar(np.bool_) for name in ("is_first", "is_last", "is_terminal")},
        **{name: tfds.features.Text() for name in ("language_instruction", "subtask")},
    }
    about = tfds.features.FeaturesDict({"key": tfds.features.Text(), "episode_index": scalar(np.int32)})
    return tfds.features.FeaturesDict({"steps": tfds.features.Dataset(step), "episode_metadata": about})


def write(request: dict[str, Any], stream: BinaryIO) -> dict[str, Any]:
    """Write the episodes on the stream to `folder`/NAME/VERSION, and count what can be read there."""
    import tensorflow_datasets as tfds
    from tensorflow_datasets.core import shuffle

    shuffle.MAX_MEM_BUFFER_SIZE = BUFFER
    names = list(request["images"])
    examples = ((f"{number:08d}", to_example(e, names)) for number, e in enumerate(read_episodes(stream)))
    tfds.dataset_builders.store_as_tfds_dataset(
        name=request["name"],
        version=request["version"],
        features=features(request["images"], request["joints"]),
        split_datasets={"train": examples},
        data_dir=request["folder"],
        description=request["description"],
    )
    return count(Path(request["folder"]) / request["name"] / request["version"])


def count(folder: Path) -> dict[str, Any]:
    """Load the dataset again, with steps as whole arrays as OpenVLA has it; count episodes, steps, last steps."""
    import tensorflow_datasets as tfds

    read = tfds.builder_from_directory(folder).as_dataset(
        split="train",
        decoders={"steps": tfds.decode.SkipDecoding()},
        read_config=tfds.ReadConfig(try_autocache=False, skip_prefetch=True, interleave_cycle_length=1),
    )
    lasts = [episode["steps"]["is_last"].numpy() for episode in read]
    ended = sum(int(is_last.sum() == 1 and is_last[-1]) for is_last in lasts)
    return {"episodes": len(lasts), "steps": sum(map(len, lasts)), "ends": ended}


def main() -> None:
    """Do what stdin asks for, and say how it went."""
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "w", encoding="utf-8")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    import tensorflow  # noqa: F401 - tensorflow_datasets only imports it when it is too late to say so
    import tensorflow_datasets as tfds

    def say(what: dict[str, Any]) -> None:
        answers.write(json.dumps(what) + "\n")
        answers.flush()

    say({"ok": {"tensorflow_datasets": tfds.__version__}})
    stream = sys.stdin.buffer
    try:
        say({"ok": write(json.loads(stream.readline()), stream)})
    except Exception as error:  # noqa: BLE001 - the edge of the process: whoever asked shall hear why
        number = error.errno if isinstance(error, OSError) else None
        say({"error": {"kind": type(error).__name__, "message": str(error), "errno": number}})


if __name__ == "__main__":
    main()
