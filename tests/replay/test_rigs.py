"""A rig can be written down and read back."""

import json
import math
from typing import Any

import numpy as np
import pytest

from maniagent.errors import UsageError
from maniagent.motion import ArmModel
from maniagent.perception.grasps import GraspTuning, GripperShape
from maniagent.perception.rig import Rig
from maniagent.perception.views import Tuning, Workspace
from maniagent.replay.rigs import rig_from_plain, rig_to_plain
from maniagent.robots.body_filter import BodyFilter
from maniagent.testing import made_observation, no_body

PLAIN = Rig(BodyFilter(ArmModel()))
ODD = Rig(
    BodyFilter(ArmModel(), margin=1 / 3),
    Workspace(x=(0.1, 1 / 3)),
    Tuning(chroma=math.inf, darker=-0.0),
    GripperShape(max_opening=0.1),
    GraspTuning(centres=7),
)


@pytest.mark.parametrize("rig", [PLAIN, ODD])
def test_a_rig_reads_back_as_it_was(rig: Rig) -> None:
    plain = json.loads(json.dumps(rig_to_plain(rig), allow_nan=False))
    assert rig_from_plain(plain) == rig
    assert rig_to_plain(rig_from_plain(plain)) == plain


def test_its_body_filter_covers_the_same_points() -> None:
    state = made_observation().robot
    points = np.random.default_rng(0).uniform(-0.2, 0.5, (2000, 3)).astype(np.float32)
    covered = PLAIN.covers_robot(points, state)
    assert 0 < covered.sum() < len(points)
    np.testing.assert_array_equal(rig_from_plain(rig_to_plain(PLAIN)).covers_robot(points, state), covered)


def test_somebody_elses_body_is_noted_and_can_not_be_read_back() -> None:
    plain = rig_to_plain(Rig(no_body))
    assert plain["covers_robot"] == "no_body"
    with pytest.raises(UsageError, match=r"'no_body', is not known here; arms that are known: wx250s"):
        rig_from_plain(plain)


@pytest.mark.parametrize(
    "damage",
    [
        {"covers_robot": {"arm": "panda", "margin": 0.02}},
        {"covers_robot": {"arm": "wx250s", "margin": "wide"}},
        {"covers_robot": None},
        {"workspace": {"x": [0, 1, 2]}},
        {"tuning": {"height": "high"}},
        {"gripper": 7},
    ],
)
def test_what_is_no_rig_is_refused(damage: dict[str, Any]) -> None:
    with pytest.raises(UsageError, match="recorded"):
        rig_from_plain(rig_to_plain(PLAIN) | damage)


def test_nor_is_anything_else_a_rig() -> None:
    with pytest.raises(UsageError, match="damaged"):
        rig_from_plain("wx250s")
