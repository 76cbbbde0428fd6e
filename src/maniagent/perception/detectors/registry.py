"""Detectors by name: ours, and whatever other packages register as entry points.

A name is `NAME` or `NAME:ARGUMENT`; of ours, those with weights take a folder or a Hugging Face id. Another package
adds one in its pyproject.toml, where `make` is a `Factory`:

    [project.entry-points."maniagent.detectors"]
    mine = "my_package.detector:make"
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib.metadata import entry_points
from typing import Protocol

from ...errors import SetupError, UnknownNameError, UsageError
from ...models.question import ChatModel
from ..lexicon import Lexicon
from .florence2 import DEFAULT as FLORENCE2
from .florence2 import Florence2
from .lexicon import LexiconDetector
from .marks import MarksDetector
from .pretrained import BoxDetector
from .protocol import Detector
from .zeroshot import GROUNDING_DINO, OWLV2, ZeroShot

GROUP = "maniagent.detectors"
"""The group of entry points."""


class Factory(Protocol):
    """Makes a detector."""

    def __call__(self, argument: str, model: ChatModel | None) -> Detector:
        """The detector for what stands after the colon ("" without one), with the run's VLM where it has one.

        Raises UsageError for a bad argument or a missing model, SetupError for what isn't installed.
        """
        ...


def detector_names() -> tuple[str, ...]:
    """All that can be asked for, in alphabetical order."""
    return tuple(sorted(_BUILT_IN.keys() | entry_points(group=GROUP).names))


def make_detector(name: str, model: ChatModel | None = None) -> Detector:
    """The detector of that name (see the module); `model` is the VLM that `marks` asks.

    Raises
    ------
    UnknownNameError
        For a name that nobody registered.
    UsageError
        Where the detector takes no argument, or needs a model and has none.
    SetupError
        Where packages or weights are missing.

    """
    kind, _, argument = name.partition(":")
    factory = _BUILT_IN.get(kind) or _load_entry_point(kind)
    return factory(argument, model)


def _load_entry_point(kind: str) -> Factory:
    found = entry_points(group=GROUP, name=kind)
    if not found:
        raise UnknownNameError("detector", kind, detector_names())
    (first, *_) = found
    try:
        factory: Factory = first.load()
    except (ImportError, AttributeError) as error:
        raise SetupError(f"The detector {kind!r} ({first.value}) can't be loaded: {error}") from error
    return factory


def _lexicon(argument: str, model: ChatModel | None) -> Detector:
    _no_argument("lexicon", argument)
    return LexiconDetector(Lexicon.load())


def _marks(argument: str, model: ChatModel | None) -> Detector:
    _no_argument("marks", argument)
    if model is None:
        raise UsageError("The detector 'marks' asks a vision-language model, and none is given. Name one with --vlm.")
    return MarksDetector(model)


def _florence2(argument: str, model: ChatModel | None) -> Detector:
    where = argument or FLORENCE2
    return BoxDetector(f"florence2:{where}", Florence2(where))


def _grounding_dino(argument: str, model: ChatModel | None) -> Detector:
    where = argument or GROUNDING_DINO.default
    return BoxDetector(f"grounding-dino:{where}", ZeroShot(GROUNDING_DINO, where))


def _owlv2(argument: str, model: ChatModel | None) -> Detector:
    where = argument or OWLV2.default
    return BoxDetector(f"owlv2:{where}", ZeroShot(OWLV2, where))


def _no_argument(name: str, argument: str) -> None:
    if argument:
        raise UsageError(f"The detector {name!r} takes nothing after its name, and got {argument!r}.")


_BUILT_IN: Mapping[str, Factory] = {
    "lexicon": _lexicon,
    "marks": _marks,
    "florence2": _florence2,
    "grounding-dino": _grounding_dino,
    "owlv2": _owlv2,
}
"""They come first: another package can't take their names."""
