"""What the tests of models share: a small question, and a model that is asked it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from maniagent.models.chat import LiveModel
from maniagent.models.exchange import Exchange
from maniagent.models.opening import open_model
from maniagent.models.patience import Patience
from maniagent.models.question import Picture, Question, Unfit


class Spot(BaseModel):
    """Where something is."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: str = Field(max_length=40)
    x: float = Field(ge=-2.0, le=2.0)
    tags: list[str] = Field(default_factory=list)


GOOD = '{"name": "cup", "x": 0.25, "tags": []}'
CUP = Spot(name="cup", x=0.25)
QUICK = Patience(timeout=30.0, first_wait=0.01, retries=2, repairs=1)
KEY = "sk-very-secret-0123456789"


def no_check(_: Spot) -> None:
    """Everything is fine."""


def refuse_cups(spot: Spot) -> None:
    if spot.name == "cup":
        raise Unfit("There is no cup.")


def picture(shade: int = 0) -> Picture:
    return Picture("main", np.full((6, 8, 3), shade, np.uint8))


def question(text: str = "Where is it?", role: str = "scene", check: Any = no_check, shade: int = 0) -> Question[Spot]:
    return Question(role, "You look.", (text, picture(shade)), Spot, check)


@contextmanager
def opened(name: str, **options: Any) -> Iterator[tuple[LiveModel, list[Exchange]]]:
    """A live model, and the exchanges it tells of."""
    exchanges: list[Exchange] = []
    model = open_model(name, **({"patience": QUICK, "on_exchange": exchanges.append} | options))
    try:
        yield model, exchanges
    finally:
        model.close()
