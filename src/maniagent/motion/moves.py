"""One move: from a posture to a pose, free of collisions and timed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..errors import MotionRejected
from ..geometry import FloatArray
from .collision import HAND, CollisionModel, Contact
from .hand import Hand
from .ik import IKSolver
from .kinematics import ArmModel
from .limits import MotionLimits
from .path import JointPath, joint_line, tcp_line
from .sampling import sampled_path
from .trajectory import JointTrajectory, chain, time_path

_CHECK_STEP = 0.03
"""rad between the postures of a path that are checked for collisions: about 1 cm at the fingertips."""
_VERTICAL = 0.005
"""m: a move that strays less than this sideways goes straight up or down, or not at all."""


@dataclass(frozen=True)
class MoveRules:
    """What holds during one move."""

    opening: float
    """m between the finger pads."""
    touches: frozenset[int] = frozenset()
    """Objects that the hand may come into contact with."""
    ignored: frozenset[Contact] = frozenset()
    """Contacts that exist before the first move: the arm has to be able to leave them."""
    confined: bool = True
    """Whether the TCP has to stay in the workspace; not so where it starts outside."""


class MoveFinder:
    """Finds single moves of one arm in a scene. Holds scratch memory: one instance serves one thread."""

    def __init__(self, model: ArmModel, limits: MotionLimits) -> None:
        self.model = model
        self.limits = limits
        self.solver = IKSolver(model, limits.joint_margin)
        self._collisions = CollisionModel(model)

    def look(self, hand: Hand) -> None:
        """Moves from here on are planned among these boxes and with this one in the gripper."""
        self._collisions.set_scene(hand.obstacles, hand.held)

    def starting_rules(self, start: FloatArray, opening: float) -> MoveRules:
        """Rules for a move out of the posture the arm is found in ((6,) rad), whatever it touches there."""
        present = frozenset(self._collisions.contacts(start, opening))
        return MoveRules(opening, ignored=present, confined=not self.limits.outside(self._collisions.tcp))

    def move(self, start: FloatArray, T_base_goal: FloatArray, rules: MoveRules) -> JointTrajectory:
        """From a posture ((6,) rad) to a TCP pose: a straight line, or else any free way that touches nothing.

        A vertical move is a straight line or nothing. Raises MotionRejected with the reason in one sentence.
        """
        try:
            return self.line(start, T_base_goal, rules)
        except MotionRejected:
            sideways = float(np.linalg.norm((T_base_goal - self.model.forward(start))[:2, 3]))
            if sideways < _VERTICAL:
                raise
        self.solver.solve(T_base_goal, start)  # raises, with the reason, where no posture reaches the goal
        return self.free(start, self.solver.solutions(T_base_goal, start), replace(rules, touches=frozenset()))

    def line(self, start: FloatArray, T_base_goal: FloatArray, rules: MoveRules) -> JointTrajectory:
        """The straight line of the TCP to a pose; raises MotionRejected where it isn't free."""
        path = tcp_line(self.solver, start, T_base_goal)
        self._require_free(path, rules)
        speed = self.limits.contact_speed if rules.touches else self.limits.tcp_speed
        return time_path(path, self.model, self.limits, speed)

    def free(self, start: FloatArray, goals: Sequence[FloatArray], rules: MoveRules) -> JointTrajectory:
        """Straight in joint space, else by sampling, to the first posture of `goals` ((6,) rad) that is reached.

        Raises MotionRejected with what stood in the way first.
        """
        first: MotionRejected | None = None
        for goal in goals:
            direct = joint_line(start, goal)
            try:
                self._require_free(joint_line(goal, goal), rules)
                self._require_free(direct, rules)
            except MotionRejected as rejection:
                first = first or rejection
            else:
                return time_path(direct, self.model, self.limits)
            if not self._blame(goal, rules) and (legs := self._sampled(start, goal, rules)) is not None:
                return chain([time_path(leg, self.model, self.limits) for leg in legs])
        raise first or MotionRejected("No posture reaches it.")

    def _sampled(self, start: FloatArray, goal: FloatArray, rules: MoveRules) -> list[JointPath] | None:
        margin = self.limits.joint_margin
        return sampled_path(
            start, goal, self.model.lower + margin, self.model.upper - margin, lambda q: not self._blame(q, rules)
        )

    def _require_free(self, path: JointPath, rules: MoveRules) -> None:
        """Raises MotionRejected at the first posture of the path that hits something or leaves the workspace."""
        for q in path.dense(_CHECK_STEP):
            if blame := self._blame(q, rules):
                raise MotionRejected(f"On the way {blame}.")

    def _blame(self, q: FloatArray, rules: MoveRules) -> str:
        """What is wrong with a posture, in words; empty where nothing is."""
        for contact in self._collisions.contacts(q, rules.opening):
            touch_allowed = contact.part in HAND and contact.obstacle in rules.touches
            if not touch_allowed and contact not in rules.ignored:
                return str(contact)
        if rules.confined and (outside := self.limits.outside(self._collisions.tcp)):
            return f"the TCP's {outside}"
        return ""
