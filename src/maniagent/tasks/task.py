"""A task: a scene, an instruction, and what counts as success. All data, one YAML file each."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from ..envs.scene import Name, Placement, Region, Scene, SceneObject, describe_validation, read_yaml, within_reach
from ..errors import UsageError
from ..geometry import FloatArray
from .conditions import AnyCondition, At, Truth


class DrawnPoint(Region):
    """A point of the table, drawn afresh for each episode."""

    away_from: Name
    """The object it must not lie at already."""
    distance: Annotated[float, Field(ge=0.0, le=0.4)] = 0.10
    """m it keeps from that object."""


@dataclass(frozen=True)
class Episode:
    """One drawn instance of a task: what is said, and when it is achieved."""

    instruction: str
    success: tuple[AnyCondition, ...]
    points: Mapping[str, FloatArray]

    def achieved(self, truth: Truth) -> bool | None:
        """Whether every condition holds on the true state; None for a scene that states none."""
        if not self.success:
            return None
        return all(condition.holds(truth, self.points) for condition in self.success)


class Task(BaseModel):
    """What a task file holds. A user's own scene needs `objects` alone."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9-]{0,39}$")] = "scene"
    title: str = ""
    suite: str = ""
    needs_model: bool = False
    """The instruction takes common sense, which `rules` doesn't have."""
    instruction: Annotated[str, Field(max_length=500)] = ""
    """May name drawn points in braces: "drag the plate to {goal}"."""
    points: Mapping[Name, DrawnPoint] = {}
    objects: Annotated[tuple[SceneObject, ...], Field(min_length=1, max_length=24)]
    success: tuple[AnyCondition, ...] = ()

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        names = {thing.name for thing in self.scene.objects}
        spoken_of = {name for condition in self.success for name in condition.names()}
        spoken_of |= {point.away_from for point in self.points.values()}
        if missing := spoken_of - names:
            raise ValueError(f"no object is named {', '.join(sorted(missing))}")
        if missing := set(re.findall(r"\{(.*?)\}", self.instruction)) - set(self.points):
            raise ValueError(f"the instruction names points that are not given: {', '.join(sorted(missing))}")
        wanted = {c.point for c in self.success if isinstance(c, At) and isinstance(c.point, str)}
        if missing := wanted - set(self.points):
            raise ValueError(f"no point is named {', '.join(sorted(missing))}")
        return self

    @property
    def sayable(self) -> str:
        """The instruction with coordinates to be drawn as "(x, y)"."""
        return re.sub(r"\{\w+\}", "(x, y)", self.instruction)

    @property
    def scene(self) -> Scene:
        """The objects on the table."""
        return Scene(objects=self.objects)

    def episode(self, layout: Sequence[Placement], rng: np.random.Generator) -> Episode:
        """Draw this episode's points and fill them into the instruction."""
        points = {name: _draw(point, layout, rng) for name, point in self.points.items()}
        said = {name: f"({x:.2f}, {y:.2f})" for name, (x, y) in points.items()}
        instruction = self.instruction
        for name, text in said.items():
            instruction = instruction.replace(f"{{{name}}}", text)
        return Episode(instruction, self.success, points)


def _draw(point: DrawnPoint, layout: Sequence[Placement], rng: np.random.Generator) -> FloatArray:
    start = next(placement.xy for placement in layout if placement.name == point.away_from)
    for _ in range(1000):
        # Rounded to the centimetre that is said in the instruction, where -0.00 would look odd.
        goal = np.round([rng.uniform(*point.x), rng.uniform(*point.y)], 2) + 0.0
        if within_reach(goal) and np.linalg.norm(goal - start) >= point.distance:
            return goal
    raise UsageError(f"No point within {point.x} x {point.y} keeps {point.distance} m from {point.away_from}.")


def load_task(path: Path) -> Task:
    """Read a task or scene file; UsageError says what is wrong with it."""
    data = read_yaml(path)
    try:
        return Task.model_validate(data)
    except ValidationError as error:
        raise UsageError(f"{path}: {describe_validation(error)} (docs/scenes.md explains the format).") from error
