"""The four roles of the loop (ManiAgent, section III), each one method, each replaceable on its own.

What a role is handed is all it may know: an instruction, an Observation, what the other roles said, and memory.
Every role raises a StageFailure where it can't do its work; the loop records it and goes on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from ..types import ActionSequence, Detection, ObjectInfo, Observation, SceneDescription, Subtask, SubtaskRecord
from .memory import Memory


class SceneAgent(Protocol):
    """S = VLM(I, T): what of the scene matters for the instruction (section III-A)."""

    def describe(self, instruction: str, observation: Observation) -> SceneDescription:
        """Describe what is in view."""
        ...


class ReasoningAgent(Protocol):
    """Judges the previous sub-task and names the next one only (section III-B)."""

    def next_subtask(self, instruction: str, scene: SceneDescription, memory: Memory) -> Subtask:
        """The next sub-task, or that all is done, or that it can't be done."""
        ...


@dataclass(frozen=True)
class Located:
    """What an ObjectAgent found: one ObjectInfo per query, in the order of the queries."""

    objects: tuple[ObjectInfo, ...]
    detections: tuple[Detection, ...]
    """Where each is seen in the main view."""
    surroundings: tuple[ObjectInfo, ...] = ()
    """Everything else on the table, for the motion to keep clear of."""


class ObjectAgent(Protocol):
    """Finds the queried objects in 3-D, with grasps (section III-C)."""

    def locate(self, subtask: Subtask, observation: Observation, memory: Memory) -> Located:
        """Locate every query of the sub-task, or raise DetectionFailure or GraspFailure."""
        ...


class ControllerAgent(Protocol):
    """Writes the action sequence for one sub-task (section III-D)."""

    def write(self, subtask: Subtask, objects: Sequence[ObjectInfo], feedback: str = "") -> ActionSequence:
        """A parameterised sequence over the objects' indices; `feedback` says why the last one was refused."""
        ...

    def learn(self, record: SubtaskRecord) -> None:
        """Take note of how an attempt was judged; told once for every attempt that is, on the turn after it."""
        ...


@dataclass(frozen=True)
class Agents:
    """One set of the four roles, with a name for the log."""

    name: str
    scene: SceneAgent
    reasoning: ReasoningAgent
    objects: ObjectAgent
    controller: ControllerAgent
