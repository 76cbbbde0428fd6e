"""`maniagent data`: look at a LeRobot dataset, ours or anybody's; what makes datasets is in datasets.py."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from . import export
from .cache import printable
from .common import ACHIEVED, NOT_ACHIEVED, Json, errors_told
from .datasets import merge, publish, split

if TYPE_CHECKING:
    from ..data.dataset.findings import Check, Report
    from ..data.dataset.summary import DatasetSummary

app = typer.Typer(
    no_args_is_help=True, help="Look at LeRobot datasets (v3), ours or anybody's, and make them (docs/data.md)."
)

Folder = Annotated[
    Path, typer.Argument(metavar="DATASET", help="The dataset's folder, which holds meta, data, videos.")
]


@app.command()
def verify(
    dataset: Folder,
    deep: Annotated[bool, typer.Option("--deep", help="Decode every picture, not only the first and last.")] = False,
    as_json: Json = False,
) -> None:
    """Check a dataset from its files to its numbers and pictures: what is wrong, where, and what to do.

    [bold]Examples[/]

      maniagent data verify runs/carrots/dataset

      maniagent data verify runs/carrots/dataset --deep --json | jq .problems

    Exit status: 0 nothing is wrong (there may be warnings), 1 something is wrong, 2 no dataset there.
    """
    with errors_told(as_json):
        from ..console.output import print_json
        from ..data.dataset.progress import VerifyProgress
        from ..data.dataset.verifying import verify as verify_dataset

        with VerifyProgress() as progress:
            report = verify_dataset(dataset, deep=deep, on_progress=progress)
        if as_json:
            print_json(report.to_plain())
        else:
            _tell_report(report)
        raise typer.Exit(ACHIEVED if report.sound else NOT_ACHIEVED)


@app.command()
def stats(dataset: Folder, as_json: Json = False) -> None:
    """Sum a dataset up: episodes, tasks, lengths, the range of every dimension, cameras, sizes, labels."""
    with errors_told(as_json):
        from ..console.output import print_json
        from ..data.dataset.reading import Dataset
        from ..data.dataset.summary import summarise

        summary = summarise(Dataset.open(dataset))
        if as_json:
            print_json(summary.to_plain())
        else:
            _tell_summary(summary)


@app.command()
def view(
    dataset: Folder,
    episode: Annotated[
        list[int] | None,
        typer.Option("--episode", "-e", min=0, help="An episode's number; repeatable.", show_default="a few, spread"),
    ] = None,
    moments: Annotated[int, typer.Option(min=2, max=12, help="Pictures of each episode.")] = 6,
    camera: Annotated[str | None, typer.Option(help="Camera of the contact sheet.", show_default="the first")] = None,
    out: Annotated[Path | None, typer.Option(help="Folder for the pictures.", show_default="view-DATASET")] = None,
    as_json: Json = False,
) -> None:
    """Draw a contact sheet of a dataset, and the curves of its states and actions, as PNG files.

    [bold]Examples[/]

      maniagent data view runs/carrots/dataset

      maniagent data view runs/carrots/dataset -e 3 -e 17 --moments 8 --out pictures
    """
    with errors_told(as_json):
        from ..console.output import print_json
        from ..data.dataset.reading import Dataset
        from ..data.dataset.view import view as view_dataset

        opened = Dataset.open(dataset)
        folder = out or Path(f"view-{dataset.resolve().name}")
        written = view_dataset(opened, folder, episodes=episode or None, moments=moments, camera=camera)
        if as_json:
            print_json({"out": str(folder), "pictures": [str(path) for path in written]})
        else:
            for path in written:
                typer.echo(path)


def _tell_report(report: Report) -> None:
    from rich.console import Console
    from rich.text import Text

    from ..console.output import print_table

    marks = {"passed": ("✓", "green"), "warned": ("!", "yellow"), "failed": ("✗", "bold red"), "skipped": ("–", "dim")}
    print_table(
        ("check", "", ""),
        [(check.name, Text(*marks[check.outcome]), check.skipped or check.question) for check in report.checks],
    )
    console = Console()
    for check in report.checks:
        _tell_findings(check)
    wrong = f"{report.problems} problem{'s' * (report.problems != 1)}"
    doubtful = f"{report.warnings} warning{'s' * (report.warnings != 1)}"
    style = "bold red" if report.problems else "yellow" if report.warnings else "bold green"
    console.print(Text(f"\n{wrong}, {doubtful}: {report.path}", style=style), soft_wrap=True)


def _tell_findings(check: Check) -> None:
    from rich.console import Console
    from rich.text import Text

    console = Console()
    for finding in check.findings:
        word, style = ("problem", "bold red") if finding.is_problem else ("warning", "yellow")
        said = f" {printable(finding.where)}: {printable(finding.what)}"
        todo = f"  {printable(finding.todo)}" if finding.todo else ""
        console.print(Text.assemble((f"{word}:", style), said, (todo, "dim")), soft_wrap=True)
    if check.more:
        console.print(Text(f"and {check.more} more of {check.name}", style="dim"))


def _tell_summary(summary: DatasetSummary) -> None:
    from ..console.output import print_table

    for head, rows in _tables(summary):
        if rows:
            print_table(head, [[printable(cell) for cell in row] for row in rows])
            typer.echo()


def _tables(summary: DatasetSummary) -> Iterator[tuple[tuple[str, ...], list[tuple[str, ...]]]]:
    """A summary as tables: headings and rows."""
    spans = "  ".join(f"{name} {frames:g}" for name, frames in summary.lengths.items())
    yield (
        ("dataset", summary.path),
        [
            ("robot", summary.robot),
            ("episodes", f"{summary.episodes}"),
            ("frames", f"{summary.frames} at {summary.fps:g} a second: {summary.seconds / 60:.1f} min"),
            ("frames of an episode", spans),
            ("size", "  ".join(f"{name} {size / 1e6:.1f} MB" for name, size in summary.bytes.items())),
            *_labels(summary),
        ],
    )
    yield ("task", "episodes"), [(text, str(count)) for text, count in summary.tasks.items()]
    yield ("sub-task", "frames"), [(text or "(none)", str(count)) for text, count in summary.subtasks.items()]
    yield (
        ("camera", "pictures", "codec", "files", "size"),
        [
            (c.name, f"{c.width} x {c.height}", f"{c.codec} {c.pixel_format}", str(c.files), f"{c.bytes / 1e6:.1f} MB")
            for c in summary.cameras
        ],
    )
    yield (
        ("feature", "dimension", "min", "mean", "max", "std"),
        [
            (d.feature, d.name, *(f"{value:.4g}" for value in (d.low, d.mean, d.high, d.std)))
            for d in summary.dimensions
        ],
    )


def _labels(summary: DatasetSummary) -> Iterator[tuple[str, str]]:
    labels = summary.labels
    if labels is None:
        return
    yield "labels", "  ".join(f"{name} {count}" for name, count in labels.counts.items())
    yield "attempts", "  ".join(f"{number}: {count}" for number, count in labels.attempts.items())
    yield "interventions", str(labels.interventions)
    for name, share in (("precision", labels.precision), ("recall", labels.recall)):
        if share is not None:
            yield f"label {name}", f"{100 * share:.1f} % by the simulator's truth on {labels.judged} episodes"


for _command in (publish, merge, split):
    app.command()(_command)
app.add_typer(export.app, name="export")
