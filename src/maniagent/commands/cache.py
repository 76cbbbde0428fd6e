"""`maniagent cache`: look at what was learned, remove it, hand it to others."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .common import Json, errors_told

if TYPE_CHECKING:
    from ..agents.cache import CacheStore, Entry

app = typer.Typer(
    no_args_is_help=True,
    help="Sequences that carried out a sub-task before and are used again without asking a model (docs/cache.md).",
)

CachePath = Annotated[
    Path | None, typer.Option("--cache", help="The cache's file.", show_default="actions.sqlite in your data folder")
]
Id = Annotated[int, typer.Argument(help="Number of an entry, as `list` shows it.")]


@app.command("list")
def list_entries(cache: CachePath = None, as_json: Json = False) -> None:
    """List the entries: what was said, the skill, and how often it went well."""
    with errors_told(as_json):
        from ..console.output import print_json, print_table

        entries = _open(cache).entries()
        if as_json:
            print_json([_plain(entry) for entry in entries])
            return
        head = ("id", "found by", "sub-task", "skill", "achieved", "judged")
        print_table(head, [_row(entry) for entry in entries])


@app.command()
def show(number: Id, cache: CachePath = None, as_json: Json = False) -> None:
    """Show one entry with its whole sequence."""
    with errors_told(as_json):
        from ..console.output import print_json, print_table
        from ..errors import UsageError

        store = _open(cache)
        entry = next((entry for entry in store.entries() if entry.id == number), None)
        if entry is None:
            raise UsageError(f"There is no entry {number} in {store.path}; `maniagent cache list` shows them.")
        if as_json:
            print_json(_plain(entry))
            return
        objects = ", ".join(f"{index} {name}" for index, name in enumerate(entry.key.objects))
        judged = f"{entry.successes} times, failed {entry.failures} times, last judged {entry.judged}"
        print_table(
            (printable(entry.key.wording), ""),
            [
                ("found by", entry.key.kind.value),
                ("objects", printable(objects)),
                ("skill", printable(entry.sequence.skill)),
                ("achieved", judged),
                *((f"step {i}", printable(_step(step))) for i, step in enumerate(_plain_steps(entry), 1)),
            ],
        )


@app.command()
def rm(
    numbers: Annotated[list[int], typer.Argument(help="Numbers of entries, as `list` shows them.")],
    cache: CachePath = None,
    as_json: Json = False,
) -> None:
    """Remove entries, all of the named ones or none."""
    with errors_told(as_json):
        from ..console.output import print_json

        _open(cache).remove(numbers)
        if as_json:
            print_json({"removed": numbers})
        else:
            typer.echo(f"Removed {', '.join(map(str, numbers))}.")


@app.command()
def export(
    out: Annotated[Path | None, typer.Argument(help="The JSON file to write; without it: stdout.")] = None,
    cache: CachePath = None,
    as_json: Json = False,
) -> None:
    """Write all entries as JSON."""
    with errors_told(as_json):
        from ..agents.cache.transfer import export as exported
        from ..console.output import print_json
        from ..errors import UsageError

        text = exported(_open(cache))
        if out is None:
            typer.echo(text)
            return
        try:
            out.write_text(text + "\n", encoding="utf-8")
        except OSError as error:
            raise UsageError(f"{out} can't be written: {error.strerror}.") from error
        if as_json:
            print_json({"out": str(out)})
        else:
            typer.echo(out)


@app.command("import")
def import_(
    file: Annotated[Path, typer.Argument(help="A file that `export` wrote.")],
    cache: CachePath = None,
    as_json: Json = False,
) -> None:
    """Add exported entries; what the cache holds already stays as it is.

    A file is refused as a whole where any of its entries could not have been written by `export`.
    """
    with errors_told(as_json):
        from ..agents.cache import CacheStore, default_path
        from ..agents.cache.transfer import import_file
        from ..console.output import print_json

        added, known = import_file(CacheStore(cache or default_path()), file)
        if as_json:
            print_json({"added": added, "known": known})
        else:
            typer.echo(f"{added} added, {known} known before.")


def printable(text: str) -> str:
    """A text of somebody else's for a terminal: what could command the terminal is replaced."""
    return "".join(character if character.isprintable() else "�" for character in text)


def _open(path: Path | None) -> CacheStore:
    """The user's own cache is there even before anything was learned; a named one must be."""
    from ..agents.cache import CacheStore, default_path

    return CacheStore(default_path()) if path is None else CacheStore(path, must_exist=True)


def _plain(entry: Entry) -> dict[str, object]:
    from ..agents.cache.transfer import plain

    return {"id": entry.id} | plain(entry)


def _row(entry: Entry) -> tuple[str, ...]:
    said = (entry.key.kind.value, printable(entry.key.wording), printable(entry.sequence.skill))
    share = f"{entry.successes} of {entry.successes + entry.failures}"
    return (str(entry.id), *said, share, entry.judged[:10])


def _plain_steps(entry: Entry) -> list[dict[str, object]]:
    return [step.model_dump(mode="json", exclude_defaults=True) for step in entry.sequence.steps]


def _step(step: dict[str, object]) -> str:
    """A step in one line: what it is for, then whatever differs from the defaults."""
    rest = "  ".join(f"{name} {value}" for name, value in step.items() if name != "description")
    return f"{step['description']}  ({rest})"
