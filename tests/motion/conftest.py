from __future__ import annotations

import pytest

from maniagent.motion import ArmModel, IKSolver, MotionLimits, MotionPlanner


@pytest.fixture(scope="session")
def model() -> ArmModel:
    return ArmModel()


@pytest.fixture(scope="session")
def solver(model: ArmModel) -> IKSolver:
    return IKSolver(model)


@pytest.fixture(scope="session")
def planner(model: ArmModel) -> MotionPlanner:
    return MotionPlanner(model, MotionLimits())
