"""A worker's table as the robot saw it when the collection began: what its plan of starts depends on."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Self

import numpy as np
from pydantic import BaseModel, ConfigDict, ValidationError

from ..errors import UsageError
from ..motion import ArmModel, MotionLimits
from ..perception.views import Workspace
from ..types import ObjectInfo, OrientedBox
from .disk import write_whole
from .reach import Reach
from .settings import CollectSettings
from .starts import Region


class _Box(BaseModel):
    model_config = ConfigDict(frozen=True)

    centre: tuple[float, float, float]
    extent: tuple[float, float, float]
    yaw: float


class Table(BaseModel):
    """Written down once, so that a collection that goes on keeps its plan, whatever is seen by then."""

    model_config = ConfigDict(frozen=True)

    size: tuple[float, float]
    """m, length and width of the object that is moved."""
    kept_free: tuple[_Box, ...]
    """What else is on the table, base frame."""

    @classmethod
    def seen(cls, moved: ObjectInfo, others: Sequence[ObjectInfo]) -> Self:
        """The table on which these things are seen."""
        boxes = [thing.box for thing in others]
        return cls(
            size=(float(moved.extent[0]), float(moved.extent[1])),
            kept_free=tuple(
                _Box(centre=tuple(box.centre.tolist()), extent=tuple(box.extent.tolist()), yaw=box.yaw) for box in boxes
            ),
        )

    @classmethod
    def load(cls, folder: Path, worker: int) -> Self | None:
        """What is written down in the folder of a collection; None where nothing is.

        Raises UsageError where it can't be read.
        """
        path = _path(folder, worker)
        try:
            return cls.model_validate_json(path.read_bytes())
        except FileNotFoundError:
            return None
        except (OSError, ValidationError) as error:
            what = "it isn't whole" if isinstance(error, ValidationError) else str(error.strerror)
            raise UsageError(f"{path} can't be read: {what}. Remove it, and it is made anew.") from error

    def save(self, folder: Path, worker: int) -> None:
        """Write it down, as a whole or not at all; SetupError where the disk is full."""
        write_whole(_path(folder, worker), self.model_dump_json() + "\n")

    def region(self, settings: CollectSettings) -> Region:
        """Where objects may start on it."""
        return Region(
            Reach(ArmModel(), MotionLimits(), radius=math.hypot(*self.size) / 2),
            Workspace(),
            x=settings.x,
            y=settings.y,
            width=self.size[1],
            kept_free=tuple(OrientedBox(np.array(b.centre), np.array(b.extent), b.yaw) for b in self.kept_free),
        )


def _path(folder: Path, worker: int) -> Path:
    return folder / f"plan-w{worker:02d}.json"
