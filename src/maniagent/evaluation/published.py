"""Published figures to put beside ours; data, in published.yaml."""

from __future__ import annotations

from importlib import resources
from typing import Annotated

import yaml
from pydantic import BaseModel, ConfigDict, Field, TypeAdapter


class Published(BaseModel):
    """One published success rate."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    method: str
    benchmark: str
    success: Annotated[float, Field(ge=0, le=100)]
    """Percent."""
    source: str
    """A link; empty where none was looked at, which the caveat then says."""
    caveat: str
    """What is not comparable."""


def published() -> tuple[Published, ...]:
    """All published figures that come with maniagent."""
    text = (resources.files(__package__) / "published.yaml").read_text(encoding="utf-8")
    return TypeAdapter(tuple[Published, ...]).validate_python(yaml.safe_load(text))
