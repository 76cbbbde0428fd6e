"""From staged episodes to a dataset: whole batches, each in or not, none twice."""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...errors import SetupError, UsageError
from ...robots.sampling import Sampling
from ..disk import FULL
from ..episode import EpisodeInfo
from ..staging import Staging, read_info
from .client import CODEC, Writer
from .generation import locked, next_generation, recover
from .ledger import read_ledger, write_ledger
from .schema import ROBOT, check_rate, differences, read_schema, schema_of, unlike

STAGED, DATASET = "episodes", "dataset"
"""Folders of a collection."""


@dataclass(frozen=True)
class Published:
    """What publishing came to."""

    dataset: Path
    added: int
    """Episodes that are new in the dataset."""
    total: int
    """Episodes in it now."""
    processor_seconds: float = 0.0
    """What adding them took the writer."""


@dataclass(frozen=True)
class _Staged:
    folder: Path
    info: EpisodeInfo


def publish(
    collection: Path,
    *,
    writer: Writer,
    batch: int = 25,
    codec: str = CODEC,
    robot_type: str = ROBOT,
    wait: float = 10.0,
    watcher: Callable[[Published], None] = lambda so_far: None,
) -> Published:
    """Move the valid staged episodes of a collection into its dataset, in the order of their keys.

    `collection`/episodes holds a folder an episode (data/episode.py); those that aren't valid stay where they are.
    `collection`/dataset is a LeRobotDataset v3, made where there is none. It changes once for each `batch` episodes,
    at one moment, and every batch makes a file of its own for each camera; `watcher` is told after each. A staged
    folder is removed once its episode is in, by this call or, after a kill, by the next. `wait` (s) is the patience
    with another process that publishes here.

    Raises UsageError where an episode doesn't fit the dataset (nothing is added then) or the collection is being
    published already, SetupError where the disk is full or may not be written to, WriterFailure where lerobot fails;
    the dataset is as it was before the batch then.
    """
    if batch < 1:
        raise UsageError(f"a batch has at least one episode, not {batch}")
    if not collection.is_dir():
        raise UsageError(f"{collection} is no folder; name one that `maniagent collect` made.")
    dataset = collection / DATASET
    try:
        with locked(collection, wait):
            recover(dataset)
            present = _present(dataset)
            _remove_published(collection, present)
            staged = _staged(collection)
            schema = _common_schema(dataset, staged, robot_type)
            added, spent = 0, 0.0
            for start in range(0, len(staged), batch):
                some = staged[start : start + batch]
                present = [*present, *(episode.info for episode in some)]
                with next_generation(dataset) as new:
                    told = [(episode.folder, phrase(episode.info)) for episode in some]
                    spent += writer.append(new, schema, told, codec)
                    write_ledger(new, present)
                added += len(some)
                _remove_published(collection, present)
                watcher(Published(dataset, added, len(present), spent))
            return Published(dataset, added, len(present), spent)
    except OSError as error:
        raise disk_error(error, collection) from error


def check_dataset(collection: Path, sampling: Sampling, *, robot_type: str = ROBOT, wait: float = 10.0) -> None:
    """See, before anything is collected, whether episodes that are sampled so can go into a collection's dataset.

    What killed processes left of it is mended first. Raises as `publish` does.
    """
    dataset = collection / DATASET
    try:
        with locked(collection, wait):
            recover(dataset)
            _remove_published(collection, _present(dataset))
            _common_schema(dataset, _staged(collection), robot_type)
    except OSError as error:
        raise disk_error(error, collection) from error
    check_rate(sampling.rate, "--fps")
    if dataset.exists() and (found := unlike(read_schema(dataset), sampling, robot_type)):
        raise UsageError(f"{dataset} is of another kind: {'; '.join(found)}. Collect into another folder.")


def phrase(info: EpisodeInfo) -> str:
    """How the task of an episode is put to LeRobot: its instruction or a paraphrase, drawn by its key alone."""
    phrases = (info.instruction, *info.paraphrases)
    return phrases[int.from_bytes(hashlib.sha256(info.key.encode()).digest()[:8], "big") % len(phrases)]


def disk_error(error: OSError, folder: Path) -> SetupError:
    """What to say of a disk that is full, or that may not be written to."""
    if error.errno in FULL:
        return SetupError(f"The disk of {folder} is full. Make room and run this again; nothing is lost.")
    return SetupError(f"{folder} can't be worked in ({error}). Allow it and run this again; nothing is lost.")


def _present(dataset: Path) -> list[EpisodeInfo]:
    if not dataset.exists():
        return []
    present = read_ledger(dataset)
    if present is None:
        raise UsageError(
            f"{dataset} is a dataset that no collection made, so which episodes it holds isn't known. "
            "Collect into another folder, and merge the two."
        )
    return present


def _staged(collection: Path) -> list[_Staged]:
    found = []
    for folder in Staging(collection / STAGED).episodes():
        info = read_info(folder)
        if info.label == "valid":
            found.append(_Staged(folder, info))
    return found


def _common_schema(dataset: Path, staged: Sequence[_Staged], robot_type: str) -> dict[str, Any]:
    """The schema of the dataset (of one that isn't there: of its first episode), which all that is staged must have."""
    have = read_schema(dataset) if dataset.exists() else None
    for episode in staged:
        want = schema_of(episode.folder, episode.info, robot_type)
        have = have or want
        if found := differences(have, want):
            raise UsageError(
                f"{episode.folder} doesn't fit {dataset}: {'; '.join(found)}. Collect what differs into another folder."
            )
    return have.to_plain() if have else {}


def _remove_published(collection: Path, present: Sequence[EpisodeInfo]) -> None:
    """Remove the staged folders of episodes that are in the dataset; one that can be seen is whole until the end."""
    for gone in (collection / STAGED).glob(".*.published/"):  # by one that was killed meanwhile
        shutil.rmtree(gone)
    for info in present:
        folder = collection / STAGED / info.key
        if folder.exists():
            gone = folder.with_name(f".{info.key}.published")
            folder.rename(gone)
            shutil.rmtree(gone)
