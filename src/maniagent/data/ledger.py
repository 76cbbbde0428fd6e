"""What a collection has come to so far: every attempt, from wherever it is written."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path

from pydantic import ValidationError

from ..errors import UsageError
from .disk import disk_errors_told
from .episode import EpisodeInfo
from .lerobot.ledger import read_ledger
from .lerobot.publish import DATASET, STAGED
from .staging import Staging, read_info

_KEY = re.compile(r"^w(\d+)-(\d+)-a(\d+)$")


def key_of(worker: int, start: int, attempt: int) -> str:
    """The key of an episode: keys sort by worker, start and attempt."""
    return f"w{worker:02d}-{start:06d}-a{attempt}"


def parts_of(key: str) -> tuple[int, int, int]:
    """Worker, start and attempt of a key; ValueError for one that isn't ours."""
    found = _KEY.match(key)
    if found is None:
        raise ValueError(f"{key} is no key of a collected episode")
    worker, start, attempt = map(int, found.groups())
    return worker, start, attempt


def attempts_file(folder: Path, worker: int) -> Path:
    """Where a worker notes its attempts."""
    return folder / f"attempts-w{worker:02d}.jsonl"


def note(folder: Path, worker: int, info: EpisodeInfo) -> None:
    """Write down one attempt.

    Raises SetupError where the disk is full, UsageError where it may not be written to.
    """
    path = attempts_file(folder, worker)
    with disk_errors_told(path), path.open("ab") as file:
        cut_off = file.tell() > 0 and not _ends_a_line(path)
        # In one piece: what a kill or a full disk cuts off costs itself, not the next line.
        file.write(b"\n" * cut_off + info.model_dump_json().encode() + b"\n")


def read_attempts(folder: Path) -> tuple[EpisodeInfo, ...]:
    """Every attempt of a collection, by key: those noted, staged, in quarantine, and in the dataset.

    A worker that was killed between keeping an episode and noting it has lost nothing: the episode speaks for itself.

    Raises UsageError where something is written that no kill leaves, and that no collection wrote.
    """
    known: dict[str, EpisodeInfo] = {}
    for path in sorted(folder.glob("attempts-w*.jsonl")):
        known |= {info.key: info for info in _lines(path)}
    if (folder / STAGED).is_dir():
        staging = Staging(folder / STAGED)
        for episode in (*staging.episodes(), *staging.quarantined()):
            info = read_info(episode)
            known[info.key] = info
    known |= {info.key: info for info in read_ledger(folder / DATASET) or ()}
    return tuple(known[key] for key in sorted(known))


def _lines(path: Path) -> Iterator[EpisodeInfo]:
    """What a file tells, without lines that were cut off: by a kill, a full disk, or the power, which leaves zeros."""
    for number, line in enumerate(_read(path).split(b"\n"), start=1):
        if not (said := line.strip(b"\0 \r")):
            continue
        try:
            yield EpisodeInfo.model_validate_json(said)
        except ValidationError as error:
            if said.startswith(b"{") and error.errors()[0]["type"] == "json_invalid":
                continue
            raise UsageError(
                f"Line {number} of {path} is no attempt of this version of maniagent. Restore the file from a copy, "
                "or remove the line; episodes that are kept are known without it."
            ) from error


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise UsageError(f"{path} can't be read: {error.strerror}.") from error


def _ends_a_line(path: Path) -> bool:
    with path.open("rb") as file:
        file.seek(-1, os.SEEK_END)
        return file.read(1) == b"\n"
