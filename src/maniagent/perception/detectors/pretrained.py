"""Detectors that draw boxes with weights of their own: how they are loaded, and what all of them do alike.

They need the extra `detectors` (torch, transformers), which is imported when the first one is made.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ...errors import DetectionFailure, SetupError
from ...types import Observation
from ..segmentation import TableView
from .boxes import match_boxes
from .protocol import Box, Match
from .wording import every


class BoxModel(Protocol):
    """Weights that draw boxes around what a phrase names."""

    def boxes(self, phrase: str, rgb: NDArray[np.uint8]) -> Iterable[tuple[Box, float]]:
        """Boxes in pixels of the picture (H, W, 3), with scores in [0, 1]; whatever the network puts out.

        `phrase` is one that `every` made: words, without markup.
        """
        ...


class BoxDetector:
    """A `Detector` from a model that draws boxes: each query on its own, in the main view, "every X"."""

    def __init__(self, name: str, model: BoxModel) -> None:
        self._name = name
        self._model = model

    @property
    def name(self) -> str:
        """As the user named it."""
        return self._name

    def detect(
        self, queries: Sequence[str], view: TableView, observation: Observation
    ) -> tuple[tuple[Match, ...], ...]:
        """See `Detector`; raises DetectionFailure for a query without words."""
        frame = observation.main_frame
        return tuple(match_boxes(query, self._model.boxes(_phrase(query), frame.rgb), view, frame) for query in queries)


def _phrase(query: str) -> str:
    try:
        return every(query)
    except ValueError as error:
        raise DetectionFailure(f"A detector can't look for that: {error}.") from error


@dataclass(frozen=True)
class Pretrained:
    """A processor and a model of the transformers library, ready to use."""

    torch: Any
    """The module."""
    processor: Any
    model: Any
    device: str

    def encode(self, rgb: NDArray[np.uint8], text: str, **options: Any) -> Any:
        """A picture (H, W, 3) and a text as the model's inputs, on its device."""
        from PIL import Image

        return self.processor(images=Image.fromarray(rgb), text=text, return_tensors="pt", **options).to(self.device)


@lru_cache(maxsize=2)
def load_pretrained(architecture: str, model_class: str, where: str) -> Pretrained:
    """Load an architecture (a `model_type` of transformers) from a folder or a Hub id; on the GPU where there is one.

    Weights stay loaded: an evaluation makes its agents anew for every episode.

    Raises SetupError where the extra is not installed, where the weights are not there and can't be fetched, and
    where what is there is another architecture, damaged or not complete.
    """
    try:
        import torch
        import transformers
        from safetensors import SafetensorError
    except ImportError as error:
        raise SetupError(
            f"This detector needs torch and transformers ({error}). Install them with: "
            "pip install 'maniagent[detectors]'"
        ) from error
    try:
        found = transformers.AutoConfig.from_pretrained(where).model_type
        if found != architecture:
            raise SetupError(f"The weights in {where!r} are those of a {found!r}; {architecture!r} is wanted.")
        processor = transformers.AutoProcessor.from_pretrained(where)
        # Checkpoints in half precision would crawl on a CPU, and boxes are no better for it on a GPU.
        model, report = getattr(transformers, model_class).from_pretrained(
            where, dtype=torch.float32, output_loading_info=True
        )
    except (OSError, ValueError, SafetensorError) as error:
        reason = next(iter(str(error).strip().splitlines()), type(error).__name__)
        raise SetupError(
            f"The detector's weights can't be loaded from {where!r}: {reason} Give NAME:FOLDER with a folder that "
            "`save_pretrained` wrote, or NAME:ID with a Hugging Face id that this machine can reach."
        ) from error
    if missing := report["missing_keys"]:  # they would be random numbers, and so would the boxes
        raise SetupError(
            f"The weights in {where!r} are not complete: {len(missing)} are missing, {min(missing)!r} first."
        )
    device = "cuda" if torch.cuda.is_available() else "cpu"
    return Pretrained(torch, processor, model.to(device).eval(), device)
