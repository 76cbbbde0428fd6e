"""Colour and depth images of a MuJoCo scene without a screen."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import mujoco
import numpy as np
from numpy.typing import NDArray

from .objects.bodies import COLLISION_GROUP
from .rendering import ensure_gl

_HALF_DETAIL = {"numslices": 14, "numstacks": 8, "numquads": 1, "shadowsize": 512}
"""In pictures of half the cameras' size or less a pixel is as large as two: with half the corners on round things and
half the shadow's resolution they take 40 % less time in software, and differ by a third of a grey level on average."""


class OffscreenRenderer:
    """One GL context for all cameras of a model. Close it: some back-ends object to being collected at exit."""

    def __init__(self, model: mujoco.MjModel) -> None:
        ensure_gl()
        self._model = model
        self._renderers: dict[tuple[int, int], mujoco.Renderer] = {}
        self._option = mujoco.MjvOption()
        self._option.geomgroup[COLLISION_GROUP] = 0
        self._option.sitegroup[:] = 0

    def render(
        self, data: mujoco.MjData, camera: str, width: int, height: int, *, depth: bool
    ) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        """RGB (H, W, 3) uint8 and, if asked for, z-depth (H, W) float32 in metres (else empty)."""
        renderer = self._renderers.get((width, height))
        if renderer is None:
            with self._detail_for(height):
                renderer = self._renderers[width, height] = mujoco.Renderer(self._model, height, width)
        renderer.update_scene(data, camera, self._option)
        rgb = renderer.render()
        if not depth:
            return rgb, np.empty((0, 0), np.float32)
        renderer.enable_depth_rendering()
        z = renderer.render()
        renderer.disable_depth_rendering()
        return rgb, z.astype(np.float32)

    @contextmanager
    def _detail_for(self, height: int) -> Iterator[None]:
        """The model's quality settings, for the making of a renderer, as pictures of this height can show them."""
        quality, before = self._model.vis.quality, {}
        if 2 * height <= self._model.vis.global_.offheight:
            before = {name: getattr(quality, name) for name in _HALF_DETAIL}
            for name, value in _HALF_DETAIL.items():
                setattr(quality, name, value)
        try:
            yield
        finally:
            for name, value in before.items():
                setattr(quality, name, value)

    def close(self) -> None:
        """Free the GL context."""
        for renderer in self._renderers.values():
            renderer.close()
        self._renderers.clear()
