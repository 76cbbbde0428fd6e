"""One look per observation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tables import RIG, Look, with_depth

from maniagent.errors import CameraFailure
from maniagent.perception.sight import Sight


def test_one_observation_is_looked_at_once(tables: list[Look]) -> None:
    sight, observation = Sight(RIG), tables[0].observation
    assert sight.look(observation) is sight.look(observation)


def test_another_observation_is_another_look(tables: list[Look]) -> None:
    sight, observation = Sight(RIG), tables[0].observation
    first = sight.look(observation)
    second = sight.look(replace(observation))
    assert second is not first
    assert len(second.segments) == len(first.segments)  # the same pictures


def test_a_failure_is_not_kept_and_told_again(tables: list[Look]) -> None:
    sight, observation = Sight(RIG), tables[0].observation
    seen = sight.look(observation)
    for _ in range(2):
        with pytest.raises(CameraFailure):
            sight.look(with_depth(observation, "main", np.nan))
    assert sight.look(observation) is seen
