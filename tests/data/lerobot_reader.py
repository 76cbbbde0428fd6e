"""Reads datasets as lerobot does; a script for an interpreter that has it: OUT DATASET..., an npz each in OUT."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
from lerobot.datasets.lerobot_dataset import LeRobotDataset

out, *datasets = map(Path, sys.argv[1:])
for number, root in enumerate(datasets):
    data = LeRobotDataset("maniagent/dataset", root=root, video_backend="pyav")
    items = [data[index] for index in range(len(data))]
    columns = {name: np.array([np.asarray(item[name]) for item in items]) for name in items[0]}
    facts = {
        "robot": data.meta.robot_type,
        "fps": data.meta.fps,
        "names": data.meta.names,
        "episodes": data.num_episodes,
    }
    np.savez(out / f"{number}.npz", facts=json.dumps(facts), **columns)
