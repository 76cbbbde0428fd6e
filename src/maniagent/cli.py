"""The command line: parses, calls, prints. What it calls is imported where it is used, so that help is instant."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from . import __version__
from .commands import cache, data, models, prompts, simpler
from .commands.collect import collect
from .commands.common import ACHIEVED, NOT_ACHIEVED, WRONG_USE, Json, errors_told
from .commands.crew import (
    ActorOption,
    BaseUrl,
    CacheOption,
    DetectorOption,
    Llm,
    PromptsOption,
    Vlm,
    crew_from,
)
from .commands.replay import replay

if TYPE_CHECKING:
    from .app import RunOutcome
    from .evaluation.summary import Summary

app = typer.Typer(
    name="maniagent",
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog="Start with [bold]maniagent doctor[/], then [bold]maniagent run --task carrot-on-plate[/].",
)
app.add_typer(cache.app, name="cache")
app.add_typer(data.app, name="data")
app.add_typer(models.app, name="models")
app.add_typer(prompts.app, name="prompts")
app.add_typer(simpler.app, name="simpler")
app.command()(replay)
app.command()(collect)


def main() -> None:
    """Entry point of the `maniagent` command."""
    app()


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"maniagent {__version__}")
        raise typer.Exit(ACHIEVED)


@app.callback()
def root(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version.", is_eager=True, callback=_print_version)
    ] = False,
) -> None:
    """Type an instruction; agents look at the table through RGB-D cameras and move the robot arm until it is done."""


@app.command()
def run(
    instruction: Annotated[
        str | None, typer.Argument(help="What to do, in plain English. Without it: the task's own instruction.")
    ] = None,
    task: Annotated[str | None, typer.Option(help="Name of a task; `maniagent tasks` lists them.")] = None,
    scene: Annotated[Path | None, typer.Option(help="Your own scene, a YAML file (docs/scenes.md).")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Fixes where things lie, camera noise, and all else drawn.")] = 0,
    out: Annotated[
        Path | None,
        typer.Option(help="Run folder; an earlier run in it is replaced.", show_default="runs/TIME-TASK-sSEED"),
    ] = None,
    view: Annotated[bool, typer.Option("--view", help="Open a window and watch; needs a screen.")] = False,
    actor: ActorOption = None,
    vlm: Vlm = None,
    llm: Llm = None,
    base_url: BaseUrl = None,
    detector: DetectorOption = None,
    prompts: PromptsOption = None,
    cache_file: CacheOption = None,
    as_json: Json = False,
) -> None:
    """Carry out one instruction in simulation, from camera images alone.

    [bold]Examples[/]

      maniagent run --task carrot-on-plate

      maniagent run --task spoon-on-towel --seed 7 --out runs/spoon

      maniagent run "put the spoon on the towel" --scene kitchen.yaml

      maniagent run --task hungry --vlm openai:gpt-5 --llm anthropic:claude-sonnet-4-5

      maniagent run --task green-on-yellow --json | jq .achieved

    What is achieved is judged by the task's own check, whatever was said; for an instruction that asks for something
    else, use a scene file.

    Exit status: 0 achieved, 1 not achieved, 2 wrong use or missing set-up, 130 stopped with Ctrl-C.
    """
    with errors_told(as_json):
        from .app import run as run_app
        from .console.folder import default_folder
        from .console.progress import Progress

        crew = crew_from(
            actor, vlm=vlm, llm=llm, base_url=base_url, detector=detector, prompts=prompts, cache=cache_file
        )
        folder = out or default_folder(task or (scene.stem if scene else None), seed)
        with Progress() as progress:
            outcome = run_app(
                instruction, task=task, scene=scene, seed=seed, out=folder, view=view, observers=(progress,), crew=crew
            )
        _tell_outcome(outcome, as_json)
        raise typer.Exit(_status(outcome))


@app.command("eval")
def evaluate(
    suite: Annotated[str, typer.Argument(help="paper8, bridge, tabletop4, tabletop, simpler, or a single task.")],
    episodes: Annotated[int, typer.Option(min=1, help="Episodes for each task and seed.")] = 24,
    seeds: Annotated[int, typer.Option(min=1, help="How many seeds; they count from 0.")] = 3,
    workers: Annotated[int, typer.Option(min=1, help="Episodes that are played at a time.")] = 1,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Folder; an evaluation that was interrupted in it goes on.", show_default="runs/eval-SUITE-ACTOR"
        ),
    ] = None,
    time_limit: Annotated[float, typer.Option(help="Wall seconds an episode may take.")] = 300.0,
    record: Annotated[bool, typer.Option("--record/--no-record", help="Keep a run folder of every episode.")] = True,
    ray: Annotated[str | None, typer.Option(metavar="ADDRESS", help="Play on this Ray cluster (extra `ray`).")] = None,
    published: Annotated[bool, typer.Option("--published", help="Show published figures beside ours.")] = False,
    poses: Annotated[
        str | None, typer.Option(help="Where objects start in simpler: grid (its layouts) or off-grid.")
    ] = None,
    pose_seed: Annotated[int, typer.Option(min=0, help="Draws the poses off the grid.")] = 0,
    actor: ActorOption = None,
    vlm: Vlm = None,
    llm: Llm = None,
    base_url: BaseUrl = None,
    detector: DetectorOption = None,
    prompts: PromptsOption = None,
    cache_file: CacheOption = None,
    as_json: Json = False,
) -> None:
    """Play the tasks of a suite many times and say how often they succeed, with 95 % intervals.

    Killed half-way, the same command goes on where it was. The folder holds results.jsonl, summary.json, summary.md,
    episodes.csv, report.html, workers.log, and a run folder for each episode.

    [bold]Examples[/]

      maniagent eval tabletop --workers 2

      maniagent eval carrot-on-plate --episodes 10 --seeds 1 --no-record --json | jq .average.success

      maniagent eval paper8 --vlm openai:gpt-5 --episodes 5 --seeds 1 --time-limit 900

      maniagent eval simpler --episodes 200 --seeds 1 --poses off-grid --pose-seed 1

    Exit status: 0 when it ran to its end, whatever the success; 2 wrong use or missing set-up; 130 Ctrl-C.
    """
    with errors_told(as_json):
        from .evaluation.poses import Poses
        from .evaluation.progress import EvaluationProgress
        from .evaluation.runner import evaluate as run_evaluation

        crew = crew_from(
            actor, vlm=vlm, llm=llm, base_url=base_url, detector=detector, prompts=prompts, cache=cache_file
        )
        folder = out or Path("runs") / f"eval-{suite}-{crew.name.split()[0]}"
        with EvaluationProgress() as progress:
            summary = run_evaluation(
                suite, out=folder, actor=crew.name, episodes=episodes, seeds=seeds, workers=workers,
                time_limit=time_limit, record=record, ray=ray, published=published, watcher=progress,
                poses=Poses(poses or "grid", pose_seed) if poses is not None or pose_seed else None,
            )  # fmt: skip
        _tell_evaluation(summary, as_json)


@app.command()
def tasks(as_json: Json = False) -> None:
    """List the tasks: name, suite, what is said to the robot, and whether a language model is needed for it."""
    with errors_told(as_json):
        from .console.output import print_json, print_table
        from .tasks import get, names

        listed = [get(name) for name in names()]
        if as_json:
            fields = ("name", "title", "instruction", "suite", "needs_model")
            print_json([{field: getattr(task, field) for field in fields} for task in listed])
            return
        rows = [(task.name, task.suite, task.sayable, "yes" if task.needs_model else "no") for task in listed]
        print_table(("task", "suite", "instruction", "needs a model"), rows)


@app.command()
def gallery(
    out: Annotated[Path, typer.Option(help="The PNG file to write.")] = Path("gallery.png"), as_json: Json = False
) -> None:
    """Draw every object of the library into one picture."""
    with errors_told(as_json):
        from .envs.gallery import render_gallery

        _tell_path(render_gallery(out), as_json)


@app.command()
def report(folder: Annotated[Path, typer.Argument(help="A run folder.")], as_json: Json = False) -> None:
    """Write a run folder's report.html anew, also for a run that was cut short."""
    with errors_told(as_json):
        from .console.report import write_report

        _tell_path(write_report(folder), as_json)


@app.command()
def doctor(as_json: Json = False) -> None:
    """Say what is installed, what renders, what is missing, and the line that fixes it.

    Exit status: 0 where `maniagent run` works here, else 2.
    """
    with errors_told(as_json):
        from .console.output import print_checks, print_json
        from .doctor import examine, works

        checks = examine()
        if as_json:
            print_json({"works": works(checks), "checks": [asdict(check) for check in checks]})
        else:
            print_checks(checks)
        raise typer.Exit(ACHIEVED if works(checks) else WRONG_USE)


def _tell_outcome(outcome: RunOutcome, as_json: bool) -> None:
    from .console.folder import REPORT
    from .console.output import print_json, print_verdict
    from .console.summary import summarise

    if as_json:
        achieved, out = outcome.achieved, outcome.out
        print_json(summarise(outcome.result, task=outcome.task, seed=outcome.seed, achieved=achieved, out=out))
    else:
        print_verdict(outcome.result, outcome.achieved, outcome.out and outcome.out / REPORT)


def _tell_evaluation(summary: Summary, as_json: bool) -> None:
    from .console.output import print_json, print_table
    from .evaluation.runner import REPORT
    from .evaluation.tables import outcome_table, published_table, stage_table

    if as_json:
        print_json(summary.to_plain())
        return
    tables = [outcome_table(summary), stage_table(summary), published_table(summary).columns(3)]
    for table in tables:
        if table.rows:
            print_table(table.head, table.rows)
            typer.echo()
    typer.echo(summary.out / REPORT)


def _tell_path(path: Path, as_json: bool) -> None:
    from .console.output import print_json

    if as_json:
        print_json({"out": str(path)})
    else:
        typer.echo(path)


def _status(outcome: RunOutcome) -> int:
    """What is true decides; where nobody knows, what the agents believe."""
    believed = outcome.result.verdict == "achieved"
    return ACHIEVED if (believed if outcome.achieved is None else outcome.achieved) else NOT_ACHIEVED


if __name__ == "__main__":
    main()
