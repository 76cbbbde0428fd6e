"""The ControllerAgent: an action sequence over object indices, in text only (ManiAgent, section III-D)."""

from __future__ import annotations

from collections.abc import Sequence

from ...errors import FormatFailure, GraspFailure
from ...models.question import ChatModel, Question, Unfit
from ...perception.viewpoint import Viewpoint
from ...types import ActionSequence, ObjectInfo, Subtask, SubtaskRecord
from ..binding import bind
from .answers import Written
from .eyes import Eyes
from .prompts import Prompt
from .steps import to_sequence
from .telling import fenced, one_line, tell_frame, tell_objects

TAKING = ("pick-and-place", "drag", "rotate")
"""Skills that hold the object; one of a model's own may push it."""


class MindControllerAgent:
    """Asks a language model, and takes nothing that doesn't bind to the objects at hand."""

    def __init__(self, eyes: Eyes, llm: ChatModel, prompt: Prompt) -> None:
        self._eyes = eyes
        self._llm = llm
        self._prompt = prompt
        self._latest: tuple[Subtask, Written] | None = None

    def write(self, subtask: Subtask, objects: Sequence[ObjectInfo], feedback: str = "") -> ActionSequence:
        """The sequence; with `feedback`, one that does better. Raises ModelFailure and FormatFailure."""
        viewpoint = self._eyes.viewpoint
        instructions, question = self._prompt.filled(
            subtask=fenced(subtask.text, 500),
            objects=tell_objects(objects),
            frame=tell_frame(viewpoint),
            feedback=self._tell(subtask, feedback) if feedback else "",
        )

        def check(written: Written) -> None:
            _check(written, objects, viewpoint)

        written = self._llm.ask(Question("controller", instructions, (question,), Written, check))
        self._latest = (subtask, written)
        return to_sequence(written)

    def learn(self, record: SubtaskRecord) -> None:
        """Nothing: what a model wrote once, it doesn't remember; the action cache does."""

    def _tell(self, subtask: Subtask, feedback: str) -> str:
        """The last answer, where it was for this sub-task, and why it was refused."""
        said = ""
        if self._latest is not None and self._latest[0] == subtask:
            answer = self._latest[1].model_dump_json(exclude_defaults=True)
            said = f"You answered: {fenced(answer)}\n"
        return f"{said}This was refused before the robot moved: {one_line(feedback, 500)}\nWrite one that avoids it."


def _check(written: Written, objects: Sequence[ObjectInfo], viewpoint: Viewpoint) -> None:
    """Raise Unfit unless the sequence binds, and puts down what it brings to another object."""
    for number, step in enumerate(written.steps, 1):
        if step.to == "grasp" and step.object in range(1, len(objects)):
            raise Unfit(
                f"Step {number} ({step.do}) goes to the grasp of object {step.object}; only object 0 can be grasped. "
                'To put something onto another object, use "to":"surface".'
            )
    if written.skill in TAKING and not any(step.to == "grasp" and step.gripper == "close" for step in written.steps):
        raise Unfit(f'No step takes object 0: {written.skill} needs one with "to":"grasp" and "gripper":"close".')
    sequence = to_sequence(written)
    try:
        keypoints = bind(sequence, objects, viewpoint)
    except (FormatFailure, GraspFailure) as failure:
        raise Unfit(str(failure)) from failure
    last = keypoints[-1]
    if len(objects) > 1 and last.held is not None and last.gripper != "open":
        raise Unfit(f"Object {last.held} is still in the gripper at the end: open the fingers where it belongs.")
