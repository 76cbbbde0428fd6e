"""Small pictures are drawn with less detail, and show the same."""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np
import pytest

from maniagent import tasks
from maniagent.envs.tabletop import TabletopEnv


@pytest.fixture(scope="module")
def env() -> Iterator[TabletopEnv]:
    env = TabletopEnv(tasks.get("hungry").scene, noise=None)
    env.reset(seed=0)
    yield env
    env.close()


@pytest.mark.parametrize("view", [0, 1])
def test_a_small_picture_is_the_large_one_made_small(env: TabletopEnv, view: int) -> None:
    camera = env.cameras[view]
    large, large_depth = env.take(camera, depth=True, rng=None)
    small, small_depth = env.take(camera.resized(320, 240), depth=True, rng=None)
    made_small = cv2.resize(large, (320, 240), interpolation=cv2.INTER_AREA).astype(int)
    assert np.abs(small - made_small).mean() < 2.0
    assert np.median(np.abs(small_depth - large_depth[::2, ::2])) < 0.003


def test_a_square_picture_is_the_middle_of_the_wide_one(env: TabletopEnv) -> None:
    camera = env.cameras[0]
    wide, _ = env.take(camera.resized(320, 240), depth=False, rng=None)
    square, _ = env.take(camera.resized(240, 240), depth=False, rng=None)
    assert np.abs(square.astype(int) - wide[:, 40:280]).mean() < 0.5


def test_the_agents_pictures_are_the_same_whatever_was_drawn_before(env: TabletopEnv) -> None:
    before = env.observe().main_frame
    env.take(env.cameras[0].resized(160, 120), depth=False, rng=None)
    fresh = TabletopEnv(tasks.get("hungry").scene, noise=None)
    fresh.reset(seed=0)
    for frame in (env.observe().main_frame, fresh.observe().main_frame):
        np.testing.assert_array_equal(frame.rgb, before.rgb)
        np.testing.assert_array_equal(frame.depth, before.depth)
    quality = fresh.model.vis.quality
    fresh.take(fresh.cameras[0].resized(160, 120), depth=False, rng=None)
    assert (quality.numslices, quality.shadowsize) == (28, 1024)
    fresh.close()
