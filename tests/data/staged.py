"""Small staged episodes that no robot ever played: what tests of datasets are made of."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from maniagent.data.episode import EpisodeInfo, Recording, Steps

FPS = 10
CAMERAS = ("main", "side")


def made_recording(
    T: int = 12,
    cameras: tuple[str, ...] = CAMERAS,
    size: tuple[int, int] = (64, 48),
    seed: int = 0,
    depth: bool = False,
) -> Recording:
    """T rows of smooth numbers, and images (width, height) in which a square wanders; another one for each seed."""
    rng = np.random.default_rng(seed)
    time = np.arange(T) / FPS
    joints = 0.5 * np.sin(time[:, None] + rng.uniform(0, 6, 6))
    tcp = np.column_stack([0.3 + 0.05 * np.sin(time[:, None] + rng.uniform(0, 6, 3)), np.tile([0, 0, 0, 1.0], (T, 1))])
    opening = 0.03 + 0.01 * np.cos(time)
    steps = Steps(
        time=time,
        joints=joints,
        opening=opening,
        tcp=tcp,
        joint_targets=joints + 0.01,
        opening_target=opening + 0.001,
        tcp_delta=np.diff(tcp[:, [0, 1, 2, 3, 4, 5]], axis=0, prepend=tcp[:1, :6]),
        subtasks=tuple("pick up the carrot" if t < T // 2 else "put it on the plate" for t in range(T)),
    )
    rgb = {camera: _images(T, size, rng) for camera in cameras}
    millimetres = {camera: 600 + images[..., 0].astype(np.uint16) for camera, images in rgb.items()}
    return Recording(steps, rgb, millimetres if depth else {})


def made_info(key: str, **changed: Any) -> EpisodeInfo:
    """What is known of a valid episode."""
    facts: dict[str, Any] = {
        "task": "carrot-on-plate", "instruction": "put the carrot on the plate", "fps": FPS, "seed": 0,
        "start": (0.3, 0.0, 0.0), "label": "valid", "distance": 0.01,
    }  # fmt: skip
    return EpisodeInfo(key=key, **{**facts, **changed})


def stage(folder: Path, key: str, recording: Recording | None = None, **changed: Any) -> Path:
    """Lay an episode into `folder` (a collection's `episodes`) as data/episode.py says; returns its own folder."""
    recording = recording or made_recording(seed=sum(key.encode()))
    out = folder / key
    out.mkdir(parents=True)
    steps = {name: np.asarray(value) for name, value in vars(recording.steps).items()}
    np.savez(out / "steps.npz", **steps)
    for camera, images in recording.rgb.items():
        np.save(out / f"rgb-{camera}.npy", images)
    for camera, images in recording.depth.items():
        np.save(out / f"depth-{camera}.npy", images)
    (out / "episode.json").write_text(made_info(key, **changed).model_dump_json())
    return out


def _images(T: int, size: tuple[int, int], rng: np.random.Generator) -> Any:
    width, height = size
    ground = rng.integers(60, 110, 3)
    images = np.empty((T, height, width, 3), np.uint8)
    images[:] = ground
    u, v = rng.integers(0, min(size) // 2, 2)
    for t, image in enumerate(images):  # so far apart and so bright that no codec takes two rows for one
        u_t = (u + 3 * t) % (width - 12)
        image[v : v + 12, u_t : u_t + 12] = ground + 120
    return images
