"""Datasets of datasets: several merged into one, one split into several."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from ...errors import UsageError
from .client import Writer
from .generation import next_generation
from .ledger import read_ledger, read_total, write_ledger
from .publish import disk_error
from .schema import differences, read_schema


def merge(datasets: Sequence[Path], out: Path, *, writer: Writer) -> int:
    """Make one dataset, `out`, of several, in their order; returns how many episodes it has.

    What is known of the episodes goes along where it is known of all. Raises UsageError where `out` is there already,
    where the datasets don't fit each other or an episode is in two of them; SetupError and WriterFailure as `publish`
    does. `out` is made as a whole or not at all.
    """
    if len(datasets) < 2:
        raise UsageError("Merging takes at least two datasets.")
    _refuse_existing(out)
    _refuse_strangers(datasets)
    ledgers = [read_ledger(dataset) for dataset in datasets]
    known = [info for ledger in ledgers for info in ledger or ()]
    twice = len(known) - len({info.model_dump_json() for info in known})
    if twice:
        raise UsageError(f"{twice} episodes are in more than one of the datasets; name each dataset once.")
    try:
        with next_generation(out) as new:
            writer.merge(datasets, new)
            if None not in ledgers:
                write_ledger(new, known)
    except OSError as error:
        raise disk_error(error, out.parent) from error
    return sum(read_total(dataset) for dataset in datasets)


def split(
    dataset: Path, parts: Mapping[str, float | int], out: Path, *, writer: Writer, seed: int = 0
) -> dict[str, int]:
    """Make a dataset of each part, `out`/NAME, with so many episodes (int) or such a share of them (float).

    Which episode goes where is drawn by `seed`: episodes that follow each other begin near each other on the table,
    so that a cut through the sequence would hold out a region, not a sample. Returns how many episodes each part has.
    lerobot encodes videos anew (in AV1) where a file goes to more than one part. Raises as `merge` does.
    """
    _refuse_existing(out)
    total, ledger = read_total(dataset), read_ledger(dataset)
    chosen = draw_parts(total, parts, seed)
    try:
        with next_generation(out) as new:
            writer.split(dataset, chosen, new)
            for name, episodes in chosen.items():
                if ledger is not None:
                    write_ledger(new / name, [ledger[episode] for episode in episodes])
    except OSError as error:
        raise disk_error(error, out.parent) from error
    return {name: len(episodes) for name, episodes in chosen.items()}


def draw_parts(total: int, parts: Mapping[str, float | int], seed: int) -> dict[str, list[int]]:
    """The episodes of each part, ascending, none in two. Raises UsageError where there aren't as many.

    Shares are rounded so that parts which make up all of it leave no episode out.
    """
    sizes = _sizes(total, parts)
    order = np.random.default_rng(seed).permutation(total)
    ends = list(itertools.accumulate(sizes.values()))
    return {
        name: sorted(int(episode) for episode in order[end - size : end])
        for (name, size), end in zip(sizes.items(), ends, strict=True)
    }


def _sizes(total: int, parts: Mapping[str, float | int]) -> dict[str, int]:
    sizes: dict[str, int] = {}
    share, taken = 0.0, 0
    for name, part in parts.items():
        if not name.replace("-", "").replace("_", "").isalnum():
            raise UsageError(f"{name!r} can't name a part; use letters, digits, - and _.")
        if isinstance(part, int):
            sizes[name] = part
            continue
        if not 0 < part <= 1:
            raise UsageError(f"A share lies between 0 and 1, not at {part:g} ({name}); a count has no point.")
        share += part
        upto = math.floor(share * total + 0.5)  # of all shares so far: rounding errors don't add up
        sizes[name], taken = upto - taken, upto
    if not sizes or min(sizes.values()) < 1 or sum(sizes.values()) > total:
        raise UsageError(f"{total} episodes can't be split into {dict(parts)}: each part needs one at least.")
    return sizes


def _refuse_existing(out: Path) -> None:
    if out.exists():
        raise UsageError(f"{out} is there already. Name another folder, or remove that one.")
    if not out.absolute().parent.is_dir():
        raise UsageError(f"{out.absolute().parent} is no folder. Make it, or name another.")


def _refuse_strangers(datasets: Sequence[Path]) -> None:
    first = read_schema(datasets[0])
    for dataset in datasets[1:]:
        if found := differences(first, read_schema(dataset)):
            raise UsageError(f"{dataset} doesn't fit {datasets[0]}: {'; '.join(found)}.")
