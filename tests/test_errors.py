"""What errors say."""

from __future__ import annotations

import pytest

from maniagent.errors import (
    CameraFailure,
    DetectionFailure,
    FailureStage,
    FormatFailure,
    GraspFailure,
    ManiAgentError,
    MotionRejected,
    ReasoningFailure,
    SceneFailure,
    SetupError,
    StageFailure,
    UnknownNameError,
    UsageError,
)


def test_an_unknown_name_suggests_the_nearest_one() -> None:
    error = UnknownNameError("task", "pepper-on-plat", ["pepper-on-plate", "drag-plate"])
    assert str(error) == (
        "Unknown task 'pepper-on-plat'. Did you mean 'pepper-on-plate'? Known: drag-plate, pepper-on-plate."
    )
    assert (error.kind, error.name, error.known) == ("task", "pepper-on-plat", ["drag-plate", "pepper-on-plate"])


def test_nothing_is_suggested_where_nothing_is_near() -> None:
    assert str(UnknownNameError("robot", "zzz", ["simulated"])) == "Unknown robot 'zzz'. Known: simulated."
    assert str(UnknownNameError("robot", "zzz", [])) == "Unknown robot 'zzz'. Known: none."


@pytest.mark.parametrize("error", [UsageError, SetupError, StageFailure])
def test_all_that_is_raised_on_purpose_has_one_base(error: type[Exception]) -> None:
    assert issubclass(error, ManiAgentError)


def test_what_the_caller_must_fix_is_no_failure_of_a_stage() -> None:
    assert issubclass(UnknownNameError, UsageError)
    assert not issubclass(UsageError, StageFailure)
    assert not issubclass(SetupError, StageFailure)


@pytest.mark.parametrize(
    ("failure", "stage"),
    [
        (StageFailure, FailureStage.CONTROL),
        (CameraFailure, FailureStage.CAMERA),
        (SceneFailure, FailureStage.SCENE),
        (ReasoningFailure, FailureStage.REASONING),
        (DetectionFailure, FailureStage.DETECTION),
        (GraspFailure, FailureStage.GRASP),
        (MotionRejected, FailureStage.PLANNING),
        (FormatFailure, FailureStage.FORMAT),
    ],
)
def test_every_failure_knows_its_stage(failure: type[StageFailure], stage: FailureStage) -> None:
    assert failure("why").stage is stage
