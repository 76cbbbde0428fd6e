"""`maniagent models`: which language models there are for the agents, and whether one is fit."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated

import typer

from .common import ACHIEVED, NOT_ACHIEVED, WRONG_USE, Json, errors_told

if TYPE_CHECKING:
    from ..models.check import Finding, Verdict
    from ..models.names import Provider

app = typer.Typer(no_args_is_help=True, help="Language models: which providers there are, and whether a model is fit.")


@app.command("list")
def list_providers(as_json: Json = False) -> None:
    """List the providers: how their models are named, which key they want, and where they are served."""
    with errors_told(as_json):
        import os

        from ..console.output import print_json, print_table
        from ..models.names import PROVIDERS

        found = [
            (name, provider, next((key for key in provider.keys if os.environ.get(key)), None))
            for name, provider in PROVIDERS.items()
        ]
        if as_json:
            print_json(
                [
                    {"provider": name, "keys": provider.keys, "key_found": key, "base_url": provider.base_url}
                    for name, provider, key in found
                ]
            )
            return
        rows = [
            (
                name,
                key or provider.keys[0],
                "found" if key else "optional" if provider.own else "not set",
                _where(provider),
            )
            for name, provider, key in found
        ]
        print_table(("provider", "key", "", "served at"), rows)


@app.command()
def check(
    model: Annotated[str, typer.Argument(help="PROVIDER:MODEL, or PROVIDER:MODEL@URL.")],
    base_url: Annotated[
        str | None, typer.Option(metavar="URL", help="Where it is served, e.g. http://127.0.0.1:8080/v1.")
    ] = None,
    timeout: Annotated[float, typer.Option(min=1.0, help="Seconds that each answer may take.")] = 60.0,
    as_json: Json = False,
) -> None:
    """Ask a model a few small questions: does it answer, keep to a form, see pictures, and how fast is it.

    [bold]Examples[/]

      maniagent models check openai:gpt-5

      maniagent models check vllm:Qwen/Qwen3-VL-8B-Instruct@http://gpu:8000/v1

    Exit status: 0 fit for all agents; 1 it answers, but can't serve as the VLM; 2 out of reach, or wrong use.
    """
    with errors_told(as_json):
        from ..console.output import print_json
        from ..models.check import check_model
        from ..models.settings import load_settings

        settings = load_settings()
        watcher = _ignore if as_json else _print_finding
        address = base_url or settings.base_url_for(model)
        verdict = check_model(model, address, output=settings.output, timeout=timeout, on_finding=watcher)
        if as_json:
            print_json(_plain(verdict))
        else:
            _print_verdict(verdict)
        if not verdict.reachable:
            raise typer.Exit(WRONG_USE)
        raise typer.Exit(ACHIEVED if verdict.serves_as_vlm else NOT_ACHIEVED)


def _plain(verdict: Verdict) -> dict[str, object]:
    return {
        "model": verdict.model,
        "reachable": verdict.reachable,
        "llm": verdict.serves_as_llm,
        "vlm": verdict.serves_as_vlm,
        "mode": verdict.mode,
        "latency": verdict.latency,
        "tokens_per_second": verdict.tokens_per_second,
        "findings": [asdict(finding) for finding in verdict.findings],
    }


def _ignore(_: Finding) -> None:
    """Findings are told in the end, all at once."""


def _print_finding(finding: Finding) -> None:
    from rich.console import Console
    from rich.text import Text

    mark, style = ("✓", "green") if finding.ok else ("✗", "bold red")
    Console().print(Text.assemble((mark, style), f" {finding.name:10}{finding.detail}"), soft_wrap=True)


def _print_verdict(verdict: Verdict) -> None:
    if not verdict.reachable:
        return
    match verdict.serves_as_llm, verdict.serves_as_vlm:
        case True, True:
            serves = "Serves as VLM and LLM"
        case True, False:
            serves = "Serves as LLM only"
        case _:
            serves = "Serves as neither: its answers don't fit"
    latency = f"; {verdict.latency:.1f} s for a short answer" if verdict.latency is not None else ""
    speed = f"; {verdict.tokens_per_second:.0f} tokens/s" if verdict.tokens_per_second is not None else ""
    typer.echo(f"{serves}{latency}{speed}.")


def _where(provider: Provider) -> str:
    return provider.base_url or ("@URL" if provider.own else "its own address")
