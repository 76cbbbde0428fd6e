"""Objects by name."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from functools import cache, partial
from typing import Any

from ...errors import UnknownNameError, UsageError
from . import cutlery, figures, produce, tableware, things
from .model import ObjectModel

MAKERS: Mapping[str, Callable[..., ObjectModel]] = {
    "red_chili": partial(produce.chili, "red"),
    "green_chili": partial(produce.chili, "green"),
    "carrot": produce.carrot,
    "eggplant": produce.eggplant,
    "banana": produce.banana,
    "strawberry": produce.strawberry,
    "egg": produce.egg,
    "corn": produce.corn,
    "plate": tableware.plate,
    "dish": tableware.dish,
    "basket": tableware.basket,
    "towel": tableware.towel,
    "spoon": cutlery.spoon,
    "fork": cutlery.fork,
    "knife": cutlery.knife,
    "block": things.block,
    "marker": things.marker,
    "toy": figures.toy,
    "hand": figures.hand,
}


def object_names() -> tuple[str, ...]:
    """All kinds of objects, in the order in which the gallery shows them."""
    return tuple(MAKERS)


def make_object(kind: str, **params: Any) -> ObjectModel:
    """The model of one kind of object; models are cached and immutable, `params` are the maker's.

    Raises UnknownNameError for an unknown `kind`, UsageError for parameters that the kind doesn't take or can't use.
    """
    if kind not in MAKERS:
        raise UnknownNameError("object", kind, MAKERS)
    accepted = inspect.signature(MAKERS[kind]).parameters
    unknown = sorted(set(params) - set(accepted))
    if unknown:
        takes = f"takes {', '.join(accepted)}" if accepted else "takes no parameters"
        raise UsageError(f"Object {kind!r} {takes}; it doesn't know {', '.join(unknown)}.")
    hashable = {key: tuple(value) if isinstance(value, list) else value for key, value in params.items()}
    return _make(kind, tuple(sorted(hashable.items())))


@cache
def _make(kind: str, params: tuple[tuple[str, Any], ...]) -> ObjectModel:
    return MAKERS[kind](**dict(params))
