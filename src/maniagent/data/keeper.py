"""Puts what a worker tells onto the disk, so that nothing of it is lost from then on."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

from .episode import EpisodeInfo
from .ledger import note
from .lerobot.publish import STAGED
from .share import Tried
from .staging import Staging


@dataclass(frozen=True)
class Kept:
    """An attempt that is on the disk."""

    info: EpisodeInfo
    seconds: float
    """That writing took."""


class Keeper:
    """Keeps one worker's attempts in the folder of their collection."""

    def __init__(self, folder: Path, worker: int) -> None:
        self._folder, self._worker = folder, worker
        self._staging = Staging(folder / STAGED, keep_failed=False)

    def keep(self, tried: Tried) -> Kept:
        """Write an attempt down: the recording of a valid one among the episodes, of a doubtful one in quarantine.

        Raises UsageError and SetupError as Staging does.
        """
        began = time.monotonic()
        if tried.info.label == "valid":
            self._staging.commit(tried.info, tried.recording)
        elif tried.info.label == "doubtful":
            self._staging.quarantine(tried.info, tried.recording)
        note(self._folder, self._worker, tried.info)
        return Kept(tried.info, time.monotonic() - began)
