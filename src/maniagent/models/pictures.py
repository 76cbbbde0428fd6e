"""Pictures as they are sent and kept: lossless PNG, and told apart by what is on them."""

from __future__ import annotations

import hashlib
import io

import numpy as np
from numpy.typing import NDArray
from PIL import Image


def to_png(rgb: NDArray[np.uint8]) -> bytes:
    """The picture (H, W, 3) as a PNG file."""
    file = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(rgb)).save(file, "PNG", compress_level=3)
    return file.getvalue()


def fingerprint(rgb: NDArray[np.uint8]) -> str:
    """32 hex digits that only pictures with the same pixels share."""
    digest = hashlib.sha256(repr(rgb.shape).encode())
    digest.update(np.ascontiguousarray(rgb).tobytes())
    return digest.hexdigest()[:32]
