"""Makes an RLDS dataset of a LeRobot dataset: as a whole, or not at all."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from ...errors import UsageError
from ..lerobot.generation import next_generation
from ..lerobot.publish import disk_error
from .client import WriterFailure, find_interpreter, write
from .episodes import Settings, Source
from .registration import guide

VERSION = "1.0.0"
_NAME = re.compile(r"[a-z][a-z0-9_]*")


@dataclass(frozen=True)
class Exported:
    """What an export came to."""

    dataset: Path
    """`tfds.builder_from_directory` reads `dataset`/1.0.0; `tfds.builder` its name in the folder that holds it."""
    name: str
    episodes: int
    steps: int
    rate: float
    """Steps a second."""
    bytes: int


def export_rlds(
    dataset: Path,
    out: Path,
    *,
    settings: Settings = Settings(),  # noqa: B008 - frozen
    python: Path | None = None,
    on_progress: Callable[[int, int, str], None] = lambda done, total, what: None,
) -> Exported:
    """Write the RLDS dataset `out`, whose last part is its name, from a LeRobot dataset that maniagent collected.

    `python` has tensorflow_datasets (None: client.find_interpreter). `on_progress` hears how many of how many
    episodes are done, and what comes next. One episode is in memory at a time.

    Raises UsageError where `out` is there or is no name, or where the dataset can't be exported; SetupError where
    tensorflow_datasets is missing or the disk refuses; WriterFailure where writing fails.
    """
    name = _checked_name(out)
    interpreter = find_interpreter(python)
    source = Source(dataset, settings)
    steps: list[int] = []
    try:
        with next_generation(out) as new:
            request = {"name": name, "version": VERSION, "folder": str(new.parent.absolute() / "tfds")}
            request |= {"description": _description(source), **source.schema()}
            counted = write(interpreter, request, _packed(source, steps, on_progress))
            if counted != (wanted := {"episodes": len(steps), "steps": sum(steps), "ends": len(steps)}):
                raise WriterFailure(f"What was written reads back as {counted}, not as {wanted}; nothing was made.")
            (new.parent / "tfds" / name).rename(new)
            (new / "README.md").write_text(guide(name, source.cameras, source.rate), encoding="utf-8")
    except OSError as error:
        raise disk_error(error, out.parent) from error
    size = sum(path.stat().st_size for path in out.rglob("*") if path.is_file())
    return Exported(out, name, len(steps), sum(steps), source.rate, size)


def _packed(source: Source, steps: list[int], on_progress: Callable[[int, int, str], None]) -> Iterator[bytes]:
    """The episodes, one after another; `steps` gets the length of each."""
    episodes = source.dataset.episodes
    for number, episode in enumerate(episodes):
        on_progress(number, len(episodes), episode.name)
        packed = source.pack(episode)
        steps.append(packed.steps)
        yield packed.data
    on_progress(len(episodes), len(episodes), "reading back")


def _checked_name(out: Path) -> str:
    """The dataset's name; UsageError where it is none, or where something is there already."""
    name = out.absolute().name
    if not _NAME.fullmatch(name):
        better = re.sub(r"\W+", "_", name.lower()).strip("_0123456789") or "demonstrations"
        raise UsageError(
            f"{name!r} can't name an RLDS dataset: lower-case letters, digits and _ can. "
            f"Name it {out.with_name(better)}, say."
        )
    if out.exists():
        raise UsageError(f"{out} is there already. Name another folder, or remove that one.")
    return name


def _description(source: Source) -> str:
    return (
        f"Demonstrations collected with maniagent, {source.rate:g} steps a second, on {source.dataset.info.robot}. "
        "Actions: end-effector deltas along the base's axes (m; roll, pitch, yaw in rad), gripper 1 open, 0 closed."
    )
