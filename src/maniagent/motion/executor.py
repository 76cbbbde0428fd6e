"""Carries out approved plans on an arm, and notices when the world doesn't play along."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from ..errors import GraspFailure, StageFailure
from ..geometry import FloatArray
from ..types import ExecutionReport, Gripper
from .arm import Arm, ArmState
from .gate import ApprovedPlan
from .kinematics import ArmModel
from .plan import PlannedMove
from .watch import TrackingWatch, WatchSettings

OnTick = Callable[[ArmState], None]
OnMove = Callable[[str, float], None]


@dataclass(frozen=True)
class ExecutionSettings:
    """How patient the executor is, and what counts as arrived, opened and held."""

    watch: WatchSettings = field(default_factory=WatchSettings)
    start_tolerance: float = 0.05
    """rad between where a plan starts and where the arm is."""
    arrival_tolerance: float = 0.008
    """m between the TCP and a move's goal, after settling."""
    settle_time: float = 0.6
    """s to come to rest in after a move."""
    gripper_speed: float = 0.1
    """m/s, change of the opening."""
    gripper_rest: float = 0.12
    """s without a change of the opening after which the fingers are at rest."""
    gripper_timeout: float = 1.5
    """s for the fingers to come to rest."""
    held_clearance: float = 0.0008
    """m by which the opening exceeds the closed gap when something is held."""
    held_effort: float = 0.5
    """N with which the fingers press at least when something is held."""


class Executor:
    """Follows approved plans. The arm is at rest whenever `run` returns or raises."""

    def __init__(
        self,
        arm: Arm,
        model: ArmModel,
        settings: ExecutionSettings | None = None,
        on_tick: OnTick | None = None,
        on_move: OnMove | None = None,
    ) -> None:
        """`on_tick` sees every state; `on_move` hears of every move as it begins and its planned duration (s)."""
        self._arm = arm
        self._model = model
        self._settings = settings or ExecutionSettings()
        self._on_tick = on_tick
        self._on_move = on_move

    def run(self, approved: ApprovedPlan) -> ExecutionReport:
        """Carry out all moves, or stop at the first that fails and say why.

        Raises only what comes from outside (KeyboardInterrupt, a broken driver, a hook), after stopping the arm.
        """
        reached = 0
        try:
            run = _Run(self._arm, self._model, self._settings, self._on_tick)
            for move in approved.plan.moves:
                if self._on_move is not None:
                    self._on_move(move.description, move.trajectory.duration)
                run.carry_out(move)
                reached = move.reached
        except StageFailure as failure:
            self._arm.stop()
            return ExecutionReport(completed=False, reached=reached, reason=str(failure), stage=failure.stage)
        except BaseException:
            self._arm.stop()
            raise
        return ExecutionReport(completed=True, reached=reached)


class _Run:
    """One run: where the set-points are, what the fingers are told, what is held."""

    def __init__(self, arm: Arm, model: ArmModel, settings: ExecutionSettings, on_tick: OnTick | None) -> None:
        self._arm = arm
        self._model = model
        self._settings = settings
        self._on_tick = on_tick
        self._state = arm.read()
        if not self._state.is_finite():
            raise StageFailure("The arm was not moved: a servo reads no valid position.")
        self._watch = TrackingWatch(model, settings.watch, self._state.joint_positions, arm.period)
        pressing = self._state.gripper_effort > settings.held_effort
        self._opening_command = model.min_opening if pressing else self._state.gripper_opening
        self._empty_for = 0.0

    def carry_out(self, move: PlannedMove) -> None:
        """Follow a move to its end, come to rest, and do its gripper action. Raises StageFailure."""
        trajectory = move.trajectory
        if np.abs(self._state.joint_positions - trajectory.start).max() > self._settings.start_tolerance:
            raise StageFailure(f"The arm is not where {move.description!r} starts; it was moved from outside.")
        if move.held is not None:
            self._opening_command = self._model.min_opening
        ticks = int(np.ceil(trajectory.duration / self._arm.period))
        for tick in range(1, ticks + 1):
            self._tick(trajectory.sample(tick * self._arm.period), move)
            self._check_held(move)
        self._settle(move)
        if move.gripper is Gripper.OPEN:
            self._open(move)
        elif move.gripper is Gripper.CLOSE:
            self._close(move)

    def _tick(self, set_point: FloatArray, move: PlannedMove) -> None:
        """One control period: command, read, look."""
        self._arm.command(set_point, self._opening_command)
        self._state = self._arm.read()
        if self._on_tick is not None:
            self._on_tick(self._state)
        if trouble := self._watch.update(set_point, self._state):
            raise StageFailure(f"The arm stopped during {move.description!r}: {trouble}.")

    def _settle(self, move: PlannedMove) -> None:
        """Hold the goal until the arm rests there. Raises StageFailure where it rests elsewhere."""
        goal = move.trajectory.goal
        T_base_goal = self._model.forward(goal)
        for _ in range(max(1, round(self._settings.settle_time / self._arm.period))):
            self._tick(goal, move)
            self._check_held(move)
            miss = np.linalg.norm(self._model.forward(self._state.joint_positions)[:3, 3] - T_base_goal[:3, 3])
            if miss < 0.001 and np.abs(self._state.joint_velocities).max() < 0.02:
                return
        if miss > self._settings.arrival_tolerance:
            raise StageFailure(f"The arm came to rest {1000 * miss:.0f} mm away from {move.description!r}.")

    def _open(self, move: PlannedMove) -> None:
        opening = self._model.max_opening if move.opening is None else max(move.opening, self._model.min_opening)
        self._move_fingers(opening, move)
        if self._state.gripper_opening < opening - 0.015:
            raise StageFailure(
                f"The fingers opened only {1000 * self._state.gripper_opening:.0f} mm after {move.description!r}."
            )

    def _close(self, move: PlannedMove) -> None:
        """Close with full force; where something has to be held after that, make sure of it."""
        self._move_fingers(self._model.min_opening, move)
        if move.grasps is not None and not self._holds():
            raise GraspFailure(f"The fingers closed on nothing after {move.description!r}.")

    def _move_fingers(self, opening: float, move: PlannedMove) -> None:
        """Ramp the commanded opening, then wait until the fingers rest."""
        period, goal = self._arm.period, move.trajectory.goal
        start = self._state.gripper_opening
        ramp = int(np.ceil(abs(opening - start) / (self._settings.gripper_speed * period)))
        for command in np.linspace(start, opening, ramp + 1)[1:]:
            self._opening_command = float(command)
            self._tick(goal, move)
        self._opening_command = opening
        last, rested, waited = self._state.gripper_opening, 0.0, 0.0
        while rested < self._settings.gripper_rest and waited < self._settings.gripper_timeout:
            self._tick(goal, move)
            still = abs(self._state.gripper_opening - last) < 1e-4
            last, rested, waited = self._state.gripper_opening, rested + period if still else 0.0, waited + period

    def _holds(self) -> bool:
        """Whether something keeps the pressing fingers apart. Grippers without effort sensing read NaN there."""
        apart = self._state.gripper_opening > self._model.min_opening + self._settings.held_clearance
        effort = self._state.gripper_effort
        return bool(apart and (np.isnan(effort) or effort > self._settings.held_effort))

    def _check_held(self, move: PlannedMove) -> None:
        """Raises GraspFailure once the object that the move carries has been gone for a moment."""
        if move.held is None or self._holds():
            self._empty_for = 0.0
            return
        self._empty_for += self._arm.period
        if self._empty_for >= self._settings.watch.patience:
            raise GraspFailure(f"The object slipped out of the gripper during {move.description!r}.")
