"""`maniagent data publish|merge|split`: make LeRobot datasets, with whichever Python has lerobot."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..errors import UsageError
from .common import Json, errors_told

LerobotPython = Annotated[
    Path | None,
    typer.Option(
        "--lerobot-python", metavar="PYTHON", help="An interpreter that has lerobot.",
        show_default="$MANIAGENT_LEROBOT_PYTHON, else this one",
    ),
]  # fmt: skip


def publish(
    collection: Annotated[Path, typer.Argument(help="Folder of a collection; it holds `episodes`.")],
    batch: Annotated[int, typer.Option(min=1, help="Episodes that are added at a time.")] = 25,
    lerobot_python: LerobotPython = None,
    as_json: Json = False,
) -> None:
    """Move a collection's staged episodes into its dataset.

    For a collection that was killed and isn't to go on, say: `maniagent collect` does this by itself.
    """
    with errors_told(as_json):
        from ..console.output import print_json
        from ..data.lerobot import Writer
        from ..data.lerobot import publish as publish_episodes

        with Writer(lerobot_python) as writer:
            done = publish_episodes(collection, writer=writer, batch=batch)
        if as_json:
            print_json({"dataset": str(done.dataset), "added": done.added, "episodes": done.total})
        else:
            typer.echo(f"{done.dataset}: {done.added} episodes added, {done.total} in all")


def merge(
    datasets: Annotated[list[Path], typer.Argument(help="Datasets of the same robot, rate, cameras and sizes.")],
    out: Annotated[Path, typer.Option(help="Folder of the new dataset; must not be there yet.")],
    lerobot_python: LerobotPython = None,
    as_json: Json = False,
) -> None:
    """Make one dataset of several; these stay as they are.

    [bold]Example[/]

      maniagent data merge runs/carrots/dataset runs/spoons/dataset --out runs/both
    """
    with errors_told(as_json):
        from ..console.output import print_json
        from ..data.lerobot import Writer
        from ..data.lerobot import merge as merge_datasets

        with Writer(lerobot_python) as writer:
            episodes = merge_datasets(datasets, out, writer=writer)
        if as_json:
            print_json({"dataset": str(out), "episodes": episodes})
        else:
            typer.echo(f"{out}: {episodes} episodes")


def split(
    dataset: Annotated[Path, typer.Argument(help="The dataset to split; it stays as it is.")],
    parts: Annotated[
        list[str], typer.Argument(metavar="NAME=SIZE...", help="A count of episodes (20), or a share of them (0.9).")
    ],
    out: Annotated[Path, typer.Option(help="Folder for the parts' folders; must not be there yet.")],
    seed: Annotated[int, typer.Option(min=0, help="Draws which episode goes where.")] = 0,
    lerobot_python: LerobotPython = None,
    as_json: Json = False,
) -> None:
    """Make several datasets of one, their episodes drawn from all over it.

    [bold]Example[/]

      maniagent data split runs/both train=0.9 val=0.1 --out runs/parts
    """
    with errors_told(as_json):
        from ..console.output import print_json
        from ..data.lerobot import Writer
        from ..data.lerobot import split as split_dataset

        sizes = _sizes(parts)
        with Writer(lerobot_python) as writer:
            made = split_dataset(dataset, sizes, out, writer=writer, seed=seed)
        if as_json:
            print_json({"out": str(out), "episodes": made})
        else:
            for name, episodes in made.items():
                typer.echo(f"{out / name}: {episodes} episodes")


def _sizes(parts: list[str]) -> dict[str, float | int]:
    sizes: dict[str, float | int] = {}
    for part in parts:
        name, _, size = part.partition("=")
        try:
            sizes[name] = int(size) if size.isdecimal() else float(size)
        except ValueError as error:
            raise UsageError(f"{part!r} is no part: write NAME=COUNT or NAME=SHARE, such as train=0.9.") from error
    if len(sizes) < len(parts):
        raise UsageError("Two parts have the same name.")
    return sizes
