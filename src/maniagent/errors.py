"""The errors maniagent raises: one base class, one vocabulary.

Every public error says what was wrong, what would have been right, and what to do next. `UsageError` and
`SetupError` are the caller's to fix (exit status 2); `StageFailure` is what the loop expects of a hard world:
it is recorded, goes into memory, and is retried within the budget.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from enum import StrEnum


class ManiAgentError(Exception):
    """Base of everything maniagent raises on purpose."""


class UsageError(ManiAgentError):
    """The caller asked for something that does not exist or does not make sense."""


class SetupError(ManiAgentError):
    """Something the machine needs is missing; the message holds the line that fixes it."""


class UnknownNameError(UsageError):
    """A name that is not registered; suggests the nearest one that is."""

    def __init__(self, kind: str, name: str, known: Iterable[str]) -> None:
        self.kind, self.name, self.known = kind, name, sorted(known)
        near = difflib.get_close_matches(name, self.known, n=1)
        hint = f" Did you mean {near[0]!r}?" if near else ""
        super().__init__(f"Unknown {kind} {name!r}.{hint} Known: {', '.join(self.known) or 'none'}.")


class FailureStage(StrEnum):
    """Where in the loop something failed; kept in the log and counted in the report."""

    CAMERA = "camera"
    SCENE = "scene"
    REASONING = "reasoning"
    DETECTION = "detection"
    GRASP = "grasp"
    PLANNING = "planning"
    CONTROL = "control"
    FORMAT = "format"
    MODEL = "model"


class StageFailure(ManiAgentError):
    """A stage of the loop could not do its work on this turn; the loop records it and goes on."""

    stage: FailureStage = FailureStage.CONTROL


class CameraFailure(StageFailure):
    """A camera gives no usable image (missing, blocked, no valid depth)."""

    stage = FailureStage.CAMERA


class SceneFailure(StageFailure):
    """The scene could not be described."""

    stage = FailureStage.SCENE


class ReasoningFailure(StageFailure):
    """No next sub-task could be derived."""

    stage = FailureStage.REASONING


class DetectionFailure(StageFailure):
    """An object that was asked for is not found, or several are equally good."""

    stage = FailureStage.DETECTION


class GraspFailure(StageFailure):
    """No grasp was found for an object, or the object was not held after closing."""

    stage = FailureStage.GRASP


class MotionRejected(StageFailure):
    """A motion was refused before it began: out of the workspace, unreachable, in collision or too fast."""

    stage = FailureStage.PLANNING


class ModelFailure(StageFailure):
    """A chat model can't be reached, refuses, or its budget is used up; asking again at once is of no use."""

    stage = FailureStage.MODEL


class FormatFailure(StageFailure):
    """An answer does not fit its schema or does not bind to the objects at hand."""

    stage = FailureStage.FORMAT
