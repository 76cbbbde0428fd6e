"""The twin's two cameras and what a real depth camera does to a perfect image.

The noise model follows what is published of the RealSense D435: the depth error of a stereo pair grows with z
squared, returns are missing out of range, at depth edges (one imager is occluded there) and here and there.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from ..geometry import FloatArray, look_at


@dataclass(frozen=True)
class CameraSpec:
    """A pinhole camera fixed in the base frame."""

    name: str
    eye: tuple[float, float, float]
    """m, base frame."""
    target: tuple[float, float, float]
    """m, the point in the middle of the image."""
    focal_length: float = 607.0
    """px; a D435's colour imager at 640x480."""
    width: int = 640
    height: int = 480

    @property
    def K(self) -> FloatArray:
        """(3, 3) intrinsics; the principal point is the image's middle."""
        f = self.focal_length
        return np.array([[f, 0.0, (self.width - 1) / 2], [0.0, f, (self.height - 1) / 2], [0.0, 0.0, 1.0]])

    @property
    def T_base_camera(self) -> FloatArray:
        """(4, 4), OpenCV axes."""
        return look_at(self.eye, self.target)

    @property
    def fovy(self) -> float:
        """Vertical field of view, degrees (MuJoCo's unit)."""
        return float(np.degrees(2 * np.arctan2(self.height / 2, self.focal_length)))

    def resized(self, width: int, height: int) -> CameraSpec:
        """The same camera with smaller or larger pixels: the vertical field of view stays, the sides may be cut off."""
        return replace(self, width=width, height=height, focal_length=self.focal_length * height / self.height)


MAIN_CAMERA = CameraSpec("main", eye=(0.68, 0.0, 0.62), target=(0.26, 0.0, 0.0))
"""In front of the table and above it, looking back at the robot: what the person who instructs sees."""
SIDE_CAMERA = CameraSpec("side", eye=(0.24, -0.47, 0.60), target=(0.27, 0.0, 0.0))
"""At the robot's right."""


@dataclass(frozen=True)
class DepthNoise:
    """RealSense-D435-like depth noise."""

    baseline: float = 0.050
    """m between the two imagers."""
    subpixel: float = 0.08
    """px, RMS error of the disparity on a well-textured surface."""
    z_min: float = 0.28
    z_max: float = 3.0
    """m, outside of which nothing is returned."""
    edge_step: float = 0.02
    """m; depth steps larger than this lose their returns within a pixel or two."""
    dropout: float = 0.002
    """Share of small spots without a return."""
    blur: float = 0.6
    """px, sigma of the lens's blur."""
    colour_sigma: float = 2.0
    """RMS of the colour noise, grey levels."""

    def depth(self, clean: NDArray[np.float32], focal_length: float, rng: np.random.Generator) -> NDArray[np.float32]:
        """A noisy copy of a clean z-depth image (H, W) in metres; NaN where nothing is returned."""
        # Block matching looks at windows: its errors are correlated over a few pixels. Blurring white noise with
        # sigma 1.2 px divides its RMS by 2 sqrt(pi) 1.2.
        noise = cv2.GaussianBlur(rng.standard_normal(clean.shape, dtype=np.float32), (0, 0), 1.2)
        noise = noise * np.float32(2.0 * np.sqrt(np.pi) * 1.2)
        sigma = np.square(clean) * np.float32(self.subpixel / (focal_length * self.baseline))
        kernel = np.ones((3, 3), np.uint8)
        step = cv2.dilate(clean, kernel) - cv2.erode(clean, kernel)
        spots = cv2.dilate((rng.random(clean.shape, dtype=np.float32) < self.dropout / 9).astype(np.uint8), kernel)
        lost = (step > self.edge_step) | (spots > 0) | (clean < self.z_min) | (clean > self.z_max)
        return np.where(lost, np.float32(np.nan), clean + noise * sigma).astype(np.float32)

    def colour(self, clean: NDArray[np.uint8], rng: np.random.Generator) -> NDArray[np.uint8]:
        """A noisy copy of an RGB image (H, W, 3), a little out of focus as through any lens."""
        if self.blur > 0:
            clean = np.asarray(cv2.GaussianBlur(clean, (0, 0), self.blur), np.uint8)
        noise = rng.standard_normal(clean.shape, dtype=np.float32) * np.float32(self.colour_sigma)
        return np.clip(np.rint(clean + noise), 0, 255).astype(np.uint8)
