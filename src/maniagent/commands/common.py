"""What all commands have in common: exit statuses, --json, and how errors are told."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Annotated

import typer

from ..errors import ManiAgentError

ACHIEVED, NOT_ACHIEVED, WRONG_USE, INTERRUPTED = 0, 1, 2, 130
"""Exit statuses."""

Json = Annotated[bool, typer.Option("--json", help="Print one JSON value on stdout and nothing else.")]


@contextmanager
def errors_told(as_json: bool) -> Iterator[None]:
    """Turn what ends a command early into one line, one JSON object where that was asked for, and an exit status."""
    from ..console.output import print_error, print_json

    try:
        yield
    except ManiAgentError as error:
        message, status = str(error), WRONG_USE
    except KeyboardInterrupt:
        message, status = "Stopped with Ctrl-C.", INTERRUPTED
    else:
        return
    print_error(message)
    if as_json:
        print_json({"error": message})
    raise typer.Exit(status)
