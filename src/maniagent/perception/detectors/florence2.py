"""Florence-2 (Xiao et al. 2023, arXiv:2311.06242), the paper's detector, by the class that transformers has natively.

The model writes boxes as text and gives no confidences: all scores are 1, in the order in which it names things.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .pretrained import Pretrained, load_pretrained
from .protocol import Box

DEFAULT = "florence-community/Florence-2-large"
"""Checkpoint in the form that transformers reads without running the repository's own code."""
TASK = "<OPEN_VOCABULARY_DETECTION>"
"""Its answer may be nothing. Phrase grounding draws a box also around what isn't there."""
MAX_TOKENS = 512
"""Of an answer; a box takes four, and its name a few."""
BEAMS = 3
"""As in the authors' examples."""


class Florence2:
    """A `BoxModel`."""

    def __init__(self, where: str) -> None:
        """Load from a folder or a Hub id; SetupError where that fails."""
        self._loaded: Pretrained = load_pretrained("florence2", "Florence2ForConditionalGeneration", where)

    def boxes(self, phrase: str, rgb: NDArray[np.uint8]) -> Iterable[tuple[Box, float]]:
        """See `BoxModel`."""
        loaded = self._loaded
        inputs = loaded.encode(rgb, TASK + phrase)
        with loaded.torch.inference_mode():
            written = loaded.model.generate(**inputs, max_new_tokens=MAX_TOKENS, num_beams=BEAMS, do_sample=False)
        text = loaded.processor.batch_decode(written, skip_special_tokens=False)[0]
        return self.read(text, rgb.shape[1], rgb.shape[0])

    def read(self, text: str, width: int, height: int) -> list[tuple[Box, float]]:
        """The boxes in an answer about a picture of that size; outlines count as the boxes around them."""
        parsed = self._loaded.processor.post_process_generation(text=text, task=TASK, image_size=(width, height))
        answer: Mapping[str, Any] = parsed[TASK]
        outlined = [_around(polygons) for polygons in answer["polygons"]]
        return [(box, 1.0) for box in (*map(_box, answer["bboxes"]), *outlined) if box is not None]


def _box(corners: Sequence[float]) -> Box:
    left, top, right, bottom = map(float, corners)
    return left, top, right, bottom


def _around(polygons: Sequence[Sequence[float]]) -> Box | None:
    """The box around the outlines of one thing, each x, y, x, y, ...; None where they have no points."""
    points = np.array([xy for polygon in polygons for xy in polygon], float).reshape(-1, 2)
    return _box([*points.min(axis=0), *points.max(axis=0)]) if len(points) else None
