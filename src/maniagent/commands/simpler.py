"""`maniagent simpler`: the benchmark's set-up, and single episodes of it."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from .common import ACHIEVED, NOT_ACHIEVED, WRONG_USE, Json, errors_told

app = typer.Typer(no_args_is_help=True, help="SimplerEnv: set it up, play single episodes (docs/simplerenv.md).")

Poses = Annotated[str, typer.Option(help="Where objects start: grid (the benchmark's layouts) or off-grid.")]
PoseSeed = Annotated[int, typer.Option(min=0, help="Draws the poses off the grid.")]


@app.command()
def setup(
    assets: Annotated[
        Path | None, typer.Option(help="Folder of the assets.", show_default="MS_ASSET_DIR, or ~/.maniskill")
    ] = None,
    download: Annotated[
        bool, typer.Option("--download/--no-download", help="Fetch missing assets with ManiSkill's downloader.")
    ] = True,
    as_json: Json = False,
) -> None:
    """Say what SimplerEnv needs and what is there, fetch its assets, and try it.

    [bold]Examples[/]

      maniagent simpler setup

      maniagent simpler setup --assets ~/simpler --no-download --json

    Exit status: 0 where `maniagent eval simpler` works here, else 2.
    """
    with errors_told(as_json):
        from ..console.output import print_checks, print_json
        from ..doctor import works
        from ..simpler_setup import examine

        checks = examine(assets, download)
        if as_json:
            print_json({"works": works(checks), "checks": [asdict(check) for check in checks]})
        else:
            print_checks(checks)
        raise typer.Exit(ACHIEVED if works(checks) else WRONG_USE)


@app.command()
def play(
    task: Annotated[str, typer.Argument(help="simpler-stack, simpler-carrot, simpler-spoon or simpler-eggplant.")],
    episode: Annotated[int, typer.Option(min=0, help="The layout, or the number of the draw off the grid.")] = 0,
    actor: Annotated[str, typer.Option(help="Who carries out the task.")] = "rules",
    poses: Poses = "grid",
    pose_seed: PoseSeed = 0,
    out: Annotated[
        Path | None,
        typer.Option(help="Run folder; an earlier run in it is replaced.", show_default="runs/TASK-eEPISODE"),
    ] = None,
    as_json: Json = False,
) -> None:
    """Play one episode as `maniagent eval simpler` does, and keep its run folder.

    [bold]Examples[/]

      maniagent simpler play simpler-carrot --episode 7

      maniagent simpler play simpler-spoon --episode 31 --poses off-grid --pose-seed 5 --json | jq .criteria

    Exit status: 0 success within the registered steps, 1 none, 2 wrong use or missing set-up.
    """
    with errors_told(as_json):
        from ..console.folder import REPORT
        from ..console.output import print_json, print_table
        from ..evaluation.poses import Poses as Placing
        from ..evaluation.simpler import play as play_episode

        folder = out or Path("runs") / f"{task}-e{episode:03d}"
        result = play_episode(task, episode, actor=actor, out=folder, poses=Placing(poses, pose_seed))
        if as_json:
            print_json(result.model_dump(mode="json") | {"folder": str(folder)})
        else:
            verdicts = {"success": result.success, **result.criteria}
            rows = [(name, "yes" if true else "no") for name, true in verdicts.items()]
            print_table(("", task), [*rows, ("steps", str(result.steps)), ("reason", result.reason)])
            typer.echo(folder / REPORT)
        raise typer.Exit(ACHIEVED if result.success else NOT_ACHIEVED)
