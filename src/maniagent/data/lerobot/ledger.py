"""Which episodes are in a dataset: meta/maniagent.jsonl, an EpisodeInfo a line, in the order of the episodes.

It lies in the dataset, so that it changes at the same moment: an episode is in both or in neither.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path

from pydantic import ValidationError

from ...errors import UsageError
from ..episode import EpisodeInfo

_FILE = Path("meta") / "maniagent.jsonl"


def read_ledger(dataset: Path) -> list[EpisodeInfo] | None:
    """What is known of each of the dataset's episodes; None where nobody wrote it down (another maker's dataset).

    Raises UsageError where the file can't be read, or isn't of as many episodes as the dataset.
    """
    path = dataset / _FILE
    if not path.exists():
        return None
    try:
        episodes = [EpisodeInfo.model_validate_json(line) for line in path.read_text().split("\n") if line]
    except (OSError, ValidationError, UnicodeError) as error:
        raise UsageError(f"{path} can't be read: {error}. Restore the dataset from a copy.") from error
    total = read_total(dataset)
    if len(episodes) != total:
        raise UsageError(f"{path} tells of {len(episodes)} episodes, the dataset has {total}. Restore it from a copy.")
    return episodes


def read_total(dataset: Path) -> int:
    """How many episodes a dataset has. Raises UsageError where that can't be read."""
    path = dataset / "meta" / "info.json"
    try:
        return int(json.loads(path.read_text())["total_episodes"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise UsageError(f"{path} is no description of a LeRobot dataset ({error}).") from error


def write_ledger(dataset: Path, episodes: Iterable[EpisodeInfo]) -> None:
    """Write it anew, into a dataset that nobody reads yet."""
    (dataset / _FILE).write_text("".join(episode.model_dump_json() + "\n" for episode in episodes))
