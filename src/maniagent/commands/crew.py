"""The options by which a command is told who carries out instructions."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from ..crew import Crew

_PANEL = "Who carries it out"
ActorOption = Annotated[
    str | None,
    typer.Option(
        "--actor",
        help="rules (no model), or agents on language models.",
        show_default="agents where a model is named, else rules",
        rich_help_panel=_PANEL,
    ),
]
Vlm = Annotated[
    str | None,
    typer.Option(metavar="PROVIDER:MODEL", help="The model that sees.", show_default="the llm", rich_help_panel=_PANEL),
]
Llm = Annotated[
    str | None,
    typer.Option(
        metavar="PROVIDER:MODEL", help="The model that thinks.", show_default="the vlm", rich_help_panel=_PANEL
    ),
]
BaseUrl = Annotated[
    str | None,
    typer.Option(metavar="URL", help="Where models of your own are served.", rich_help_panel=_PANEL),
]
DetectorOption = Annotated[
    str | None,
    typer.Option(
        "--detector",
        help="What finds objects by name (docs/detectors.md).",
        show_default="marks",
        rich_help_panel=_PANEL,
    ),
]
PromptsOption = Annotated[
    Path | None,
    typer.Option("--prompts", help="Folder with prompts of your own (docs/agents.md).", rich_help_panel=_PANEL),
]
CacheOption = Annotated[
    Path | None,
    typer.Option("--cache", help="File of movements that worked before (docs/cache.md).", rich_help_panel=_PANEL),
]


def crew_from(
    actor: str | None,
    *,
    vlm: str | None = None,
    llm: str | None = None,
    base_url: str | None = None,
    detector: str | None = None,
    prompts: Path | None = None,
    cache: Path | None = None,
) -> Crew:
    """The crew that the options mean.

    Raises UsageError and UnknownNameError where they mean none.
    """
    from ..crew import MODELS, ModelCrew, crew_of
    from ..errors import UsageError

    paths = {"prompts": prompts, "cache": cache}
    said = {"vlm": vlm, "llm": llm, "base_url": base_url, "detector": detector}
    said |= {name: str(path.resolve()) for name, path in paths.items() if path is not None}
    said = {name: value for name, value in said.items() if value}
    if not said:
        return crew_of(actor or "rules")
    if actor not in (None, MODELS):
        raise UsageError(f"--{next(iter(said)).replace('_', '-')} is for --actor {MODELS}, not for {actor!r}.")
    return ModelCrew.chosen(**said)
