"""What a collection has come to so far: every attempt, from wherever it is written."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path

from pydantic import ValidationError

from .episode import EpisodeInfo
from .lerobot.ledger import read_ledger
from .lerobot.publish import DATASET, STAGED
from .staging import INFO, Staging

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
    """Write down one attempt."""
    with attempts_file(folder, worker).open("a", encoding="utf-8") as file:
        file.write(info.model_dump_json() + "\n")


def read_attempts(folder: Path) -> tuple[EpisodeInfo, ...]:
    """Every attempt of a collection, by key: those noted, staged, in quarantine, and in the dataset.

    A worker that was killed between keeping an episode and noting it has lost nothing: the episode speaks for itself.
    """
    known: dict[str, EpisodeInfo] = {}
    for path in sorted(folder.glob("attempts-w*.jsonl")):
        known |= {info.key: info for info in _lines(path)}
    if (folder / STAGED).is_dir():
        staging = Staging(folder / STAGED)
        for episode in (*staging.episodes(), *staging.quarantined()):
            info = EpisodeInfo.model_validate_json((episode / INFO).read_text(encoding="utf-8"))
            known[info.key] = info
    known |= {info.key: info for info in read_ledger(folder / DATASET) or ()}
    return tuple(known[key] for key in sorted(known))


def _lines(path: Path) -> Iterator[EpisodeInfo]:
    """The whole lines of a file whose last line may have been cut off by a kill."""
    for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
        try:
            yield EpisodeInfo.model_validate(json.loads(line))
        except (ValueError, ValidationError):
            continue
