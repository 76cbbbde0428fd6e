"""A small dataset like those that maniagent collects: made_dataset.py's, with the poses and steps of a hand."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from made_dataset import DATA, LENGTHS, edit_json, edit_table, made_dataset
from scipy.spatial.transform import Rotation

from maniagent.data.recording import to_deltas, to_poses
from maniagent.geometry import FloatArray, make_transform, top_down_rotation

CLOSED, OPEN = 0.004, 0.048
"""m, as the WidowX-250s has them."""


def hand_path(episode: int, length: int) -> FloatArray:
    """(length + 1, 4, 4): a hand that is turned and tilted as it moves."""
    t = np.linspace(0.0, 1.0, length + 1)
    return np.stack(
        [
            make_transform(
                Rotation.from_euler("xyz", [0.2 * s, -0.4 * s, 0.5 * episode + s]).as_matrix() @ top_down_rotation(0.0),
                [0.2 + 0.1 * s, 0.05 * np.sin(6 * s + episode), 0.2 - 0.15 * s],
            )
            for s in t
        ]
    )


def gripper_targets(length: int) -> FloatArray:
    """(length,) m: open, closing on row 5, closed, wide open in the last three rows."""
    targets = np.full(length, OPEN)
    targets[5], targets[6:-3] = 0.03, CLOSED
    return targets


def hand_columns(episode: int, length: int) -> dict[str, FloatArray]:
    """(length, 7) `observation.ee_pose` and `ee_delta` of a hand that gets where it is sent by the next row."""
    path = hand_path(episode, length)
    return {
        "observation.ee_pose": to_poses(path[:-1]).astype(np.float32),
        "ee_delta": np.hstack([to_deltas(path), gripper_targets(length)[:, None]]).astype(np.float32),
    }


def made_collected(root: Path, lengths: Sequence[int] = LENGTHS) -> Path:
    """Write a dataset of episodes of these lengths into `root`, all in one data file."""
    made_dataset(root, lengths, files=1)
    columns = [hand_columns(number, length) for number, length in enumerate(lengths)]

    def add(table: pa.Table) -> pa.Table:
        for name in columns[0]:
            joined = np.concatenate([episode[name] for episode in columns])
            table = table.append_column(name, pa.FixedSizeListArray.from_arrays(joined.ravel(), 7))
        return table

    edit_table(root / DATA.format(0), add)

    def promise(info: Any) -> None:
        info["features"] |= {name: {"dtype": "float32", "shape": [7], "names": None} for name in columns[0]}

    edit_json(root / "meta/info.json", promise)
    return root
