"""Workers of a collection as processes of this machine."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import traceback
from collections.abc import Sequence
from multiprocessing.connection import Connection, wait
from pathlib import Path
from types import TracebackType
from typing import Self

from ..errors import ManiAgentError, SetupError
from ..processes import become_worker, starting_workers
from .crew import Died, Hand
from .disk import disk_errors_told
from .keeper import Keeper, Kept
from .ledger import read_attempts
from .settings import CollectSettings
from .share import Asked, Share, Tried
from .table import Table


class ThisMachine:
    """A Place. Workers write their episodes themselves, and tell only of them."""

    def __init__(self, settings: CollectSettings, folder: Path) -> None:
        self._settings, self._folder = settings, folder

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        pass

    def start(self, worker: int) -> Hand:
        """See Place."""
        return _Process(self._settings, worker, self._folder)

    def wait(self, hands: Sequence[Hand], seconds: float) -> Sequence[Hand]:
        """See Place."""
        by_connection = {hand.connection: hand for hand in hands if isinstance(hand, _Process)}
        return [by_connection[ready] for ready in wait(list(by_connection), seconds) if isinstance(ready, Connection)]

    def log(self, worker: int) -> str:
        """See Place."""
        return str(_log(self._folder, worker))


class _Process:
    """A Hand."""

    def __init__(self, settings: CollectSettings, worker: int, folder: Path) -> None:
        context = multiprocessing.get_context("spawn")  # rendering contexts and threads don't survive a fork
        self.connection, theirs = context.Pipe()
        self._process = context.Process(target=_work, args=(theirs, settings, worker, folder), daemon=True)
        with starting_workers():
            self._process.start()
        theirs.close()  # so that its death shows as the end of the connection

    def take(self) -> Kept | Asked | Table | None:
        try:
            said = self.connection.recv()
        except (EOFError, ConnectionResetError):
            self._process.join()
            code = self._process.exitcode or 0
            raise Died(f"killed by {signal.Signals(-code).name}" if code < 0 else f"exit status {code}") from None
        if isinstance(said, ManiAgentError):
            raise said
        told: Kept | Asked | Table | None = said
        return told

    def go_on(self) -> None:
        with contextlib.suppress(BrokenPipeError):  # it died while it waited; the end of the connection tells so
            self.connection.send(None)

    def kill(self) -> None:
        self._process.kill()
        self._process.join()
        self.connection.close()


def _log(folder: Path, worker: int) -> Path:
    return folder / f"worker-{worker:02d}.log"


def _work(connection: Connection, settings: CollectSettings, worker: int, folder: Path) -> None:
    """What a worker process does."""
    os.environ.setdefault("LP_NUM_THREADS", "0")  # software rendering: workers share the cores already
    try:
        with disk_errors_told(_log(folder, worker)):
            become_worker(_log(folder, worker))
        keeper = Keeper(folder, worker)
        for said in Share(settings, worker, read_attempts(folder), Table.load(folder, worker)).work():
            connection.send(keeper.keep(said) if isinstance(said, Tried) else said)
            connection.recv()
    except ManiAgentError as error:
        # Made anew: a subclass may not survive pickling.
        with contextlib.suppress(BrokenPipeError):
            connection.send(SetupError(str(error)))
    except Exception:
        traceback.print_exc()
        raise
    else:
        connection.send(None)
