"""One event as one line of JSON: small enough to read, complete enough to tell the story.

Images and masks go into files of their own; a line names them. Floats are written so that they read back bit by bit,
which is what a replay compares by. Numbers that JSON can't hold (NaN, infinity) become null, so that every line is
strict JSON.
"""

from __future__ import annotations

import dataclasses
import enum
import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel

from ..types import CameraFrame, Detection, Event, GraspPose, ObjectInfo

_LONGEST_ARRAY = 64
"""Larger arrays are summarised by shape and type."""

_GRASPS_KEPT = 3
"""Of an object's grasps the log keeps the best few."""


def to_line(event: Event, **extra: Any) -> str:
    """The event as one line of strict JSON, with its data and `extra` beside `kind` and `time`."""
    record = {"kind": event.kind, "time": round(event.time, 4)}
    record |= {name: to_plain(value) for name, value in event.data.items()}
    return json.dumps(record | to_plain(extra), ensure_ascii=False, allow_nan=False)


def to_plain(value: Any) -> Any:
    """`value` as what JSON knows: dictionaries, lists, strings, finite numbers, booleans, None."""
    match value:
        case None | bool() | int():
            return value
        case enum.Enum():
            return value.value
        case str():
            return value.encode("utf-8", "replace").decode()  # a lone surrogate can't be written to a file
        case float() | np.floating():
            return float(value) if math.isfinite(value) else None
        case np.generic():
            return value.item()
        case Path():
            return str(value)
        case BaseModel():
            return value.model_dump(mode="json")
        case CameraFrame():
            return _frame(value)
        case Detection():
            return {
                "query": value.query,
                "box": to_plain(value.box),
                "score": to_plain(value.score),
                "frame": value.frame,
            }
        case GraspPose():
            return {name: to_plain(getattr(value, name)) for name in ("T_base_grasp", "opening", "score")}
        case np.ndarray():
            return to_plain(value.tolist()) if value.size <= _LONGEST_ARRAY else f"{value.dtype} array {value.shape}"
        case Mapping():
            return {str(key): to_plain(item) for key, item in value.items()}
        case list() | tuple():
            return [to_plain(item) for item in value]
        case set() | frozenset():
            return sorted((to_plain(item) for item in value), key=str)
        case ObjectInfo():
            return _fields(dataclasses.replace(value, grasps=value.grasps[:_GRASPS_KEPT]))
        case _ if dataclasses.is_dataclass(value):
            return _fields(value)
        case _:
            return str(value)


def _frame(frame: CameraFrame) -> dict[str, Any]:
    height, width = frame.depth.shape
    known = float(np.isfinite(frame.depth).mean()) if frame.depth.size else 0.0
    return {
        "width": width,
        "height": height,
        "depth_known": round(known, 4),
        "K": to_plain(frame.K),
        "T_base_camera": to_plain(frame.T_base_camera),
    }


def _fields(value: Any) -> dict[str, Any]:
    """A dataclass's fields by name, but for those that its repr leaves out, too."""
    return {field.name: to_plain(getattr(value, field.name)) for field in dataclasses.fields(value) if field.repr}


def read_lines(path: Path) -> list[dict[str, Any]]:
    """The events of a log; a last line that was cut short by a crash is left out.

    Raises ValueError where a line before the last is no JSON object.
    """
    lines = path.read_text(encoding="utf-8", errors="replace").rstrip("\n").split("\n")  # not at U+2028, as splitlines
    events: list[dict[str, Any]] = []
    for number, line in enumerate(lines, 1):
        try:
            record = json.loads(line)
        except json.JSONDecodeError:
            if number == len(lines):
                break
            raise ValueError(f"{path}, line {number}: not JSON") from None
        if not isinstance(record, dict):
            raise ValueError(f"{path}, line {number}: not a JSON object")
        events.append(record)
    return events
