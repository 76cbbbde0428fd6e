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
Param = bool | int | float | str

REACH_RADIUS = (0.19, 0.42)
"""m from the base axis, within which a top-down grasp at table height is always possible."""
REACH_Y = (-0.24, 0.24)
REACH_X = (0.15, 0.40)
CLEARANCE = 0.025
"""m kept free between objects, so that the fingers fit between them."""
DRAWS = 5000
"""Poses drawn before a scene is given up: half a second of trying."""
DRAWS_EACH = 40
"""Poses drawn for one object before the whole layout is begun afresh."""


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
    params: Mapping[str, Param | tuple[Param, ...]] = {}
    """Passed to the library, e.g. {size: 0.03, colour: yellow} for a block."""
    place: Place = Place()

    @field_validator("kind")
    @classmethod
    def _known(cls, kind: str) -> str:
        if kind not in object_names():
            raise ValueError(f"no object kind {kind!r}; the library has {', '.join(object_names())}")
        return kind

    @model_validator(mode="after")
    def _can_be_made(self) -> Self:
        if self.params:  # without any, nothing can be wrong, and making one takes its time
            try:
                self.model()
            except UsageError as error:
                raise ValueError(str(error)) from error
        return self

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


class _Loader(yaml.SafeLoader):
    """Safe YAML in which `on` is a word, as in YAML 1.2, not a boolean: scenes put things `on` things."""

    yaml_implicit_resolvers = {  # noqa: RUF012 - PyYAML's own declaration
        first: [(tag, form) for tag, form in resolvers if not (first in "oO" and tag == "tag:yaml.org,2002:bool")]
        for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
    }


def read_yaml(path: Path) -> dict[str, Any]:
    """The mapping a YAML file holds; UsageError where there is none, naming file and line."""
    try:
        data = yaml.load(path.read_text(encoding="utf-8"), _Loader)  # noqa: S506 - a SafeLoader
    except OSError as error:
        raise UsageError(f"Can't read {path}: {error.strerror or error}.") from error
    except (yaml.YAMLError, ValueError) as error:  # ValueError: bytes that are no text, dates that don't exist
        raise UsageError(f"{path} is not valid YAML: {error}") from error
    if not isinstance(data, dict):
        raise UsageError(f"{path} should hold a mapping (docs/scenes.md shows one), not {type(data).__name__}.")
    return data


def describe_validation(error: ValidationError) -> str:
    """A pydantic error as one line: where, what."""
    errors = error.errors()
    # A list with a bad item counts as too short as well; the item alone is worth telling.
    outer = {e["loc"][:depth] for e in errors for depth in range(len(e["loc"]))}
    return "; ".join(
        f"{'.'.join(map(str, e['loc'])) or 'file'}: {e['msg'].removeprefix('Value error, ')}"
        for e in [e for e in errors if e["loc"] not in outer][:5]
    )


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

    @property
    def half_diagonal(self) -> float:
        """m, from the middle of the footprint to its corners."""
        return float(np.hypot(*self.model.extent[:2])) / 2

    def corners(self, margin: float = 0.0) -> FloatArray:
        """(4, 2) corners of the footprint, grown by `margin`, counter-clockwise."""
        half = np.asarray(self.model.extent[:2]) / 2 + margin
        signs = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
        return (signs * half) @ rotation_z(self.yaw)[:2, :2].T + self.xy


def overlap(a: Placement, b: Placement, clearance: float = 0.0) -> bool:
    """Whether two footprints come closer than `clearance` (separating axes of the two rectangles)."""
    if np.hypot(*(a.xy - b.xy)) > a.half_diagonal + b.half_diagonal + 2 * clearance:
        return False
    corners_a, corners_b = a.corners(clearance / 2), b.corners(clearance / 2)
    for yaw in (a.yaw, b.yaw):
        axes = rotation_z(yaw)[:2, :2]
        pa, pb = corners_a @ axes, corners_b @ axes
        if (pa.max(0) < pb.min(0)).any() or (pb.max(0) < pa.min(0)).any():
            return False
    return True


def within_reach(xy: FloatArray) -> bool:
    """Whether a top-down grasp at (x, y) is within the arm's comfortable reach, in front of the robot."""
    return float(xy[0]) >= 0.0 and REACH_RADIUS[0] <= float(np.hypot(*xy)) <= REACH_RADIUS[1]


def place_objects(scene: Scene, rng: np.random.Generator, draws: int = DRAWS) -> tuple[Placement, ...]:
    """One layout of the scene.

    Whole layouts are drawn afresh until one fits, so that early objects don't crowd out later ones for good.

    Raises
    ------
    UsageError
        Where `draws` poses give no layout: too many objects, or fixed places that overlap or lie out of reach.

    """
    while True:
        placed: dict[str, Placement] = {}
        for thing in scene.objects:
            for candidate in _candidates(thing, placed, rng):
                draws -= 1
                problem = _conflict(candidate, placed)
                if not problem:
                    placed[thing.name] = candidate
                    break
            else:
                break
        else:
            return tuple(placed.values())
        if draws <= 0:
            raise UsageError(f"The scene does not fit on the table: {problem}. Use fewer objects or larger regions.")


def _candidates(thing: SceneObject, placed: Mapping[str, Placement], rng: np.random.Generator) -> Iterator[Placement]:
    """Up to `DRAWS_EACH` draws of one object's pose; a single one where nothing is drawn."""
    place, model = thing.place, thing.model()
    fixed_xy = place.at is not None or place.beside is not None or place.on is not None
    for _ in range(1 if fixed_xy and not isinstance(place.yaw, tuple) else DRAWS_EACH):
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
        low, high = REACH_RADIUS
        return f"{candidate.name} at ({x:.2f}, {y:.2f}) is out of reach ({low} to {high} m, in front of the robot)"
    beneath = set(_supports(candidate, placed))
    for other in placed.values():
        if other.name not in beneath and overlap(candidate, other, CLEARANCE):
            return f"{candidate.name} overlaps {other.name}"
    return ""


def _supports(candidate: Placement, placed: Mapping[str, Placement]) -> Iterator[str]:
    """The names of what a placement stands on, down to the table."""
    below = candidate.on
    while below is not None:
        yield below
        below = placed[below].on
