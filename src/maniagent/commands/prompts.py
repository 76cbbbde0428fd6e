"""`maniagent prompts`: which prompts see best."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .common import Json, errors_told
from .crew import BaseUrl, Vlm

if TYPE_CHECKING:
    from ..evaluation.prompts import Scoring

app = typer.Typer(no_args_is_help=True, help="The agents' prompts: which of several sees best (docs/prompts.md).")


@app.command()
def score(
    folders: Annotated[
        list[Path] | None,
        typer.Option("--prompts", help="Folder whose scene.md is tried beside the packaged one; may be repeated."),
    ] = None,
    tasks: Annotated[
        list[str] | None, typer.Option("--task", help="Task to show; may be repeated.", show_default="all")
    ] = None,
    scenes: Annotated[
        list[Path] | None,
        typer.Option("--scene", help="Your own scene with instruction and success (docs/scenes.md); may be repeated."),
    ] = None,
    seeds: Annotated[int, typer.Option(min=1, help="Layouts of each task; seeds count from 0.")] = 2,
    out: Annotated[Path, typer.Option(help="Folder; what an earlier call in it has asked isn't asked again.")] = Path(
        "runs/prompts"
    ),
    vlm: Vlm = None,
    base_url: BaseUrl = None,
    as_json: Json = False,
) -> None:
    """Show scenes to a model with each prompt, and say how much of what matters it names, and how much besides.

    Recall decides, then relevance. Stopped half-way, the same command goes on where it was. The folder holds
    answers.jsonl, exchanges.jsonl, summary.json, summary.md, and pictures of the scenes with misses.

    [bold]Examples[/]

      maniagent prompts score --vlm openai:gpt-5 --prompts mine --prompts shorter

      maniagent prompts score --vlm ollama:qwen2.5vl --task hungry --task write --seeds 5 --json | jq .winner

    Exit status: 0 when it ran to its end, whoever wins; 2 wrong use, missing set-up, a model that can't be asked or a
    budget that is used up; 130 Ctrl-C.
    """
    with errors_told(as_json):
        from contextlib import closing

        from ..evaluation.prompts import load_variants, scenes_of, score_prompts
        from ..evaluation.prompts.answers import claim
        from ..evaluation.prompts.progress import ScoringProgress
        from ..models.opening import open_models
        from ..models.record import ExchangeRecorder
        from ..models.settings import load_settings

        variants = load_variants(folders or ())
        shown = scenes_of(tasks or (), scenes or (), seeds)
        settings = load_settings(vlm=vlm, base_url=base_url)
        claim(out)
        one = settings.vlm or settings.llm
        settings = settings.model_copy(update={"vlm": one, "llm": one})
        with closing(open_models(settings, ExchangeRecorder(out))) as models, ScoringProgress() as progress:
            scoring = score_prompts(models.vlm, variants, shown, out, progress)
        _tell(scoring, as_json)


def _tell(scoring: Scoring, as_json: bool) -> None:
    from ..console.output import print_json, print_table
    from ..evaluation.prompts.report import MARKDOWN, score_table, to_plain, verdict

    if as_json:
        print_json(to_plain(scoring))
        return
    table = score_table(scoring)
    print_table(table.head, table.rows)
    typer.echo(f"\n{verdict(scoring)}")
    typer.echo(scoring.out / MARKDOWN)
