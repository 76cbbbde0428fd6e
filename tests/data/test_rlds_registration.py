"""What OpenVLA and CogACT are told of a dataset: the code runs, and fits what is in it."""

from __future__ import annotations

import re
from types import SimpleNamespace
from typing import Any

import numpy as np

from maniagent.data.rlds.registration import configs, guide, mixtures, transforms

CAMERAS = {"image": "observation.images.main", "image_side": "observation.images.side"}


def run(code: str, **names: Any) -> dict[str, Any]:
    space = dict(names)
    exec(code, space)  # noqa: S102 - our own text
    return space


def test_a_configuration_names_pictures_and_states() -> None:
    encodings = SimpleNamespace(POS_EULER=1, EEF_POS=1)
    code = configs("carrots", {**CAMERAS, "wrist_image": "observation.images.wrist"})
    table = run(code, OXE_DATASET_CONFIGS={}, StateEncoding=encodings, ActionEncoding=encodings)["OXE_DATASET_CONFIGS"]
    keys = {"primary": "image", "secondary": "image_side", "wrist": "wrist_image"}
    assert table["carrots"]["image_obs_keys"] == keys
    assert table["carrots"]["state_obs_keys"] == ["EEF_state", None, "gripper_state"]


def test_cameras_that_are_not_there_are_none() -> None:
    assert '"secondary": None, "wrist": None}' in configs("carrots", {"image": "observation.images.main"})


def test_the_transform_cuts_the_state_in_pose_and_gripper_and_leaves_the_action() -> None:
    table = run(transforms("carrots"), OXE_STANDARDIZATION_TRANSFORMS={})["OXE_STANDARDIZATION_TRANSFORMS"]
    state, action = np.arange(21.0).reshape(3, 7), np.ones((3, 7))
    out = table["carrots"]({"observation": {"state": state}, "action": action})
    np.testing.assert_array_equal(out["observation"]["EEF_state"], state[:, :6])
    np.testing.assert_array_equal(out["observation"]["gripper_state"], state[:, 6:])
    assert out["action"] is action


def test_a_mixture_is_the_dataset_alone() -> None:
    assert run(mixtures("carrots"), OXE_NAMED_MIXTURES={})["OXE_NAMED_MIXTURES"] == {"carrots": [("carrots", 1.0)]}


def test_the_guide_is_about_this_dataset_and_its_code_is_python() -> None:
    text = guide("carrots_5hz", CAMERAS, 5.0)
    blocks = re.findall(r"```python\n(.*?)```", text, re.S)
    assert len(blocks) == 4
    for block in blocks:
        compile(block, "README.md", "exec")
        assert "carrots_5hz" in block
    assert "5 steps a second" in text
    assert "--dataset_name carrots_5hz" in text
