"""Where on the table the arm can pick something up and put it down again: kinematics alone, no robot, no pictures."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..geometry import FloatArray, invert_transform, make_transform, top_down_rotation
from ..motion import ArmModel, IKSolver, MotionLimits
from ..motion.closed_form import ArmDimensions
from ..motion.collision import CollisionModel, HeldBox
from ..motion.ik import half_turned
from ..types import BoolArray

IntArray = NDArray[np.intp]

GRASP_HEIGHT = 0.015
"""m, TCP above the table: the fingertips just clear of it."""
LIFTED_HEIGHT = 0.13
"""m, TCP above the table: over an object before it is taken, and over a place with the object in the hand."""
RADIUS = 0.065
"""m: half a carrot's length and a little."""
HALF_HEIGHT = 0.01
"""m, of what is in the hand."""
PITCH = 0.025
"""m, at most, between the points of the table at which the arm's postures are worked out."""
YAWS = 4
"""Directions of the jaws, over half a turn, at which they are."""


class Reach:
    """Where a top-down pick is possible: the TCP gets to grasp height and to lifted height, hand and object free.

    Postures are worked out once, on a lattice of positions and jaw directions; in between, a place is within reach
    where all the lattice's points around it are. So it is never judged better than it is, a centimetre at the rim
    is given away, and asking costs nothing.
    """

    def __init__(self, model: ArmModel, limits: MotionLimits, radius: float = RADIUS) -> None:
        """For this arm within these limits, and an object of this radius; takes about a second."""
        self.radius = radius
        """m, of the circle that holds the object's footprint however it is turned."""
        self.low: FloatArray = np.array(limits.workspace_low[:2])
        """(2,) m, base frame: lower corner of what can be within reach."""
        self.high: FloatArray = np.array(limits.workspace_high[:2])
        """(2,) m, upper corner."""
        self._cells = np.ceil((self.high - self.low) / PITCH).astype(int)
        xs, ys = (np.linspace(self.low[axis], self.high[axis], self._cells[axis] + 1) for axis in (0, 1))
        pick = _Pick(model, limits, radius)
        yaws = np.arange(YAWS) * np.pi / YAWS
        self._possible = np.array([[[pick.possible(x, y, yaw) for yaw in yaws] for y in ys] for x in xs])

    def contains(self, xy: FloatArray, yaw: FloatArray) -> BoolArray:
        """Which picks are possible, (...,) bool.

        `xy` are (..., 2) m, base frame; `yaw` (...,) rad is the direction of the object's long side, which the jaws
        close across.
        """
        inside = np.all((xy >= self.low) & (xy <= self.high), axis=-1)
        place = np.where(inside[..., None], (xy - self.low) / (self.high - self.low) * self._cells, 0.0)
        cell = np.minimum(place.astype(int), self._cells - 1)
        turn = np.floor(np.mod(yaw, np.pi) / np.pi * YAWS).astype(int) % YAWS
        return inside & self._around(cell, place - cell, turn) & self._around(cell, place - cell, (turn + 1) % YAWS)

    def _around(self, cell: IntArray, within: FloatArray, turn: IntArray) -> BoolArray:
        """Whether the corners of a cell are possible in one direction; one may not be, on the far side of a diagonal.

        Without the latter the rim would be a staircase.
        """
        bad, cut_off = np.zeros(within.shape[:-1], int), np.zeros(within.shape[:-1], bool)
        for corner in ((0, 0), (0, 1), (1, 0), (1, 1)):
            impossible = ~self._possible[cell[..., 0] + corner[0], cell[..., 1] + corner[1], turn]
            bad += impossible
            cut_off |= impossible & (np.abs(within - corner).sum(axis=-1) < 1.0)
        return (bad == 0) | ((bad == 1) & ~cut_off)


class _Pick:
    """One pick at a time, worked out on the arm's model."""

    def __init__(self, model: ArmModel, limits: MotionLimits, radius: float) -> None:
        self._model, self._limits = model, limits
        self._solver = IKSolver(model, limits.joint_margin)
        self._dimensions = ArmDimensions.of(model)
        self._collisions = CollisionModel(model)
        # In the jaws: as wide as they open, and as long as it may be, across them.
        T_tcp_object = invert_transform(make_transform(top_down_rotation(0.0), np.zeros(3)))
        self._collisions.set_scene({}, HeldBox(T_tcp_object, np.array([radius, model.max_opening / 2, HALF_HEIGHT])))

    def possible(self, x: float, y: float, yaw: float) -> bool:
        """Whether the arm gets there at both heights, the jaws either way round."""
        return all(self._posture_exists(x, y, z, yaw) for z in (LIFTED_HEIGHT, GRASP_HEIGHT))

    def _posture_exists(self, x: float, y: float, z: float, yaw: float) -> bool:
        T_base_tcp = make_transform(top_down_rotation(yaw), [x, y, z])
        # Where the links are too short, the solver would still search, for a second's fraction and in vain.
        if self._limits.outside(T_base_tcp[:3, 3]) or self._dimensions.missing_reach(T_base_tcp) != 0.0:
            return False
        return any(
            not self._collisions.contacts(q, self._model.max_opening)
            for T in (T_base_tcp, half_turned(T_base_tcp))
            for q in self._solver.solutions(T, self._model.home)
        )
