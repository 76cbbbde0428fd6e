"""`maniagent collect`: demonstrations without a hand on the scene."""

from __future__ import annotations

import math
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .common import Json, errors_told

if TYPE_CHECKING:
    from ..data.summary import Summary


_DONE, _STARTS = "What is carried out", "Where it starts, and what counts"
_RECORDED, _RUNS = "What is recorded", "How it runs"


def collect(
    task: Annotated[str, typer.Argument(help="A task (`maniagent tasks` lists them), or a scene file.")],
    count: Annotated[
        int | None, typer.Option("-n", "--count", min=1, help="Valid episodes wanted.", show_default="100")
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder of the collection.")] = Path("runs/collection"),
    resume: Annotated[
        bool,
        typer.Option("--resume", help="Go on with what is in the folder, as it was begun; only -n, if given, changes."),
    ] = False,
    workers: Annotated[
        int, typer.Option(min=1, max=256, help="Processes, each with a table of its own.", rich_help_panel=_RUNS)
    ] = 1,
    seed: Annotated[int, typer.Option(min=0, help="Fixes layouts, starts and the cameras' noise.")] = 0,
    do: Annotated[
        str | None,
        typer.Option(
            help="What is carried out, as a plain command, if it isn't the instruction itself.", rich_help_panel=_DONE
        ),
    ] = None,
    run: Annotated[
        Path | None,
        typer.Option(
            "--from",
            help="Carried out is what was done in this run folder, by whatever model.",
            metavar="RUN",
            rich_help_panel=_DONE,
        ),
    ] = None,
    call: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=OTHER",
            help="What an object of that run is to be called; may be repeated.",
            rich_help_panel=_DONE,
        ),
    ] = None,
    say: Annotated[
        list[str] | None,
        typer.Option(
            help="Another way to say the instruction, for the labels; may be repeated.", rich_help_panel=_RECORDED
        ),
    ] = None,
    say_file: Annotated[Path | None, typer.Option(help="More of them, one a line.", rich_help_panel=_RECORDED)] = None,
    texts: Annotated[
        str,
        typer.Option(
            help="What each row says is being done: the subtask, or the single move of it.", rich_help_panel=_RECORDED
        ),
    ] = "subtask",
    pattern: Annotated[
        str,
        typer.Option(help="How starts follow each other: sobol, random, grid, shuffled-grid.", rich_help_panel=_STARTS),
    ] = "sobol",
    yaw: Annotated[
        float | None, typer.Option(help="Degrees in which objects start; without it all.", rich_help_panel=_STARTS)
    ] = None,
    x: Annotated[
        tuple[float, float] | None,
        typer.Option(help="Bounds on where objects start, m, base frame.", rich_help_panel=_STARTS),
    ] = None,
    y: Annotated[tuple[float, float] | None, typer.Option(help="Likewise.", rich_help_panel=_STARTS)] = None,
    reset: Annotated[
        str,
        typer.Option(
            help="Who brings the object back: the robot, or teleport, which only simulation has.",
            rich_help_panel=_STARTS,
        ),
    ] = "robot",
    threshold: Annotated[
        float,
        typer.Option(
            min=0.001, max=0.2, help="m from its place within which an object has arrived.", rich_help_panel=_STARTS
        ),
    ] = 0.03,
    attempts: Annotated[int, typer.Option(min=1, max=10, help="At each start.", rich_help_panel=_STARTS)] = 2,
    fps: Annotated[float, typer.Option(min=1, max=50, help="Rows a second.", rich_help_panel=_RECORDED)] = 10.0,
    width: Annotated[int, typer.Option(min=16, help="px of recorded pictures.", rich_help_panel=_RECORDED)] = 320,
    height: Annotated[int, typer.Option(min=16, help="px", rich_help_panel=_RECORDED)] = 240,
    depth: Annotated[bool, typer.Option("--depth", help="Record depth as well.", rich_help_panel=_RECORDED)] = False,
    cache: Annotated[
        Path | None,
        typer.Option(
            help="Action sequences that worked (docs/cache.md) are taken from here first.", rich_help_panel=_DONE
        ),
    ] = None,
    when_stuck: Annotated[
        str,
        typer.Option(
            help="Where the robot can't get hold of an object any more: put (simulation puts it back), ask, stop.",
            rich_help_panel=_STARTS,
        ),
    ] = "put",
    ray: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS", help="Let the workers run on this Ray cluster (extra `ray`).", rich_help_panel=_RUNS
        ),
    ] = None,
    batch: Annotated[
        int, typer.Option(min=1, help="Episodes that go into the dataset at a time.", rich_help_panel=_RUNS)
    ] = 25,
    stage_only: Annotated[
        bool,
        typer.Option(
            "--stage-only", help="Leave the episodes staged, for `maniagent data publish`.", rich_help_panel=_RUNS
        ),
    ] = False,
    lerobot_python: Annotated[
        Path | None,
        typer.Option(
            help="A Python that has lerobot, if this one hasn't.",
            envvar="MANIAGENT_LEROBOT_PYTHON",
            rich_help_panel=_RUNS,
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Collect demonstrations: the robot carries the task out, brings the object to the next start, and so on.

    No model is asked: sequences come from the rules, the cache, or a run
    that a model once made, and are bound to every scene. An episode is valid
    when a look finds the object where it was to be. The folder holds a
    LeRobotDataset v3 in dataset/, summary.md, a map of where episodes
    started, and what is doubtful in episodes/quarantine. Stopped or killed,
    the same command goes on; with a larger -n it collects more.

    [bold]Examples[/]

      maniagent collect carrot-on-plate -n 300 --workers 2 --out carrots

      maniagent collect carrot-on-plate -n 500 --out carrots --resume

      maniagent collect hungry --do "put the banana on the plate" -n 50

      maniagent collect menemen --from runs/menemen --call "brown egg=egg"

    Exit status: 0 when there are as many valid episodes as wanted; 2 wrong
    use, missing set-up, a full disk, a robot that needs help; 130 Ctrl-C.
    """
    with errors_told(as_json):
        from ..data.collector import collect as collected
        from ..data.helping import helper_for
        from ..data.lerobot import Writer
        from ..data.progress import CollectProgress
        from ..data.settings import checked_settings, phrases_in, read_calls, resumed_settings
        from ..robots.sampling import Sampling

        if resume:
            settings = resumed_settings(out, task, count)
        else:
            settings = checked_settings(
                task,
                do,
                cache,
                run=run,
                called=read_calls(call or ()),
                count=count or 100,
                seed=seed,
                workers=workers,
                paraphrases=(*(say or ()), *(phrases_in(say_file) if say_file is not None else ())),
                texts=texts,
                pattern=pattern,
                yaw=None if yaw is None else math.radians(yaw),
                x=x,
                y=y,
                reset=reset,
                threshold=threshold,
                attempts=attempts,
                sampling=Sampling(rate=fps, width=width, height=height, depth=depth),
            )
        with (
            nullcontext() if stage_only else Writer(lerobot_python) as writer,
            CollectProgress() as progress,
        ):
            helper = helper_for(when_stuck, progress.paused)
            summary = collected(settings, out, progress, writer, helper=helper, ray=ray, batch=batch)
        _tell(summary, as_json)


def _tell(summary: Summary, as_json: bool) -> None:
    from ..console.output import print_json, print_table
    from ..data.summary import rows

    if as_json:
        print_json(summary.model_dump())
    else:
        print_table(("what", "figure"), rows(summary))
