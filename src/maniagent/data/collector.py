"""A collection from end to end: workers play, episodes are kept, a dataset grows, figures and a map say how it went."""

from __future__ import annotations

import time
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Protocol

from ..envs.cameras import MAIN_CAMERA
from ..perception.viewpoint import Viewpoint
from .coverage import Tried, draw_coverage
from .crew import Crew
from .episode import EpisodeInfo
from .ledger import parts_of, read_attempts
from .lerobot.client import Writer
from .lerobot.publish import STAGED, Published, publish
from .settings import CollectSettings
from .staging import Staging
from .starts import Start
from .station import region_of
from .summary import Summary, note_session, seconds_spent, summarise, to_markdown

BATCH = 25
"""Episodes that go into the dataset at a time."""
_PATIENCE = 0.5
"""s between looks at what the writer does."""


class Watcher(Protocol):
    """Who is told how it goes."""

    def begin(self, wanted: int, before: Sequence[EpisodeInfo]) -> None:
        """How many valid episodes are wanted, and what earlier calls have tried."""
        ...

    def add(self, info: EpisodeInfo) -> None:
        """One more attempt."""
        ...

    def published(self, so_far: Published) -> None:
        """Episodes have gone into the dataset."""
        ...


def collect(settings: CollectSettings, folder: Path, watcher: Watcher, writer: Writer | None) -> Summary:
    """Collect until there are as many valid episodes as wanted; an earlier, interrupted call is gone on with.

    Without `writer` episodes stay staged. At any moment everything may be killed: what was kept stays, and at most
    the episode in progress is lost.

    Raises UsageError for a folder that holds something else, SetupError where nothing can be kept or no worker gets
    anywhere, WriterFailure where lerobot fails.
    """
    settings.save(folder)
    Staging(folder / STAGED).sweep()
    began = time.monotonic()
    try:
        watcher.begin(settings.count, read_attempts(folder))
        with Crew(settings, folder) as crew, _Publisher(folder, writer, watcher) as publisher:
            while crew.busy:
                for info in crew.hear(_PATIENCE):
                    watcher.add(info)
                    publisher.add(info)
                publisher.check()
            publisher.finish()
    finally:
        note_session(folder, time.monotonic() - began)
        summary = write_summary(settings, folder)
    return summary


def write_summary(settings: CollectSettings, folder: Path) -> Summary:
    """Figures and maps of what there is."""
    attempts = read_attempts(folder)
    summary = summarise(settings.task, settings.count, attempts, seconds_spent(folder))
    (folder / "summary.json").write_text(summary.model_dump_json(indent=2) + "\n", encoding="utf-8")
    (folder / "summary.md").write_text(to_markdown(summary), encoding="utf-8")
    viewpoint = Viewpoint.from_camera(MAIN_CAMERA.T_base_camera)
    for worker in range(settings.workers):
        mine = [info for info in attempts if parts_of(info.key)[0] == worker]
        if mine:
            planned = {info.start: Start(parts_of(info.key)[1], info.start[:2], info.start[2]) for info in mine}
            tried = [Tried.of(info, info.began) for info in mine]
            draw_coverage(
                region_of(settings, folder, worker),
                list(planned.values()),
                tried,
                viewpoint,
                folder / f"coverage-w{worker:02d}.png",
            )
    return summary


class _Publisher:
    """Puts episodes into the dataset while the workers go on; one batch at a time, in a thread of its own."""

    def __init__(self, folder: Path, writer: Writer | None, watcher: Watcher) -> None:
        self._folder, self._writer, self._watcher = folder, writer, watcher
        self._thread = ThreadPoolExecutor(max_workers=1)
        self._running: Future[Published] | None = None
        self._waiting = 0

    def __enter__(self) -> _Publisher:
        return self

    def __exit__(self, *ending: object) -> None:
        self._thread.shutdown()

    def add(self, info: EpisodeInfo) -> None:
        """Count what waits."""
        self._waiting += info.label == "valid"

    def check(self) -> None:
        """Begin with a batch where one waits and the last one is done. Raises what that one failed by."""
        if self._running is not None and self._running.done():
            self._watcher.published(self._running.result())
            self._running = None
        if self._running is None and self._writer is not None and self._waiting >= BATCH:
            self._waiting = 0
            self._running = self._thread.submit(publish, self._folder, writer=self._writer, batch=BATCH)

    def finish(self) -> None:
        """Put in all that is left."""
        if self._running is not None:
            self._running.result()
            self._running = None
        if self._writer is not None:
            self._watcher.published(publish(self._folder, writer=self._writer, batch=BATCH))
