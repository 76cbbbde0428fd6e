"""A worker's share of a collection: start after start, until its quota of valid episodes is reached.

It tells what comes of it and goes on when it is asked for more; where it runs, and onto which disk that is written, is
no matter to it.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from ..errors import SetupError
from .chain import Attempt, Stuck
from .episode import EpisodeInfo, Recording
from .ledger import key_of, parts_of
from .settings import CollectSettings
from .starts import Start
from .station import TwinStation
from .table import Table

MOST_REFUSALS = 5
"""Starts in a row that can't be had, before a person is asked: then it is where the object lies that is at fault."""
MOST_INTERVENTIONS = 5
"""In a row, before a worker gives up: then it isn't the scene that is at fault."""
MOST_FAILURES = 50
"""Attempts in a row without a valid one, before a worker gives up: something is broken, or can't be done."""


@dataclass(frozen=True)
class Tried:
    """One attempt, to be kept."""

    info: EpisodeInfo
    recording: Recording | None


@dataclass(frozen=True)
class Asked:
    """The robot can't go on until somebody has put things back; asking it for more says that this is done."""

    why: str


Said = Table | Tried | Asked


class Share:
    """What one worker does. The sessions of a collection that was cut off do it together."""

    def __init__(
        self, settings: CollectSettings, worker: int, before: Sequence[EpisodeInfo] = (), table: Table | None = None
    ) -> None:
        """`before`: every attempt that earlier sessions have noted, of whichever worker; `table`: what they saw."""
        self._settings, self._worker, self._table = settings, worker, table
        mine = [info for info in before if parts_of(info.key)[0] == worker]
        self._missing = settings.quota(worker) - sum(info.label == "valid" for info in mine)
        self._first = max((parts_of(info.key)[1] for info in mine), default=-1) + 1
        self._refusals = self._interventions = self._failures = 0

    def work(self) -> Iterator[Said]:
        """Go on until the quota is reached.

        Raises Stuck where help doesn't help, SetupError where attempt after attempt fails, StageFailure where the table
        doesn't hold what the task is about.
        """
        if self._missing <= 0:
            return
        with TwinStation(self._settings, self._worker, self._table) as station:
            if self._table is None:
                yield station.table
            for start in station.starts(self._first):
                for said in self._try_at(station, start):
                    yield said
                    if isinstance(said, Tried):
                        self._count(said.info)
                if self._missing <= 0:
                    return

    def _try_at(self, station: TwinStation, start: Start) -> Iterator[Tried | Asked]:
        """Try at one start until an episode is valid."""
        for number in range(1, self._settings.attempts + 1):
            began, interventions = time.monotonic(), 0
            try:
                why = self._bring(station, start)
            except Stuck as stuck:
                self._interventions += 1
                if self._interventions > MOST_INTERVENTIONS:
                    raise
                yield Asked(str(stuck))
                station.put(start)
                why, interventions = "", 1
            else:
                self._interventions = 0
            attempt = Attempt("failed", why, None, None) if why else station.chain.perform(seed=start.index)
            info = self._info(station, start, number, attempt)
            seconds = time.monotonic() - began
            update = {"seconds": seconds, "interventions": interventions}
            yield Tried(info.model_copy(update=update), attempt.recording)
            if why or attempt.label == "valid":
                return

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

    def _count(self, info: EpisodeInfo) -> None:
        if info.label == "valid":
            self._missing -= 1
            self._failures = 0
            return
        self._failures += 1
        if self._failures >= MOST_FAILURES:
            raise SetupError(f"{MOST_FAILURES} attempts in a row came to nothing; the last: {info.reason}")

    def _info(self, station: TwinStation, start: Start, number: int, attempt: Attempt) -> EpisodeInfo:
        true_distance, truly_valid = station.truth()
        return EpisodeInfo(
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
        )
