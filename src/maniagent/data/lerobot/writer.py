"""Appends staged episodes to a LeRobotDataset v3, with lerobot itself: a program of its own, not of maniagent.

lerobot brings eight gigabytes and its own versions of much, and so it often lives in another environment than
maniagent. This file therefore imports numpy and lerobot alone and is run by an interpreter that has them (client.py
does). It stays alive, as lerobot's import takes seconds. One line of JSON on stdin is a request, one on stdout its
answer; whatever libraries print goes to stderr. The end of stdin means that nobody waits for an answer any more.

    {"do": "append", "dataset": PATH, "schema": {...}, "codec": "h264", "episodes": [{"folder": PATH, "task": TEXT}]}
    {"do": "merge", "datasets": [PATH, ...], "out": PATH}
    {"do": "split", "dataset": PATH, "parts": {NAME: [EPISODE, ...]}, "out": PATH}

The answer is {"ok": {...}} or {"error": {"kind": EXCEPTION, "message": TEXT, "errno": NUMBER or null}}.
"""

from __future__ import annotations

import base64
import gc
import io
import json
import os
import queue
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

REPO = "maniagent/dataset"
"""A name that lerobot asks for; the datasets stay on this disk."""
Array = NDArray[Any]


def append(dataset: str, schema: dict[str, Any], codec: str, episodes: list[dict[str, str]]) -> dict[str, Any]:
    """Add the staged episodes to the dataset, which is made where there is none.

    Returns how much was added, and the processor time (s) that this process has taken since it began.

    Nothing in `dataset` may be read before this returns: parquet files have no footer until then. Files that are
    there are never written to, but for those directly in meta/.
    """
    from lerobot.datasets.lerobot_dataset import LeRobotDataset

    root = Path(dataset)
    # The queue's default drops frames where the encoder is slower than the reader; 0 is a queue without a bound,
    # that is, of one episode at most.
    options = {"streaming_encoding": True, "encoder_queue_maxsize": 0}
    if (root / "meta" / "info.json").exists():
        data = LeRobotDataset(REPO, root=root, vcodec=_codec_of(root) or codec, **options)
    else:
        features = {name: {**feature, "shape": tuple(feature["shape"])} for name, feature in schema["features"].items()}
        data = LeRobotDataset.create(
            REPO,
            fps=schema["fps"],
            robot_type=schema["robot_type"],
            features=features,
            root=root,
            vcodec=codec,
            **options,
        )
    frames = sum(_append_one(data, Path(episode["folder"]), episode["task"]) for episode in episodes)
    data.finalize()
    return {"episodes": len(episodes), "frames": frames, "processor_seconds": time.process_time()}


def _codec_of(root: Path) -> str | None:
    """What a dataset's videos are encoded in, as lerobot calls it; None where nothing says."""
    features = json.loads((root / "meta" / "info.json").read_text())["features"].values()
    found = {feature.get("info", {}).get("video.codec") for feature in features if feature["dtype"] == "video"}
    codec: str | None = found.pop() if len(found) == 1 else None
    return {"av1": "libsvtav1"}.get(codec or "", codec)


def _append_one(data: Any, folder: Path, task: str) -> int:
    columns = read_columns(folder)
    length = len(columns["action"])
    for row in range(length):
        # Strings as lerobot wants them: str, not numpy's.
        frame = {name: str(c[row]) if c.dtype.kind == "U" else np.asarray(c[row]) for name, c in columns.items()}
        data.add_frame({**frame, "task": task})
    data.save_episode()
    _check_videos(data, length, folder)
    return length


def _check_videos(data: Any, length: int, folder: Path) -> None:
    """Raise where a video isn't as long as its episode: lerobot only logs it when an encoder falls behind."""
    latest = data.meta.latest_episode
    for key in data.meta.video_keys:
        seconds = latest[f"videos/{key}/to_timestamp"][0] - latest[f"videos/{key}/from_timestamp"][0]
        if abs(seconds * data.fps - length) > 0.5:
            raise RuntimeError(f"{folder}: {key} has {seconds * data.fps:.1f} frames on video, not {length}")


def mend() -> None:
    """Have lerobot, which is imported, write quickly and rightly."""
    _encode_quickly()
    _count_bytes()
    gc.freeze()  # what a hundred packages made when imported needn't be looked through again: a third of the work


def _encode_quickly() -> None:
    """Have lerobot encode h264 with x264's fastest preset, which lerobot can't be told.

    For small images of which every second is a key frame, it is the better bargain than AV1 as lerobot sets it: little
    processor time to encode, a quarter to decode, the same PSNR (38 dB), and a third more bytes (docs/data.md).
    """
    from lerobot.datasets import video_utils

    plain = video_utils._get_codec_options

    def options(vcodec: str, *args: Any, **kwargs: Any) -> dict[str, str]:
        quick = {"preset": "ultrafast", "crf": "28", "threads": "1"} if vcodec == "h264" else {}
        return {**plain(vcodec, *args, **kwargs), **quick}

    video_utils._get_codec_options = options


def _count_bytes() -> None:
    """Have lerobot sum up 8-bit images by counting how often each of the 256 values occurs.

    lerobot 0.4.4 squares 8-bit images in 8 bits: the standard deviation of each episode comes out as 0, that of the
    dataset as the spread of their means, and policies that are normalised by it see images far out of scale. And it
    sorts every image into 5000 bins, which takes longer than encoding it. Counts are exact, and cheap.
    """
    from lerobot.datasets import compute_stats

    class Statistics(compute_stats.RunningQuantileStats):  # type: ignore[misc] # lerobot is untyped
        _counts: Array | None = None
        """(C, 256)"""

        def update(self, batch: Array) -> None:
            if batch.dtype != np.uint8:
                super().update(batch)
                return
            channels = batch.reshape(-1, batch.shape[-1]).T
            counts = np.stack([np.bincount(channel, minlength=256) for channel in channels])
            self._counts = counts if self._counts is None else self._counts + counts

        def get_statistics(self) -> dict[str, Array]:
            if self._counts is None:
                own: dict[str, Array] = super().get_statistics()
                return own
            return dict(zip(self._quantile_keys, quantiles(self._counts, self._quantile_list), strict=True)) | moments(
                self._counts
            )

    compute_stats.RunningQuantileStats = Statistics


def moments(counts: Array) -> dict[str, Array]:
    """Per channel, of (C, 256) counts of the values 0 to 255."""
    values, total = np.arange(256.0), counts.sum(axis=1)
    mean = counts @ values / total
    present = counts > 0
    return {
        "min": present.argmax(axis=1).astype(float),
        "max": 255.0 - present[:, ::-1].argmax(axis=1),
        "mean": mean,
        "std": np.sqrt((counts * (values - mean[:, None]) ** 2).sum(axis=1) / total),
        "count": total[:1],
    }


def quantiles(counts: Array, shares: list[float]) -> list[Array]:
    """For each share (C,): the least value that so large a part of the (C, 256) counted ones doesn't exceed."""
    upto = counts.cumsum(axis=1)
    return [(upto >= share * upto[:, -1:]).argmax(axis=1).astype(float) for share in shares]


def read_columns(folder: Path) -> dict[str, Array]:
    """The features of a staged episode by name, each with T rows (data/episode.py says how an episode lies on disk)."""
    with np.load(folder / "steps.npz", allow_pickle=False) as steps:
        columns: dict[str, Array] = {
            "observation.state": _join(steps["joints"], steps["opening"]),
            "observation.ee_pose": _join(steps["tcp"]),
            "action": _join(steps["joint_targets"], steps["opening_target"]),
            "ee_delta": _join(steps["tcp_delta"], steps["opening_target"]),
            "subtask": steps["subtasks"],
        }
    for path in sorted(folder.glob("rgb-*.npy")):
        columns[f"observation.images.{path.stem.removeprefix('rgb-')}"] = np.load(path, mmap_mode="r")
    for path in sorted(folder.glob("depth-*.npy")):
        columns[f"depth.{path.stem.removeprefix('depth-')}"] = _as_text(np.load(path, mmap_mode="r"))
    lengths = {name: len(column) for name, column in columns.items()}
    if len(set(lengths.values())) != 1 or not lengths["action"]:
        raise ValueError(f"{folder}: the columns have {lengths} rows")
    for name, column in columns.items():
        if column.dtype.kind == "f" and not np.isfinite(column).all():
            raise ValueError(f"{folder}: {name} holds what is no number")
    return columns


def _join(*columns: Array) -> Array:
    """Columns side by side, as float32: what policies are trained on."""
    return np.concatenate([np.reshape(c, (len(c), -1)) for c in columns], axis=1).astype(np.float32)


def _as_text(depth: Array) -> Array:
    """Depth images (T, H, W) uint16 as the text of 16-bit PNGs.

    Lossless, and as large as the arrays that lerobot could keep, but those take 40 ms of each frame that is loaded,
    wanted or not, and come with statistics that mean nothing.
    """
    from PIL import Image

    texts = []
    for image in depth:
        file = io.BytesIO()
        Image.fromarray(np.ascontiguousarray(image)).save(file, "PNG")
        texts.append(base64.b64encode(file.getvalue()).decode("ascii"))
    return np.array(texts)


def merge(datasets: list[str], out: str) -> dict[str, Any]:
    """One dataset of several, in their order."""
    from lerobot.datasets.aggregate import aggregate_datasets

    aggregate_datasets([REPO] * len(datasets), REPO, [Path(d) for d in datasets], Path(out))
    return {}


def split(dataset: str, parts: dict[str, list[int]], out: str) -> dict[str, Any]:
    """Several datasets of one, each under its name in the folder `out`."""
    from lerobot.datasets.dataset_tools import split_dataset
    from lerobot.datasets.lerobot_dataset import LeRobotDataset

    split_dataset(LeRobotDataset(REPO, root=dataset), parts, out)
    return {}


_WORK: dict[str, Callable[..., dict[str, Any]]] = {"append": append, "merge": merge, "split": split}


def answer(line: str) -> dict[str, Any]:
    """What a request comes to."""
    request = json.loads(line)
    try:
        return {"ok": _WORK[request.pop("do")](**request)}
    except Exception as error:  # noqa: BLE001 - the edge of the process: whoever asked shall hear why
        number = error.errno if isinstance(error, OSError) else None
        return {"error": {"kind": type(error).__name__, "message": str(error), "errno": number}}


def _read_requests(requests: queue.SimpleQueue[str]) -> None:
    for line in sys.stdin:
        requests.put(line)
    os._exit(0)  # whoever asked is gone: what is half written is theirs to throw away


def main() -> None:
    """Answer requests until stdin ends."""
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "w", encoding="utf-8")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    import lerobot
    import lerobot.datasets.lerobot_dataset

    def say(what: dict[str, Any]) -> None:
        answers.write(json.dumps(what) + "\n")
        answers.flush()

    mend()
    say({"ok": {"lerobot": lerobot.__version__}})
    requests: queue.SimpleQueue[str] = queue.SimpleQueue()
    threading.Thread(target=_read_requests, args=(requests,), daemon=True).start()
    while True:
        say(answer(requests.get()))


if __name__ == "__main__":
    main()
