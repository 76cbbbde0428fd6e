"""Motion: kinematics, planning, the gate, and execution of Cartesian key points on an arm."""

from .arm import Arm, ArmState
from .executor import ExecutionSettings, Executor
from .gate import ApprovedPlan, MotionGate
from .ik import IKSolver
from .kinematics import ArmModel
from .limits import MotionLimits
from .planner import MotionPlanner
from .stack import MotionStack

__all__ = [
    "ApprovedPlan",
    "Arm",
    "ArmModel",
    "ArmState",
    "ExecutionSettings",
    "Executor",
    "IKSolver",
    "MotionGate",
    "MotionLimits",
    "MotionPlanner",
    "MotionStack",
]
