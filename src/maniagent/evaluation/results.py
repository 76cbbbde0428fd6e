"""results.jsonl: every finished episode, written down the moment it is known, found again after any kind of death."""

from __future__ import annotations

import fcntl
import json
from pathlib import Path
from types import TracebackType
from typing import Self

from pydantic import BaseModel, ConfigDict, ValidationError

from ..errors import UsageError
from .episode import EpisodeResult

SETTINGS, RESULTS = "settings.json", "results.jsonl"
_SETTINGS_PART = "settings.part"  # stands there for the blink of an eye while the settings are written


class Settings(BaseModel):
    """What must be the same for two episodes to be counted together."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    suite: str
    tasks: tuple[str, ...]
    actor: str
    episodes: int
    seeds: int
    time_limit: float
    version: str
    """maniagent's."""
    poses: str = ""
    """How objects are placed, where the suite leaves that to choose."""


class ResultsFile:
    """The results in an evaluation's folder: those of an earlier, interrupted call, and those that are added.

    Only the process that opened it writes to it; a second one is refused.
    """

    def __init__(self, folder: Path, settings: Settings) -> None:
        """Open the folder, made where it is missing.

        Raises UsageError where it holds something else, an evaluation with other settings, or one that is under way.
        """
        _claim(folder, settings)
        self._file = (folder / RESULTS).open("a+b")
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            self._file.close()
            raise UsageError(
                f"Another evaluation is under way in {folder}. Wait for it, or name another --out."
            ) from None
        self.done = self._read()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()

    def add(self, result: EpisodeResult) -> None:
        """Write down one more episode; it is on its way to the disk when this returns."""
        self._file.write(result.model_dump_json().encode() + b"\n")
        self._file.flush()
        self.done.append(result)

    def _read(self) -> list[EpisodeResult]:
        """What is there already; a last line that was cut short by a death is removed."""
        self._file.seek(0)
        content = self._file.read()
        whole = content.rfind(b"\n") + 1
        self._file.truncate(whole)
        found: dict[object, EpisodeResult] = {}
        for number, line in enumerate(content[:whole].splitlines(), 1):
            try:
                result = EpisodeResult.model_validate_json(line)
            except ValidationError as error:
                raise UsageError(
                    f"{self._file.name}, line {number}, is no result of an episode. Remove that line, or name another "
                    "--out."
                ) from error
            found.setdefault(result.job, result)
        return list(found.values())


def _claim(folder: Path, settings: Settings) -> None:
    """Make sure that the folder is for an evaluation with these settings."""
    path = folder / SETTINGS
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if path.exists():
            _compare(path, settings)
        elif any(entry.name != _SETTINGS_PART for entry in folder.iterdir()):
            raise UsageError(f"{folder} holds what no evaluation left there. Name an empty or a new folder.")
        else:
            part = folder / _SETTINGS_PART
            part.write_text(settings.model_dump_json(indent=2) + "\n", encoding="utf-8")
            part.replace(path)
    except OSError as error:
        raise UsageError(f"{folder} can't hold an evaluation: {error.strerror}. Name another --out.") from error


def _compare(path: Path, settings: Settings) -> None:
    try:
        before = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise UsageError(f"{path} is damaged. Name another --out.") from error
    now = settings.model_dump(mode="json")
    if before != now:
        known = before if isinstance(before, dict) else {}
        differing = [
            f"{name} {known.get(name)!r}, now {value!r}" for name, value in now.items() if known.get(name) != value
        ]
        raise UsageError(
            f"{path.parent} holds an evaluation with other settings ({'; '.join(differing)}). "
            "Go on with those, or name another --out."
        )
