"""Does a policy learn from a dataset? Trains a small ACT with lerobot itself and prints the loss.

For an interpreter that has lerobot; nothing of maniagent is needed:

    LEROBOT/bin/python benchmarks/learning/training.py demos/dataset --steps 200

Images are shrunk, and the network is a fraction of lerobot's default, so that 200 steps take minutes on two cores. The
loss is ACT's: the L1 distance between predicted and recorded actions (each dimension in standard deviations), and ten
times the divergence of its latent variable. The last line is JSON: both, as means of the first and last twenty steps.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import torch
from lerobot.configs.types import FeatureType
from lerobot.datasets.lerobot_dataset import LeRobotDataset
from lerobot.datasets.utils import dataset_to_policy_features
from lerobot.policies.act.configuration_act import ACTConfig
from lerobot.policies.act.modeling_act import ACTPolicy
from lerobot.policies.act.processor_act import make_act_pre_post_processors
from torchvision.transforms.v2 import Resize

CHUNK = 20
"""Actions that are predicted at once."""
USED = ("observation.state", "observation.images.", "action")
"""What the policy is given, by the beginnings of its names."""


def load(root: Path, side: int) -> LeRobotDataset:
    """The dataset, each item with the CHUNK actions from its row on; images are shrunk to `side` x `side`."""
    fps = json.loads((root / "meta" / "info.json").read_text())["fps"]
    chunk = {"action": [step / fps for step in range(CHUNK)]}
    return LeRobotDataset(
        "maniagent/dataset",
        root=root,
        delta_timestamps=chunk,
        image_transforms=Resize((side, side)),
        video_backend="pyav",
    )


def make_policy(data: LeRobotDataset, side: int) -> tuple[ACTPolicy, Any]:
    """An ACT of twelve million parameters, nearly all of them ResNet-18's, untrained, and what prepares its batches."""
    features = {n: f for n, f in dataset_to_policy_features(data.meta.features).items() if n.startswith(USED)}
    for feature in features.values():
        if feature.type is FeatureType.VISUAL:
            feature.shape = (3, side, side)
    config = ACTConfig(
        input_features={n: f for n, f in features.items() if f.type is not FeatureType.ACTION},
        output_features={n: f for n, f in features.items() if f.type is FeatureType.ACTION},
        chunk_size=CHUNK, n_action_steps=CHUNK, dim_model=128, n_heads=4, dim_feedforward=512, n_encoder_layers=2,
        n_vae_encoder_layers=2, pretrained_backbone_weights=None, device="cpu",
    )  # fmt: skip
    prepare, _ = make_act_pre_post_processors(config, dataset_stats=data.meta.stats)
    return ACTPolicy(config), prepare


def batches(data: LeRobotDataset, size: int, seed: int) -> Iterator[dict[str, Any]]:
    """Shuffled batches without end."""
    draw = torch.Generator().manual_seed(seed)
    while True:
        yield from torch.utils.data.DataLoader(data, size, shuffle=True, drop_last=True, generator=draw)


def train(root: Path, steps: int, batch: int, side: int, seed: int) -> list[tuple[float, float]]:
    """The loss at each step, and its L1 part."""
    torch.manual_seed(seed)
    data = load(root, side)
    policy, prepare = make_policy(data, side)
    policy.train()
    optimizer = torch.optim.AdamW(policy.parameters(), lr=3e-4)
    weights = sum(parameter.numel() for parameter in policy.parameters())
    print(f"{data.num_episodes} episodes, {data.num_frames} frames, {weights:,} weights")
    losses, began = [], time.perf_counter()
    for step, drawn in zip(range(1, steps + 1), batches(data, min(batch, data.num_frames), seed), strict=False):
        loss, parts = policy.forward(prepare(drawn))
        optimizer.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(policy.parameters(), 10.0)
        optimizer.step()
        losses.append((loss.item(), parts["l1_loss"]))
        if step == 1 or step % 10 == 0:
            seconds = (time.perf_counter() - began) / step
            print(f"step {step:4d}: loss {losses[-1][0]:.3f}, L1 {losses[-1][1]:.3f}, {seconds:.2f} s", flush=True)
    return losses


def main() -> None:
    """Parse, train, tell."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dataset", type=Path)
    parser.add_argument("--steps", type=int, default=200)
    parser.add_argument("--batch", type=int, default=8)
    parser.add_argument("--side", type=int, default=96, help="pixels of the images' sides")
    parser.add_argument("--seed", type=int, default=0)
    chosen = parser.parse_args()
    losses = np.array(train(chosen.dataset, chosen.steps, chosen.batch, chosen.side, chosen.seed))
    first, last = losses[:20].mean(axis=0), losses[-20:].mean(axis=0)
    told: dict[str, Any] = {"steps": len(losses)}
    for number, name in enumerate(("loss", "l1")):
        told[name] = {"first": first[number], "last": last[number], "ratio": last[number] / first[number]}
    print(json.dumps(told))


if __name__ == "__main__":
    main()
