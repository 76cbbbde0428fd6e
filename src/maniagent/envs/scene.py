"""Scenes as data: which objects stand on the table, and where, or drawn from which region.

A scene file is YAML (docs/scenes.md). `Scene` validates it, `place_objects` draws one layout from it: seeded,
nothing overlapping, everything within the arm's reach.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np
import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from ..errors import UsageError
from ..geometry import FloatArray, rotation_z
from .objects import ObjectModel, make_object, object_names

Metres = Annotated[float, Field(allow_inf_nan=False, ge=-2.0, le=2.0)]
Degrees = Annotated[float, Field(allow_inf_nan=False, ge=-360.0, le=360.0)]
Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]{0,39}$")]

REACH_RADIUS = (0.19, 0.42)
"""m from the base axis, within which a top-down grasp at table height is always possible."""
REACH_Y = (-0.24, 0.24)
REACH_X = (0.15, 0.40)
CLEARANCE = 0.025
"""m kept free between objects, so that the fingers fit between them."""


class _Data(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class Region(_Data):
    """A rectangle on the table from which a position is drawn, base frame."""

    x: tuple[Metres, Metres] = REACH_X
    y: tuple[Metres, Metres] = REACH_Y

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.x[0] > self.x[1] or self.y[0] > self.y[1]:
            raise ValueError("a region's ranges are [low, high]")
        return self


class Place(_Data):
    """Where an object stands. At most one of `at`, `beside` and `on`; without any, drawn from `region`."""

    region: Region = Region()
    at: tuple[Metres, Metres] | None = None
    """Fixed position (x, y), base frame."""
    beside: Name | None = None
    """Another object from whose centre `offset` counts."""
    offset: tuple[Metres, Metres] = (0.0, 0.0)
    on: Name | None = None
    """Another object on which it stands, in the middle."""
    yaw: Degrees | tuple[Degrees, Degrees] = (-180.0, 180.0)
    """Degrees counter-clockwise from base x, or a range to draw from."""

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        if sum(way is not None for way in (self.at, self.beside, self.on)) > 1:
            raise ValueError("give at most one of at, beside and on")
        return self


class SceneObject(_Data):
    """One thing on the table."""

    name: Name
    kind: str
    """A name from the object library (`maniagent gallery` shows them)."""
    params: Mapping[str, Any] = {}
    """Passed to the library, e.g. {size: 0.03, colour: yellow} for a block."""
    place: Place = Place()

    @field_validator("kind")
    @classmethod
    def _known(cls, kind: str) -> str:
        if kind not in object_names():
            raise ValueError(f"no object kind {kind!r}; the library has {', '.join(object_names())}")
        return kind

    def model(self) -> ObjectModel:
        """The library's model of it."""
        return make_object(self.kind, **self.params)


class Scene(_Data):
    """Everything on the table, in the order in which it is placed."""

    objects: Annotated[tuple[SceneObject, ...], Field(min_length=1, max_length=24)]

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        seen: set[str] = set()
        for thing in self.objects:
            for anchor in (thing.place.beside, thing.place.on):
                if anchor is not None and anchor not in seen:
                    raise ValueError(f"{thing.name}: {anchor!r} must be listed before it")
            if thing.name in seen:
                raise ValueError(f"two objects are named {thing.name!r}")
            seen.add(thing.name)
        return self


def read_yaml(path: Path) -> dict[str, Any]:
    """The mapping a YAML file holds; UsageError where there is none, naming file and line."""
    try:
        data = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise UsageError(f"Can't read {path}: {error.strerror or error}.") from error
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise UsageError(f"{path} is not valid YAML: {error}") from error
    if not isinstance(data, dict):
        raise UsageError(f"{path} should hold a mapping (docs/scenes.md shows one), not {type(data).__name__}.")
    return data


def describe_validation(error: ValidationError) -> str:
    """A pydantic error as one line: where, what."""
    return "; ".join(f"{'.'.join(map(str, e['loc'])) or 'file'}: {e['msg']}" for e in error.errors()[:5])


@dataclass(frozen=True)
class Placement:
    """Where one object was put: its model and its pose on the table."""

    name: str
    model: ObjectModel
    xy: FloatArray
    """(2,) m, base frame."""
    yaw: float
    """rad."""
    z: float
    """m, height of the body origin."""
    on: str | None = None

    def corners(self, margin: float = 0.0) -> FloatArray:
        """(4, 2) corners of the footprint, grown by `margin`, counter-clockwise."""
        half = np.asarray(self.model.extent[:2]) / 2 + margin
        signs = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
        return (signs * half) @ rotation_z(self.yaw)[:2, :2].T + self.xy


def overlap(a: Placement, b: Placement, clearance: float = 0.0) -> bool:
    """Whether two footprints come closer than `clearance` (separating axes of the two rectangles)."""
    corners_a, corners_b = a.corners(clearance / 2), b.corners(clearance / 2)
    for yaw in (a.yaw, b.yaw):
        axes = rotation_z(yaw)[:2, :2]
        pa, pb = corners_a @ axes, corners_b @ axes
        if (pa.max(0) < pb.min(0)).any() or (pb.max(0) < pa.min(0)).any():
            return False
    return True


def within_reach(xy: FloatArray) -> bool:
    """Whether a top-down grasp at (x, y) is within the arm's comfortable reach."""
    return REACH_RADIUS[0] <= float(np.hypot(*xy)) <= REACH_RADIUS[1]


def place_objects(scene: Scene, rng: np.random.Generator, tries: int = 200) -> tuple[Placement, ...]:
    """One layout of the scene.

    Whole layouts are drawn afresh until one fits, so that early objects don't crowd out later ones for good.

    Raises
    ------
    UsageError
        Where no layout fits within `tries`: too many objects, or fixed places that overlap or lie out of reach.

    """
    problem = ""
    for _ in range(tries):
        placed: dict[str, Placement] = {}
        for thing in scene.objects:
            for candidate in _candidates(thing, placed, rng):
                problem = _conflict(candidate, placed)
                if not problem:
                    placed[thing.name] = candidate
                    break
            else:
                break
        else:
            return tuple(placed.values())
    raise UsageError(f"The scene does not fit on the table: {problem}. Use fewer objects or larger regions.")


def _candidates(thing: SceneObject, placed: Mapping[str, Placement], rng: np.random.Generator) -> Iterator[Placement]:
    """Up to 40 draws of one object's pose; a single one where nothing is drawn."""
    place, model = thing.place, thing.model()
    fixed_xy = place.at is not None or place.beside is not None or place.on is not None
    for _ in range(1 if fixed_xy and not isinstance(place.yaw, tuple) else 40):
        z = model.rest_z
        if place.on is not None:
            below = placed[place.on]
            xy, z = below.xy, below.z - below.model.rest_z + below.model.surface_z + model.rest_z
        elif place.beside is not None:
            xy = placed[place.beside].xy + np.asarray(place.offset)
        elif place.at is not None:
            xy = np.asarray(place.at)
        else:
            xy = np.array([rng.uniform(*place.region.x), rng.uniform(*place.region.y)])
        degrees = rng.uniform(*place.yaw) if isinstance(place.yaw, tuple) else place.yaw
        yield Placement(thing.name, model, xy, float(np.radians(degrees)), z, place.on)


def _conflict(candidate: Placement, placed: Mapping[str, Placement]) -> str:
    """Why a placement is not possible; empty where it is."""
    if not within_reach(candidate.xy):
        x, y = candidate.xy
        return f"{candidate.name} at ({x:.2f}, {y:.2f}) is out of reach ({REACH_RADIUS[0]} to {REACH_RADIUS[1]} m)"
    for other in placed.values():
        if other.name != candidate.on and overlap(candidate, other, CLEARANCE):
            return f"{candidate.name} overlaps {other.name}"
    return ""
