"""Whose left is left: directions on the table as the person sees them who looks at the main view."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from ..geometry import FloatArray
from ..types import Observation


@dataclass(frozen=True)
class Viewpoint:
    """Two unit vectors in the base xy plane."""

    right: FloatArray
    """(2,), to the right in the main view."""
    away: FloatArray
    """(2,), away from the viewer."""

    @classmethod
    def from_camera(cls, T_base_camera: FloatArray) -> Self:
        """The viewpoint of a camera ((4, 4), OpenCV axes); ValueError for one that is tilted on its side."""
        right = T_base_camera[:2, 0]
        length = float(np.linalg.norm(right))
        if length < 0.5:
            raise ValueError("the camera's image is not upright: left and right mean nothing on the table")
        right = right / length
        return cls(right, np.array([-right[1], right[0]]))

    @classmethod
    def of(cls, observation: Observation) -> Self:
        """The viewpoint of the main view."""
        return cls.from_camera(observation.main_frame.T_base_camera)
