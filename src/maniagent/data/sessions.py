"""What a collection has cost: wall time, and how much of it went into writing and encoding.

A line a session and moment, the last of a session counts: a kill loses what came after the last attempt, no more.
"""

from __future__ import annotations

import json
import time
import uuid
from dataclasses import asdict, dataclass
from pathlib import Path

from .disk import disk_errors_told

SESSIONS = "sessions.jsonl"


@dataclass(frozen=True)
class Costs:
    """Seconds, of all sessions together."""

    seconds: float = 0.0
    """Wall time."""
    working: float = 0.0
    """Of the workers: wall time, summed over them."""
    writing: float = 0.0
    """The part of that in which they wrote episodes to the disk."""
    encoding: float = 0.0
    """Processor time of the process that writes datasets, beside them."""


class Session:
    """The costs of one call, noted as they come up."""

    def __init__(self, folder: Path, workers: int) -> None:
        self._path, self._workers = folder / SESSIONS, workers
        self._name, self._began = uuid.uuid4().hex, time.monotonic()
        self._writing = self._encoding = 0.0

    def add(self, *, writing: float = 0.0, encoding: float = 0.0) -> None:
        """Add seconds, and note how it stands."""
        self._writing += writing
        self._encoding += encoding
        seconds = time.monotonic() - self._began
        costs = Costs(seconds, seconds * self._workers, self._writing, self._encoding)
        rounded = {name: round(value, 3) for name, value in asdict(costs).items()}
        with disk_errors_told(self._path), self._path.open("a", encoding="utf-8") as file:
            file.write(json.dumps({"session": self._name} | rounded) + "\n")


def read_costs(folder: Path) -> Costs:
    """The sum over all sessions; a line that a kill cut off is passed over."""
    latest: dict[str, Costs] = {}
    path = folder / SESSIONS
    for line in path.read_text(encoding="utf-8").splitlines() if path.exists() else ():
        try:
            fields = json.loads(line)
            session = fields.pop("session")
            latest[session] = Costs(**fields)
        except (ValueError, TypeError, KeyError):
            continue
    each = [asdict(costs) for costs in latest.values()]
    return Costs(**{name: sum(costs[name] for costs in each) for name in asdict(Costs())})
