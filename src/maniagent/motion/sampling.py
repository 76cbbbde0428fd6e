"""Collision-free joint paths by sampling (OMPL's RRT-Connect, Kuffner & LaValle 2000)."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from ompl import base, geometric, util

from ..geometry import FloatArray
from .path import JointPath, joint_line

_TRIES = 1500
"""Tree extensions before giving up; counted rather than timed, so that a busy machine plans alike."""
_RANGE = 0.5
"""rad, longest extension."""
_RESOLUTION = 0.03
"""rad between the postures that are checked along an extension."""

util.setLogLevel(util.LOG_ERROR)
util.RNG.setSeed(1)  # once per process, before the first sampler: OMPL can't be seeded again


def sampled_path(
    start: FloatArray,
    goal: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    is_free: Callable[[FloatArray], bool],
) -> list[JointPath] | None:
    """Straight joint-space legs from `start` to `goal` ((6,) rad) with `is_free` on the way; None if none is found."""
    space = base.RealVectorStateSpace(len(start))
    bounds = base.RealVectorBounds(len(start))
    for joint in range(len(start)):
        bounds.setLow(joint, float(min(lower[joint], start[joint])))
        bounds.setHigh(joint, float(max(upper[joint], start[joint])))
    space.setBounds(bounds)
    setup = geometric.SimpleSetup(space)
    setup.setStateValidityChecker(lambda state: is_free(_vector(state, len(start))))
    information = setup.getSpaceInformation()
    information.setStateValidityCheckingResolution(_RESOLUTION / space.getMaximumExtent())
    states = [space.allocState(), space.allocState()]
    for state, q in zip(states, (start, goal), strict=True):
        for joint, angle in enumerate(q):
            state[joint] = float(angle)
    setup.setStartAndGoalStates(*states)
    planner = geometric.RRTConnect(information)
    planner.setRange(_RANGE)
    setup.setPlanner(planner)
    setup.solve(base.PlannerTerminationCondition(_countdown(_TRIES)))
    if not setup.haveExactSolutionPath():
        return None
    path = setup.getSolutionPath()
    simplifier = setup.getPathSimplifier()
    simplifier.reduceVertices(path)
    simplifier.partialShortcutPath(path)
    corners = [_vector(state, len(start)) for state in path.getStates()]
    return [joint_line(a, b) for a, b in pairwise(corners)]


def _vector(state: base.State, n: int) -> FloatArray:
    return np.array([state[joint] for joint in range(n)])


def _countdown(n: int) -> Callable[[], bool]:
    """A condition that comes true when it has been asked `n` times."""
    left = n

    def expired() -> bool:
        nonlocal left
        left -= 1
        return left < 0

    return expired
