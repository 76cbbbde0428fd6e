"""A worker's share of a collection: start after start, until its quota of valid episodes is reached."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

from .chain import Attempt, Stuck
from .episode import EpisodeInfo
from .ledger import key_of, note, parts_of, read_attempts
from .lerobot.publish import STAGED
from .settings import CollectSettings
from .staging import Staging
from .starts import Start
from .station import TwinStation

MOST_REFUSALS = 5
"""Starts in a row that can't be had, before a person is asked: then it is where the object lies that is at fault."""
MOST_INTERVENTIONS = 5
"""In a row, before a worker gives up: then it isn't the scene that is at fault."""


class Share:
    """Collects one worker's episodes."""

    def __init__(
        self, settings: CollectSettings, worker: int, folder: Path, tell: Callable[[EpisodeInfo], None]
    ) -> None:
        """`tell` hears of every attempt, once it is on the disk."""
        self._settings, self._worker, self._folder, self._tell = settings, worker, folder, tell
        self._staging = Staging(folder / STAGED, keep_failed=False)
        self._refusals = self._interventions = 0

    def collect(self) -> None:
        """Go on until the quota is reached.

        Raises Stuck where help doesn't help, SetupError and UsageError where episodes can't be kept.
        """
        mine = [info for info in read_attempts(self._folder) if parts_of(info.key)[0] == self._worker]
        valid = sum(info.label == "valid" for info in mine)
        first = max((parts_of(info.key)[1] for info in mine), default=-1) + 1
        quota = self._settings.quota(self._worker)
        if valid >= quota:
            return
        with TwinStation(self._settings, self._worker, self._folder) as station:
            for start in station.starts(first):
                valid += self._at(station, start)
                if valid >= quota:
                    return

    def _at(self, station: TwinStation, start: Start) -> bool:
        """Try at one start until an episode is valid; whether one was."""
        for number in range(1, self._settings.attempts + 1):
            began = time.monotonic()
            interventions = 0
            try:
                why = self._bring(station, start)
            except Stuck as stuck:
                self._interventions += 1
                if self._interventions > MOST_INTERVENTIONS:
                    raise
                interventions, why = 1, str(stuck)
                station.put(start)
            else:
                self._interventions = 0
            if why and not interventions:
                self._keep(station, start, number, Attempt("failed", why, None, None), began, interventions)
                return False
            attempt = station.chain.perform(seed=start.index)
            self._keep(station, start, number, attempt, began, interventions)
            if attempt.label == "valid":
                return True
        return False

    def _bring(self, station: TwinStation, start: Start) -> str:
        if self._settings.reset == "teleport":
            station.put(start)
            return ""
        why = station.chain.bring(start)
        self._refusals = self._refusals + 1 if why else 0
        if self._refusals >= MOST_REFUSALS:
            self._refusals = 0
            raise Stuck(why)
        return why

    def _keep(
        self, station: TwinStation, start: Start, number: int, attempt: Attempt, began: float, interventions: int
    ) -> None:
        true_distance, truly_valid = station.truth()
        info = EpisodeInfo(
            key=key_of(self._worker, start.index, number),
            task=self._settings.task,
            instruction=self._settings.instruction,
            paraphrases=self._settings.paraphrases,
            fps=self._settings.sampling.rate,
            seed=self._settings.seed,
            start=(*start.xy, start.yaw),
            attempts=number,
            label=attempt.label,
            reason=attempt.reason[:500],
            began=attempt.began,
            distance=attempt.distance,
            true_distance=true_distance,
            truly_valid=truly_valid,
            seconds=time.monotonic() - began,
            interventions=interventions,
        )
        keep = self._staging.quarantine if attempt.label == "doubtful" else self._staging.commit
        if attempt.label != "failed":
            keep(info, attempt.recording)
        note(self._folder, self._worker, info)
        self._tell(info)
