"""The cache's file: SQLite in WAL mode, one short transaction an operation, safe with several processes at once.

A connection lives as long as one operation: nothing has to be closed, and forks and threads share nothing. What a
killed process had not committed is not there; what it had, is.
"""

from __future__ import annotations

import json
import os
import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from ...errors import SetupError, UsageError
from ...types import ActionSequence
from .entry import Entry, Key, Kind, motion_of

_WAIT = 30.0
"""s that an operation waits for other processes."""
_APPLICATION = 0x6D414743
"""Says that a SQLite file is a cache of ours (PRAGMA application_id)."""
_VERSION = 1
_DROPPED_AFTER = 2
"""Failures running after which an entry goes."""

_SCHEMA = f"""
BEGIN IMMEDIATE;
CREATE TABLE IF NOT EXISTS entries (
    id INTEGER PRIMARY KEY AUTOINCREMENT,
    kind TEXT NOT NULL,
    wording TEXT NOT NULL,
    objects TEXT NOT NULL,
    sequence TEXT NOT NULL,
    motion TEXT NOT NULL,
    successes INTEGER NOT NULL,
    failures INTEGER NOT NULL,
    failed_running INTEGER NOT NULL,
    created TEXT NOT NULL,
    judged TEXT NOT NULL,
    UNIQUE (kind, wording, objects)
);
PRAGMA application_id = {_APPLICATION};
PRAGMA user_version = {_VERSION};
COMMIT;
"""
_ALL = """
SELECT id, kind, wording, objects, sequence, successes, failures, failed_running, created, judged
FROM entries ORDER BY id
"""
_GET = """
SELECT id, kind, wording, objects, sequence, successes, failures, failed_running, created, judged
FROM entries WHERE kind = :kind AND wording = :wording AND objects = :objects
"""
_CONFIRM = """
INSERT INTO entries (kind, wording, objects, sequence, motion, successes, failures, failed_running, created, judged)
VALUES (:kind, :wording, :objects, :sequence, :motion, 1, 0, 0, :now, :now)
ON CONFLICT (kind, wording, objects) DO UPDATE SET
    successes = CASE motion WHEN excluded.motion THEN successes + 1 ELSE 1 END,
    failures = CASE motion WHEN excluded.motion THEN failures ELSE 0 END,
    created = CASE motion WHEN excluded.motion THEN created ELSE excluded.created END,
    sequence = CASE motion WHEN excluded.motion THEN sequence ELSE excluded.sequence END,
    motion = excluded.motion,
    failed_running = 0,
    judged = excluded.judged
WHERE motion IN (excluded.motion, :refused)
"""
_BLAME = """
UPDATE entries SET failures = failures + 1, failed_running = failed_running + 1, judged = :now
WHERE kind = :kind AND wording = :wording AND objects = :objects AND motion = :motion
"""
_DROP = """
DELETE FROM entries
WHERE kind = :kind AND wording = :wording AND objects = :objects AND failed_running >= :limit
"""
_ADD = """
INSERT OR IGNORE INTO entries
    (kind, wording, objects, sequence, motion, successes, failures, failed_running, created, judged)
VALUES (:kind, :wording, :objects, :sequence, :motion, :successes, :failures, :failed_running, :created, :judged)
"""


def default_path() -> Path:
    """Where the cache is when nobody says where: in the user's data folder (XDG base directory specification)."""
    data = os.environ.get("XDG_DATA_HOME") or Path.home() / ".local" / "share"
    return Path(data) / "maniagent" / "actions.sqlite"


class CacheStore:
    """The entries in a file, which is made where it is missing.

    Every method raises SetupError where the file is damaged, is no cache of ours, or can't be read or written.
    """

    def __init__(self, path: Path, *, must_exist: bool = False) -> None:
        """With `must_exist`, UsageError where there is no such file."""
        self.path = Path(path)
        if must_exist and not self.path.is_file():
            raise UsageError(f"There is no cache at {self.path}.")
        with self._connected() as db:
            if not self._is_ours(db):
                db.execute("PRAGMA journal_mode = WAL")
                db.executescript(_SCHEMA)

    def get(self, key: Key) -> Entry | None:
        """The entry under a key."""
        with self._connected() as db:
            row = db.execute(_GET, _named(key)).fetchone()
        return None if row is None else self._entry(row)

    def entries(self) -> tuple[Entry, ...]:
        """All entries, the oldest first."""
        with self._connected() as db:
            rows = db.execute(_ALL).fetchall()
        return tuple(map(self._entry, rows))

    def confirm(self, key: Key, sequence: ActionSequence, refused: ActionSequence | None = None) -> None:
        """A success of `sequence`: counted where it is kept, else kept where nothing is, or in `refused`'s place."""
        values = _named(key) | _written(sequence) | {"refused": motion_of(refused) if refused else None, "now": now()}
        with self._writing() as db:
            db.execute(_CONFIRM, values)

    def blame(self, key: Key, sequence: ActionSequence) -> None:
        """A failure of `sequence`: counted where it is kept; the second one running drops the entry."""
        values = _named(key) | _written(sequence) | {"now": now(), "limit": _DROPPED_AFTER}
        with self._writing() as db:
            db.execute(_BLAME, values)
            db.execute(_DROP, values)

    def add(self, entries: Sequence[Entry]) -> int:
        """Take over entries (with new ids) where nothing is kept under their keys, all or none; how many were."""
        with self._writing() as db:
            before = db.total_changes
            db.executemany(_ADD, map(_row, entries))
            return db.total_changes - before

    def remove(self, ids: Sequence[int]) -> None:
        """Remove entries, all or none; UsageError where one of the ids is not there."""
        with self._writing() as db:
            for number in ids:
                if db.execute("DELETE FROM entries WHERE id = ?", (number,)).rowcount == 0:
                    raise UsageError(f"There is no entry {number} in {self.path}; `maniagent cache list` shows them.")

    @contextmanager
    def _connected(self) -> Iterator[sqlite3.Connection]:
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            with closing(sqlite3.connect(self.path, timeout=_WAIT, isolation_level=None)) as db:
                yield db
        except (sqlite3.Error, OSError) as error:
            raise SetupError(
                f"The cache {self.path} can't be used: {error}. Move the file away, or name another one with --cache."
            ) from error

    @contextmanager
    def _writing(self) -> Iterator[sqlite3.Connection]:
        """One transaction: committed at the end, rolled back where something is raised."""
        with self._connected() as db:
            db.execute("BEGIN IMMEDIATE")
            with db:
                yield db

    def _is_ours(self, db: sqlite3.Connection) -> bool:
        """Whether the file is a cache; False where it is empty, so that it can become one."""
        ids = {name: db.execute(f"PRAGMA {name}").fetchone()[0] for name in ("application_id", "user_version")}
        if ids["application_id"] != _APPLICATION:
            if db.execute("SELECT count(*) FROM sqlite_schema").fetchone()[0]:
                raise SetupError(f"{self.path} is a database of something else. Name another file with --cache.")
            return False
        if ids["user_version"] != _VERSION:
            raise SetupError(
                f"The cache {self.path} is of version {ids['user_version']}; this maniagent reads version {_VERSION}."
            )
        return True

    def _entry(self, row: tuple[int, str, str, str, str, int, int, int, str, str]) -> Entry:
        number, kind, wording, objects, sequence, successes, failures, failed_running, created, judged = row
        try:
            key = Key(Kind(kind), wording, tuple(json.loads(objects)))
            kept = ActionSequence.model_validate_json(sequence)
        except ValueError as error:
            raise SetupError(
                f"Entry {number} of the cache {self.path} is damaged. `maniagent cache rm {number}` removes it."
            ) from error
        return Entry(number, key, kept, successes, failures, failed_running, created, judged)


def now() -> str:
    """The time as entries hold it."""
    return datetime.now(UTC).isoformat(timespec="seconds")


def _named(key: Key) -> dict[str, Any]:
    return {"kind": key.kind.value, "wording": key.wording, "objects": json.dumps(key.objects, ensure_ascii=False)}


def _written(sequence: ActionSequence) -> dict[str, Any]:
    return {"sequence": sequence.model_dump_json(), "motion": motion_of(sequence)}


def _row(entry: Entry) -> dict[str, Any]:
    fields = ("successes", "failures", "failed_running", "created", "judged")
    return _named(entry.key) | _written(entry.sequence) | {name: getattr(entry, name) for name in fields}
