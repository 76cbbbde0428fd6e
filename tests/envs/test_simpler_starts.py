"""Starts off the grid: within the area of the layouts, apart, turned, and the same for the same draw."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from maniagent.envs.simpler import Start, draw_start
from maniagent.envs.simpler.starts import APART
from maniagent.errors import UsageError
from maniagent.evaluation.poses import GRID, OFF_GRID, Poses
from maniagent.geometry import FloatArray

UPRIGHT = [1.0, 0.0, 0.0, 0.0]
CORNERS = [[-0.235, -0.075], [-0.235, 0.075], [-0.085, -0.075], [-0.085, 0.075]]
TABLE = np.array([[[*a, 0.89], [*b, 0.87]] for a in CORNERS for b in CORNERS if a != b])
TABLE_ATTITUDES = np.array([[[0.0, 0.0, 0.0, 1.0], UPRIGHT], [[0.7071068, 0.0, 0.0, -0.7071068], UPRIGHT]])
SINK = np.array([[[x, y, 0.933], [-0.125, 0.025, 1.0]] for x in (-0.115, -0.095) for y in (0.19, 0.2, 0.22)])
SINK_ATTITUDES = np.array([[[0.5437, 0.8255, 0.0746, 0.1317], UPRIGHT], [[-0.1088, 0.3377, 0.8974, -0.2623], UPRIGHT]])
SINK_ATTITUDES /= np.linalg.norm(SINK_ATTITUDES, axis=2, keepdims=True)
tasks = st.sampled_from([(TABLE, TABLE_ATTITUDES), (SINK, SINK_ATTITUDES)])
seeds = st.integers(0, 2**32 - 1)


def draw(task: tuple[FloatArray, FloatArray], seed: int) -> Start:
    return draw_start(*task, np.random.default_rng(seed))


@given(tasks, seeds)
def test_both_objects_start_within_the_area_of_their_layouts(task: tuple[FloatArray, FloatArray], seed: int) -> None:
    start = draw(task, seed)
    for i, point in enumerate(start.positions):
        allowed = task[0][:, i, :2]
        if np.ptp(allowed, axis=0).max() > 0:
            edges = ConvexHull(allowed).equations
            assert np.all(edges[:, :2] @ point[:2] + edges[:, 2] <= 1e-9)
        assert point[2] == pytest.approx(task[0][0, i, 2])


@given(seeds)
def test_they_are_apart(seed: int) -> None:
    start = draw((TABLE, TABLE_ATTITUDES), seed)
    assert np.linalg.norm(start.positions[0, :2] - start.positions[1, :2]) >= APART


@given(tasks, seeds)
def test_objects_are_turned_about_the_vertical_alone(task: tuple[FloatArray, FloatArray], seed: int) -> None:
    """Whatever points up in one of the layouts still does."""
    start = draw(task, seed)
    for i in range(2):
        up = Rotation.from_quat(start.quaternions[i], scalar_first=True).inv().apply([0.0, 0.0, 1.0])
        layouts = Rotation.from_quat(task[1][:, i], scalar_first=True).inv().apply([0.0, 0.0, 1.0])
        assert np.linalg.norm(layouts - up, axis=1).min() < 1e-6


@given(seeds)
def test_what_no_layout_moves_stays_as_it_is(seed: int) -> None:
    start = draw((SINK, SINK_ATTITUDES), seed)
    assert start.positions[1].tolist() == [-0.125, 0.025, 1.0]
    assert start.quaternions[1].tolist() == UPRIGHT


def test_draws_fill_the_area_and_all_directions() -> None:
    starts = [draw((TABLE, TABLE_ATTITUDES), seed) for seed in range(150)]
    xy = np.array([start.positions[0, :2] for start in starts])
    assert np.all(xy.min(axis=0) < [-0.22, -0.06])
    assert np.all(xy.max(axis=0) > [-0.1, 0.06])
    for i in range(2):
        turned = Rotation.from_quat([start.quaternions[i] for start in starts], scalar_first=True)
        yaws = np.sort(turned.as_euler("xyz")[:, 2])
        assert np.diff(yaws, append=yaws[0] + 2 * np.pi).max() < 0.4


@given(seeds, st.integers(0, 9999))
def test_a_draw_is_that_of_its_pose_seed_task_and_episode(seed: int, episode: int) -> None:
    def bits(poses: Poses, task: str, episode: int) -> int:
        return int(poses.generator(task, episode).integers(2**63))

    poses = Poses(OFF_GRID, seed)
    assert bits(poses, "a", episode) == bits(Poses(OFF_GRID, seed), "a", episode)
    others = {bits(poses, "b", episode), bits(poses, "a", episode + 1), bits(Poses(OFF_GRID, seed + 1), "a", episode)}
    assert bits(poses, "a", episode) not in others


@pytest.mark.parametrize(
    ("kind", "seed", "said"),
    [("grip", 0, "Did you mean 'grid'"), (GRID, 3, "--poses off-grid"), (OFF_GRID, -1, "0 or more")],
)
def test_poses_that_make_no_sense_are_refused(kind: str, seed: int, said: str) -> None:
    with pytest.raises(UsageError, match=said):
        Poses(kind, seed)
