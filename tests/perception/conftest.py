from __future__ import annotations

import pytest
from tables import Look, draw

GROUPS = (
    ("red_chili", "eggplant", "strawberry", "block"),
    ("carrot", "banana", "egg", "toy"),
    ("corn", "marker", "knife", "dish"),
    ("spoon", "fork", "plate"),
    ("towel", "basket"),
    ("hand", "green_chili"),
)
"""Every kind of the library once, no more on one table than lie well apart."""


@pytest.fixture(scope="session")
def tables() -> list[Look]:
    """Two looks at every group: every kind of the library twice, each object named by its kind."""
    return [seen for group in GROUPS for seen in draw({kind: kind for kind in group}, seeds=(0, 1))]
