"""Key points to timed, collision-free moves."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ..errors import MotionRejected
from ..geometry import FloatArray
from ..types import Gripper, KeyPoint, OrientedBox
from .hand import Hand
from .ik import half_turned
from .kinematics import ArmModel
from .limits import MotionLimits
from .moves import MoveFinder, MoveRules
from .plan import MotionPlan, PlannedMove

_LIFT_BEFORE_HOME = 0.22
"""m, TCP height that a way home first rises to."""


class MotionPlanner:
    """Plans moves of one arm. Holds scratch memory: one instance serves one thread.

    A move is tried as a straight line of the TCP first. Vertical moves (the ways down to an object and up from it)
    are that or nothing. Where other straight lines fail, a straight line in joint space is tried, then sampling,
    both without touching anything. What a move may touch, the move after it may touch on its way out.
    """

    def __init__(self, model: ArmModel, limits: MotionLimits) -> None:
        self.model = model
        self.limits = limits
        self._finder = MoveFinder(model, limits)

    def plan(
        self,
        keypoints: Sequence[KeyPoint],
        start: FloatArray,
        opening: float,
        boxes: Mapping[int, OrientedBox],
        *,
        jaw_symmetry: bool = True,
    ) -> MotionPlan:
        """Moves through all key points, from the posture `start` ((6,) rad) with the fingers `opening` (m) apart.

        `boxes` are the objects by index. With `jaw_symmetry` an empty hand takes whichever of the two equal
        orientations (fingers swapped or not) is nearer, and keeps it while it carries something, which would turn
        too. Raises MotionRejected, naming the key point and the reason.
        """
        begin = time.perf_counter()
        ways = [False]
        if jaw_symmetry and keypoints and keypoints[0].held is None:
            first = self._nearer(keypoints[0], start, False)
            ways = [first, not first]
        rejections: list[MotionRejected] = []
        for swapped in ways:
            try:
                moves = self._moves(keypoints, start, Hand(self.model, opening, boxes), swapped, jaw_symmetry)
            except MotionRejected as rejection:
                rejections.append(rejection)
            else:
                return MotionPlan(moves, time.perf_counter() - begin)
        raise rejections[0]

    def plan_home(self, start: FloatArray, opening: float, boxes: Mapping[int, OrientedBox]) -> MotionPlan:
        """The way to the home posture: straight up first, out of whatever the fingers are in, then across.

        Raises MotionRejected where the arm can't get out.
        """
        begin = time.perf_counter()
        self._finder.look(Hand(self.model, opening, boxes))
        rules = self._finder.starting_rules(start, opening)
        moves, at = [], start
        T_base_up = self.model.forward(start)
        if T_base_up[2, 3] < _LIFT_BEFORE_HOME:
            T_base_up[2, 3] = _LIFT_BEFORE_HOME
            try:
                rise = self._finder.line(start, T_base_up, rules)
            except MotionRejected:
                pass  # no way straight up: the way across has to do from here
            else:
                moves.append(PlannedMove("rise", rise))
                at = rise.goal
        moves.append(PlannedMove("go home", self._finder.free(at, [self.model.home], rules)))
        return MotionPlan(tuple(moves), time.perf_counter() - begin)

    def _moves(
        self, keypoints: Sequence[KeyPoint], start: FloatArray, hand: Hand, swapped: bool, jaw_symmetry: bool
    ) -> tuple[PlannedMove, ...]:
        """All moves, the fingers `swapped` or not at the first key point; raises MotionRejected."""
        moves, at = [], start
        for number, point in enumerate(keypoints, start=1):
            next_held = keypoints[number].held if number < len(keypoints) else None
            if jaw_symmetry and number > 1 and hand.held is None and point.held is None:
                swapped = self._nearer(point, at, swapped)
            T_base_goal = _target(point, swapped)
            try:
                if outside := self.limits.outside(T_base_goal[:3, 3]):
                    raise MotionRejected(f"{outside}.")
                if point.held is not None and hand.held_index != point.held:
                    hand.take(point.held, self.model.forward(at))
                self._finder.look(hand)
                before = keypoints[number - 2] if number > 1 else None
                trajectory = self._finder.move(at, T_base_goal, self._rules(point, before, hand, at))
            except MotionRejected as rejection:
                raise MotionRejected(f"Key point {number} ({point.description!r}): {rejection}") from rejection
            at = trajectory.goal
            grasps = next_held if point.gripper is Gripper.CLOSE else None
            moves.append(
                PlannedMove(point.description, trajectory, point.gripper, point.opening, point.held, grasps, number)
            )
            hand.act(point, self.model.forward(at), next_held)
        return tuple(moves)

    def _rules(self, point: KeyPoint, before: KeyPoint | None, hand: Hand, start: FloatArray) -> MoveRules:
        if before is None:
            found = self._finder.starting_rules(start, hand.opening)
            return replace(found, touches=point.touches)
        touches = point.touches | before.touches
        return MoveRules(hand.opening, touches if hand.just_released is None else touches | {hand.just_released})

    def _nearer(self, point: KeyPoint, start: FloatArray, swapped: bool) -> bool:
        """Whether to swap the fingers at a key point: as it is now, unless the other way turns the joints less."""
        travel = {way: self._travel(_target(point, way), start) for way in (swapped, not swapped)}
        return swapped if travel[swapped] <= travel[not swapped] else not swapped

    def _travel(self, T_base_goal: FloatArray, start: FloatArray) -> float:
        """How far the joints have to turn to a pose, rad; infinite where it is unreachable."""
        found = self._finder.solver.solutions(T_base_goal, start)
        return float(np.abs(found[0] - start).max()) if found else np.inf


def _target(point: KeyPoint, swapped: bool) -> FloatArray:
    return half_turned(point.T_base_tcp) if swapped else point.T_base_tcp
