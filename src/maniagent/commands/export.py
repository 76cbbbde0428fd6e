"""`maniagent data export`: datasets in the formats that other trainers read."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated

import typer

from ..errors import UsageError
from .common import Json, errors_told

app = typer.Typer(no_args_is_help=True, help="Write a dataset in the format of another trainer (docs/rlds.md).")


@app.callback()
def _group() -> None:
    """Keep `rlds` a sub-command while it is the only one."""


@app.command()
def rlds(
    dataset: Annotated[Path, typer.Argument(metavar="DATASET", help="A LeRobot dataset that maniagent collected.")],
    out: Annotated[
        Path, typer.Option(help="Folder of the new dataset; its last part is the name, and it must not be there yet.")
    ],
    camera: Annotated[str, typer.Option(help="The camera whose pictures policies see, `image`.")] = "main",
    every: Annotated[
        int, typer.Option(min=1, help="Keep every so-many-th frame: 2 makes 5 steps a second of 10, as Bridge has.")
    ] = 1,
    size: Annotated[
        str | None, typer.Option(metavar="WIDTHxHEIGHT", help="Resize the pictures.", show_default="as recorded")
    ] = None,
    tfds_python: Annotated[
        Path | None,
        typer.Option(
            "--tfds-python", metavar="PYTHON", help="An interpreter that has tensorflow_datasets.",
            show_default="$MANIAGENT_TFDS_PYTHON, else this one",
        ),
    ] = None,
    as_json: Json = False,
) -> None:  # fmt: skip
    """Write an RLDS dataset, on which OpenVLA and CogACT can be fine-tuned, with what to register there.

    [bold]Examples[/]

      maniagent data export rlds runs/carrots/dataset --out rlds/carrots

      maniagent data export rlds runs/carrots/dataset --out rlds/carrots_5hz --every 2 --size 256x256
    """
    with errors_told(as_json):
        from ..console.output import print_json
        from ..data.dataset.progress import VerifyProgress
        from ..data.rlds.episodes import Settings
        from ..data.rlds.export import export_rlds

        settings = Settings(camera, every, _size(size))
        with VerifyProgress() as progress:
            made = export_rlds(dataset, out, settings=settings, python=tfds_python, on_progress=progress)
        if as_json:
            plain = {"dataset": str(made.dataset), "name": made.name, "episodes": made.episodes, "steps": made.steps}
            print_json({**plain, "rate": made.rate, "bytes": made.bytes})
        else:
            typer.echo(f"{made.dataset}: {made.episodes} episodes, {made.steps} steps, {made.bytes / 1e6:.1f} MB")
            typer.echo(f"What to add to OpenVLA or CogACT stands in {made.dataset / 'README.md'}")


def _size(text: str | None) -> tuple[int, int] | None:
    if text is None:
        return None
    found = re.fullmatch(r"([1-9]\d{0,3})x([1-9]\d{0,3})", text)
    if found is None:
        raise UsageError(f"{text!r} is no size: write WIDTHxHEIGHT in pixels, such as 256x256.")
    return int(found[1]), int(found[2])
