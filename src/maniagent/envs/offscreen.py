"""Colour and depth images of a MuJoCo scene without a screen."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from .objects.bodies import COLLISION_GROUP
from .rendering import ensure_gl


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
            renderer = self._renderers[width, height] = mujoco.Renderer(self._model, height, width)
        renderer.update_scene(data, camera, self._option)
        rgb = renderer.render()
        if not depth:
            return rgb, np.empty((0, 0), np.float32)
        renderer.enable_depth_rendering()
        z = renderer.render()
        renderer.disable_depth_rendering()
        return rgb, z.astype(np.float32)

    def close(self) -> None:
        """Free the GL context."""
        for renderer in self._renderers.values():
            renderer.close()
        self._renderers.clear()
