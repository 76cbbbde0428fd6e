"""A small LeRobotDataset v3 written by pyarrow and av alone, with which tests need no LeRobot.

test_dataset_layout.py holds it to what LeRobot itself writes, where there is one.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import av
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

FPS = 10
SIZE = (64, 48)
"""Width and height, px."""
NAMES = ["waist", "shoulder", "elbow", "forearm_roll", "wrist_angle", "wrist_rotate", "opening"]
CAMERA = "observation.images.main"
TASKS = ("put the carrot on the plate", "place the carrot onto the plate")
SUBTASKS = ("pick up the carrot", "put it on the plate")
LENGTHS = (12, 15, 11, 14)

DATA = "data/chunk-000/file-{:03d}.parquet"
VIDEO = f"videos/{CAMERA}/chunk-000/file-000.mp4"
EPISODES = "meta/episodes/chunk-000/file-000.parquet"

_BOOKKEEPING = ("timestamp", "frame_index", "episode_index", "index", "task_index")


def made_dataset(root: Path, lengths: Sequence[int] = LENGTHS, files: int = 2, dark: int | None = None) -> Path:
    """Write episodes of these lengths into `root`, spread over `files` data files and one video file.

    The pictures of episode `dark` are black.
    """
    episodes, start = [], 0
    for number, length in enumerate(lengths):
        episodes.append(_episode(number, length, start))
        start += length
    parts = np.array_split(np.arange(len(lengths)), files)
    file_of = {int(number): file for file, part in enumerate(parts) for number in part}
    for file, part in enumerate(parts):
        _write(root / DATA.format(file), [_table(episodes[int(number)]) for number in part])
    _write(root / EPISODES, [pa.Table.from_pylist(_metadata(episodes, file_of))])
    names = pa.array(TASKS, pa.large_string())
    _write(root / "meta/tasks.parquet", [pa.table({"task_index": [0, 1], "__index_level_0__": names})])
    _write_video(root / VIDEO, lengths, dark)
    whole = {key: np.concatenate([episode[key] for episode in episodes]) for key in _numeric(episodes[0])}
    statistics = {key: _statistics(column) for key, column in whole.items()} | {CAMERA: _picture_statistics(start)}
    _write_json(root / "meta/stats.json", statistics)
    _write_json(root / "meta/info.json", _info(len(lengths), start))
    return root


def edit_json(path: Path, edit: Callable[[Any], None]) -> None:
    """Change what a JSON file holds."""
    value = json.loads(path.read_text())
    edit(value)
    _write_json(path, value)


def edit_column(path: Path, name: str, edit: Callable[[list[Any]], None]) -> None:
    """Change a column of a Parquet file, cell by cell."""
    table = pq.read_table(path)
    cells = table[name].to_pylist()
    edit(cells)
    index = table.schema.get_field_index(name)
    pq.write_table(table.set_column(index, name, pa.array(cells, table.schema.field(index).type)), path)


def edit_table(path: Path, edit: Callable[[pa.Table], pa.Table]) -> None:
    """Change a Parquet file as a whole."""
    pq.write_table(edit(pq.read_table(path)), path)


def _episode(number: int, length: int, start: int) -> dict[str, Any]:
    t = np.arange(length)
    rng = np.random.default_rng(number)
    state = (0.4 * np.sin(0.15 * t[:, None] + rng.uniform(0, 6, 7))).astype(np.float32)
    state[:, 6] = 0.04 + 0.02 * np.cos(0.2 * t)
    return {
        "observation.state": state,
        "action": state + np.float32(0.001),
        "subtask": [SUBTASKS[int(i >= length // 2)] for i in t],
        "timestamp": (t / FPS).astype(np.float32),
        "frame_index": t,
        "episode_index": np.full(length, number),
        "index": start + t,
        "task_index": np.full(length, number % len(TASKS)),
    }


def _numeric(episode: dict[str, Any]) -> list[str]:
    return [name for name in episode if name != "subtask"]


def _table(episode: dict[str, Any]) -> pa.Table:
    columns = {}
    for name, column in episode.items():
        is_vector = isinstance(column, np.ndarray) and column.ndim == 2
        columns[name] = pa.FixedSizeListArray.from_arrays(column.ravel(), 7) if is_vector else pa.array(column)
    return pa.table(columns)


def _metadata(episodes: list[dict[str, Any]], file_of: dict[int, int]) -> list[dict[str, Any]]:
    rows, start = [], 0
    for number, episode in enumerate(episodes):
        length = len(episode["index"])
        row: dict[str, Any] = {
            "episode_index": number,
            "tasks": [TASKS[number % len(TASKS)]],
            "length": length,
            "data/chunk_index": 0,
            "data/file_index": file_of[number],
            "dataset_from_index": start,
            "dataset_to_index": start + length,
            f"videos/{CAMERA}/chunk_index": 0,
            f"videos/{CAMERA}/file_index": 0,
            f"videos/{CAMERA}/from_timestamp": start / FPS,
            f"videos/{CAMERA}/to_timestamp": (start + length) / FPS,
        }
        statistics = {key: _statistics(episode[key]) for key in _numeric(episode)}
        for key, by_name in (statistics | {CAMERA: _picture_statistics(length)}).items():
            row |= {f"stats/{key}/{name}": value for name, value in by_name.items()}
        rows.append(row | {"meta/episodes/chunk_index": 0, "meta/episodes/file_index": 0})
        start += length
    return rows


def _statistics(column: np.ndarray) -> dict[str, list[Any]]:
    table = column.reshape(len(column), -1)
    found = {
        "min": table.min(axis=0),
        "max": table.max(axis=0),
        "mean": table.mean(axis=0, dtype=float),
        "std": table.std(axis=0, dtype=float),
        "count": np.array([len(table)]),
    }
    quantiles = {f"q{q:02d}": np.quantile(table, q / 100, axis=0) for q in (1, 10, 50, 90, 99)}
    return {name: value.tolist() for name, value in (found | quantiles).items()}


def _picture_statistics(count: int) -> dict[str, Any]:
    of = {"min": 0.1, "max": 0.9, "mean": 0.4, "std": 0.2, "q01": 0.1, "q10": 0.2, "q50": 0.4, "q90": 0.6, "q99": 0.9}
    return {name: [[[value]]] * 3 for name, value in of.items()} | {"count": [count]}


def picture(episode: int, frame: int) -> np.ndarray:
    """(H, W, 3): a square that moves over a plain ground."""
    image = np.full((SIZE[1], SIZE[0], 3), 80 + 20 * (episode % 4), np.uint8)
    image[10:22, 2 * frame : 2 * frame + 12] = (220, 90, 30)
    return image


def _write_video(path: Path, lengths: Sequence[int], dark: int | None) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=FPS)
        stream.width, stream.height, stream.pix_fmt = *SIZE, "yuv420p"
        stream.options = {"g": "2", "crf": "23", "preset": "ultrafast", "bf": "0"}
        for episode, length in enumerate(lengths):
            for frame in range(length):
                image = picture(episode, frame) * (episode != dark)
                container.mux(stream.encode(av.VideoFrame.from_ndarray(image, format="rgb24")))
        container.mux(stream.encode())


def _info(episodes: int, frames: int) -> dict[str, Any]:
    vector = {"dtype": "float32", "shape": [7], "names": NAMES}
    kinds = {name: "float32" if name == "timestamp" else "int64" for name in _BOOKKEEPING}
    names = ["height", "width", "channels"]
    video = {"dtype": "video", "shape": [SIZE[1], SIZE[0], 3], "names": names, "info": _video_info()}
    return {
        "codebase_version": "v3.0",
        "robot_type": "widowx_250s",
        "total_episodes": episodes,
        "total_frames": frames,
        "total_tasks": len(TASKS),
        "chunks_size": 1000,
        "data_files_size_in_mb": 100,
        "video_files_size_in_mb": 200,
        "fps": FPS,
        "splits": {"train": f"0:{episodes}"},
        "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
        "video_path": "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4",
        "features": {
            "observation.state": vector,
            "action": vector,
            CAMERA: video,
            "subtask": {"dtype": "string", "shape": [1], "names": None},
            **{name: {"dtype": kind, "shape": [1], "names": None} for name, kind in kinds.items()},
        },
    }


def _video_info() -> dict[str, Any]:
    return {
        "video.height": SIZE[1],
        "video.width": SIZE[0],
        "video.codec": "h264",
        "video.pix_fmt": "yuv420p",
        "video.is_depth_map": False,
        "video.fps": FPS,
        "video.channels": 3,
        "has_audio": False,
    }


def _write(path: Path, tables: list[pa.Table]) -> None:
    """One row group for each table, as LeRobot has one for each episode."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with pq.ParquetWriter(path, tables[0].schema) as writer:
        for table in tables:
            writer.write_table(table)


def _write_json(path: Path, value: Any) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(value, indent=4))
