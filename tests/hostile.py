"""A mind on a real server that is sane but for one kind of answer; a twin that keeps what its arm was told.

The server speaks the OpenAI protocol. The twin has one small, clear camera, so that a whole run takes a second or two.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from maniagent.envs.cameras import MAIN_CAMERA
from maniagent.envs.scene import Scene
from maniagent.envs.tabletop import TabletopEnv, TrueObject
from maniagent.geometry import FloatArray
from models.fake_server import Asked, Raw, Script, says

Json = dict[str, Any]

SEEN: Json = {
    "objects": [{"name": "red pepper", "state": "on the table"}, {"name": "plate", "state": "empty"}],
    "summary": "The pepper is not on the plate.",
}
ACT: Json = {
    "evidence": "",
    "previous": "none",
    "remaining": "The pepper has to get there.",
    "next": "act",
    "subtask": "put the red pepper on the plate",
    "objects": ["red pepper", "plate"],
}
DONE: Json = {"evidence": "It lies there.", "previous": "success", "remaining": "", "next": "done"}
CANNOT: Json = {"evidence": "", "previous": "failure", "remaining": "I give up.", "next": "cannot"}
FOUND: Json = {"found": [{"query": 1, "looks": "red", "numbers": [2]}, {"query": 2, "looks": "round", "numbers": [1]}]}
PUT: Json = {
    "skill": "pick-and-place",
    "steps": [
        {"do": "above it", "to": "grasp", "object": 0, "up": 0.1, "gripper": "open"},
        {"do": "take it", "to": "grasp", "object": 0, "gripper": "close"},
        {"do": "lift", "to": "here", "up": 0.1},
        {"do": "over the plate", "to": "surface", "object": 1, "up": 0.1},
        {"do": "let go", "to": "surface", "object": 1, "up": 0.006, "gripper": "open"},
        {"do": "leave", "to": "here", "up": 0.1},
    ],
}


def form_of(asked: Asked) -> str:
    """The form of the answer that a request wants."""
    name: str = asked.body["response_format"]["json_schema"]["name"]
    return name


def sane(asked: Asked) -> Raw:
    """What a capable model would say: put the pepper on the plate; give up after a failure."""
    answers = {"Seen": SEEN, "Written": PUT, "NamedMarks": FOUND, "Thought": CANNOT}
    if "nothing was tried yet" in asked.text:
        answers["Thought"] = ACT
    elif "the arm made every movement" in asked.text:
        answers["Thought"] = DONE
    return says(json.dumps(answers[form_of(asked)]))(asked)


@dataclass
class Mind:
    """Sane, but when asked for an answer of these forms: then the scripts speak in turn, and the last one for ever."""

    scripts: Mapping[str, Sequence[Script]]
    """By form."""
    asked: list[Asked] = field(default_factory=list)

    def __call__(self, asked: Asked) -> Raw:
        self.asked.append(asked)
        scripts = self.scripts.get(form_of(asked), [sane])
        return scripts[min(len(self.asked_for(form_of(asked))), len(scripts)) - 1](asked)

    def asked_for(self, form: str) -> list[Asked]:
        """The requests that wanted such an answer."""
        return [asked for asked in self.asked if form_of(asked) == form]


SMALL = replace(MAIN_CAMERA, focal_length=MAIN_CAMERA.focal_length / 2, width=320, height=240)


class Twin(TabletopEnv):
    """The twin, looked at by one small, clear camera, that remembers what it was told and how it was left.

    It serves one run after another: `close` ends a run, `TabletopEnv.close` the twin.
    """

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene, noise=None, cameras=(SMALL,))
        self.commands: list[FloatArray] = []
        """(6,) rad, one a control period."""

    def reset(self, **options: Any) -> Any:
        self.commands.clear()
        return super().reset(**options)

    def advance(self, joint_positions: FloatArray, opening: float) -> None:
        self.commands.append(np.array(joint_positions))
        super().advance(joint_positions, opening)

    def close(self) -> None:
        self.arm = (self.robot_state().joint_positions, self.joint_velocities)
        self.left: Mapping[str, TrueObject] = self.truth()
