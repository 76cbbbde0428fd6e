"""What a person adds to OpenVLA or CogACT so that their loader knows a dataset; it is written beside the dataset.

Both look a dataset up by its name in three tables of `prismatic/vla/datasets/rlds/oxe`: configs.py says which features
are pictures and states, transforms.py brings them into the form that all datasets have, mixtures.py names
what is trained on together.
"""

from __future__ import annotations

from collections.abc import Mapping

_GUIDE = """\
# {name}

An RLDS dataset that maniagent exported; `docs/rlds.md` of maniagent says what is in it. {rate:g} steps a second.
Its folder lies in a *data root*, next to others if there are any:

```python
import tensorflow_datasets as tfds

episodes = tfds.builder_from_directory("DATA_ROOT/{name}/1.0.0").as_dataset(split="train")
```

## OpenVLA and CogACT

Both read a dataset that is registered in three files of `prismatic/vla/datasets/rlds/oxe`.

`configs.py`, at its end:

```python
{configs}
```

`transforms.py`, at its end:

```python
{transforms}
```

`mixtures.py`, at its end. A name that isn't there stands for the dataset alone, so this can wait until there are
others to train on as well, each with its weight:

```python
{mixtures}
```

Then, besides the options that your machine needs:

```sh
# OpenVLA
torchrun --standalone --nnodes 1 --nproc-per-node 1 vla-scripts/finetune.py \\
  --vla_path openvla/openvla-7b --data_root_dir DATA_ROOT --dataset_name {name}
# CogACT
torchrun --standalone --nnodes 1 --nproc-per-node 8 scripts/train.py \\
  --pretrained_checkpoint CogACT-Base.pt --vla.type prism-dinosiglip-224px+oxe+diffusion \\
  --data_root_dir DATA_ROOT --vla.data_mix {name}
```

A policy trained on it is asked with `unnorm_key="{name}"`. CogACT has an entry `custom_finetuning`
already: a dataset that is exported under that name needs no registration there.
"""

_CONFIGS = """\
OXE_DATASET_CONFIGS["{name}"] = {{
    "image_obs_keys": {{"primary": "image", "secondary": {secondary}, "wrist": {wrist}}},
    "depth_obs_keys": {{"primary": None, "secondary": None, "wrist": None}},
    "state_obs_keys": ["EEF_state", None, "gripper_state"],
    "state_encoding": StateEncoding.POS_EULER,
    "action_encoding": ActionEncoding.EEF_POS,
}}"""

_TRANSFORMS = """\
def {name}_dataset_transform(trajectory):
    # Actions are as they should be: deltas along the base's axes, and a gripper that is 1 (open) or 0 (closed).
    state = trajectory["observation"]["state"]
    trajectory["observation"]["EEF_state"] = state[:, :6]
    trajectory["observation"]["gripper_state"] = state[:, 6:]
    return trajectory


OXE_STANDARDIZATION_TRANSFORMS["{name}"] = {name}_dataset_transform"""

_MIXTURES = """\
OXE_NAMED_MIXTURES["{name}"] = [("{name}", 1.0)]"""


def guide(name: str, cameras: Mapping[str, str], rate: float) -> str:
    """The README of a dataset: how to load it, and what to add to OpenVLA and CogACT. Markdown.

    `cameras` by the names that their pictures have in the dataset, `rate` in steps a second.
    """
    parts = {"configs": configs(name, cameras), "transforms": transforms(name), "mixtures": mixtures(name)}
    return _GUIDE.format(name=name, rate=rate, **parts)


def configs(name: str, cameras: Mapping[str, str]) -> str:
    """What to add to configs.py: the first camera that is neither `image` nor at the wrist is the second view."""
    others = [camera for camera in cameras if camera not in ("image", "wrist_image")]
    secondary, wrist = next(iter(others), None), "wrist_image" if "wrist_image" in cameras else None
    return _CONFIGS.format(name=name, secondary=_quoted(secondary), wrist=_quoted(wrist))


def transforms(name: str) -> str:
    """What to add to transforms.py."""
    return _TRANSFORMS.format(name=name)


def mixtures(name: str) -> str:
    """What to add to mixtures.py."""
    return _MIXTURES.format(name=name)


def _quoted(text: str | None) -> str:
    return "None" if text is None else f'"{text}"'
