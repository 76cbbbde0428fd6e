"""Hugging Face's zero-shot object detectors: Grounding DINO (arXiv:2303.05499), OWLv2 (arXiv:2306.09683)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .pretrained import Pretrained, load_pretrained
from .protocol import Box


@dataclass(frozen=True)
class Family:
    """What differs from one architecture to the next."""

    architecture: str
    """As transformers calls it."""
    default: str
    """Hub id."""
    threshold: float
    """Least score of a box, as the model's processor has it by default."""
    ending: str
    """What a phrase ends in."""
    padded: bool
    """The text must be as long as the model's longest."""


GROUNDING_DINO = Family("grounding-dino", "IDEA-Research/grounding-dino-base", 0.25, ".", padded=False)
OWLV2 = Family("owlv2", "google/owlv2-base-patch16-ensemble", 0.1, "", padded=True)


class ZeroShot:
    """A `BoxModel`. Each phrase is a picture's only one, so every box belongs to it."""

    def __init__(self, family: Family, where: str) -> None:
        """Load from a folder or a Hub id; SetupError where that fails."""
        self._family = family
        self._loaded: Pretrained = load_pretrained(family.architecture, "AutoModelForZeroShotObjectDetection", where)

    def boxes(self, phrase: str, rgb: NDArray[np.uint8]) -> Iterable[tuple[Box, float]]:
        """See `BoxModel`."""
        loaded, family = self._loaded, self._family
        padding = {"padding": "max_length"} if family.padded else {}
        # Without truncation a long phrase runs over the text encoder's positions.
        inputs = loaded.encode(rgb, phrase.lower() + family.ending, truncation=True, **padding)
        with loaded.torch.inference_mode():
            outputs = loaded.model(**inputs)
        (found,) = loaded.processor.post_process_grounded_object_detection(
            outputs, threshold=family.threshold, target_sizes=[rgb.shape[:2]]
        )
        corners = found["boxes"].cpu().numpy().astype(float)
        return [
            ((left, top, right, bottom), float(score))
            for (left, top, right, bottom), score in zip(corners.tolist(), found["scores"].tolist(), strict=True)
        ]
