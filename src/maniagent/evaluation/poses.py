"""How the objects of an episode are placed, where a suite leaves that to choose."""

from __future__ import annotations

from dataclasses import dataclass
from zlib import crc32

import numpy as np

from ..errors import UnknownNameError, UsageError

GRID, OFF_GRID = "grid", "off-grid"


@dataclass(frozen=True)
class Poses:
    """On the benchmark's own layouts, or drawn between them."""

    kind: str = GRID
    seed: int = 0
    """Draws the poses off the grid."""

    def __post_init__(self) -> None:
        if self.kind not in (GRID, OFF_GRID):
            raise UnknownNameError("kind of poses", self.kind, (GRID, OFF_GRID))
        if self.seed < 0:
            raise UsageError(f"The pose seed is {self.seed}; it should be 0 or more.")
        if self.kind == GRID and self.seed:
            raise UsageError(f"A pose seed draws poses off the grid. Add --poses {OFF_GRID}.")

    @property
    def on_grid(self) -> bool:
        """Whether they are the benchmark's layouts."""
        return self.kind == GRID

    def __str__(self) -> str:
        return self.kind if self.on_grid else f"{self.kind}, pose seed {self.seed}"

    @property
    def options(self) -> str:
        """As options of a command."""
        return "" if self.on_grid else f" --poses {self.kind} --pose-seed {self.seed}"

    def generator(self, task: str, episode: int) -> np.random.Generator:
        """What draws the poses of one episode: always the same for the same (pose seed, task, episode)."""
        return np.random.default_rng([self.seed, crc32(task.encode()), episode])


ON_GRID = Poses()
