"""A rig as plain JSON values, and back: what perception was told of the robot is part of a recorded run."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import Any, get_type_hints

from pydantic import TypeAdapter, ValidationError

from ..assets import WX250S_XML
from ..errors import UsageError
from ..motion.kinematics import ArmModel
from ..perception.rig import Rig
from ..perception.views import RobotFilter
from ..robots.body_filter import BodyFilter

_ARMS = {WX250S_XML.stem: WX250S_XML}
_BODY = "covers_robot"


def rig_to_plain(rig: Rig) -> dict[str, Any]:
    """The rig's numbers, and its body filter by the name of the arm.

    A filter that isn't ours is noted by its own name: the rig can be looked at, not read back.
    """
    numbers = {field.name: getattr(rig, field.name) for field in dataclasses.fields(rig) if field.name != _BODY}
    return {_BODY: _body_to_plain(rig.covers_robot)} | {
        name: _finite(dataclasses.asdict(part)) for name, part in numbers.items()
    }


def rig_from_plain(plain: Any) -> Rig:
    """The inverse of `rig_to_plain`; what it doesn't mention is as it is by default.

    Raises UsageError for what is no rig, and for a body filter of somebody else's.
    """
    if not isinstance(plain, Mapping):
        raise UsageError("The recorded rig is damaged: it is no JSON object.")
    kinds = {name: kind for name, kind in get_type_hints(Rig).items() if name != _BODY}
    try:
        parts = {name: TypeAdapter(kind).validate_python(plain.get(name, {})) for name, kind in kinds.items()}
    except ValidationError as error:
        raise UsageError(f"The recorded rig is damaged: {error.errors(include_url=False)[0]['msg']}.") from error
    return Rig(_body_from_plain(plain.get(_BODY)), **parts)


def _body_to_plain(body: RobotFilter) -> dict[str, Any] | str:
    if isinstance(body, BodyFilter):
        return {"arm": body.arm, "margin": body.margin}
    return str(getattr(body, "__qualname__", type(body).__qualname__))


def _body_from_plain(plain: Any) -> BodyFilter:
    match plain:
        case {"arm": str(arm), "margin": float(margin)} if arm in _ARMS:
            return BodyFilter(ArmModel(_ARMS[arm]), margin)
    known = ", ".join(_ARMS)
    raise UsageError(f"The recorded robot's body, {plain!r}, is not known here; arms that are known: {known}.")


def _finite(value: Any) -> Any:
    """Infinities as text, which JSON can hold and which reads back as a float."""
    match value:
        case float() if not math.isfinite(value):
            return str(value)
        case dict():
            return {name: _finite(item) for name, item in value.items()}
        case list() | tuple():
            return [_finite(item) for item in value]
        case _:
            return value
