"""A collection from end to end: workers play, episodes are kept, a dataset grows, figures and a map say how it went."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Protocol, Self

from ..envs.cameras import MAIN_CAMERA
from ..perception.viewpoint import Viewpoint
from .cluster import RayCluster
from .coverage import Covered, Tried, draw_coverage
from .crew import Crew
from .disk import disk_errors_told, write_whole
from .episode import EpisodeInfo
from .ledger import parts_of, read_attempts
from .lerobot.client import Writer
from .lerobot.generation import locked
from .lerobot.publish import STAGED, Published, check_dataset, publish
from .local import ThisMachine
from .sessions import Session, read_costs
from .settings import CollectSettings
from .share import Asked
from .staging import Staging
from .starts import Start
from .summary import Summary, summarise, to_markdown
from .table import Table

BATCH = 25
"""Episodes that go into the dataset at a time."""
MOST_WAITING = 8
"""Batches that may wait for the dataset before workers have to; at the defaults an episode takes 65 MB until then."""
MAP = "coverage.png"
_PICTURE = f"\n## Where episodes began\n\n![Starts on the table, seen from above]({MAP})\n"
_LOCK = ".collect.lock"
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


Helper = Callable[[str], None]
"""Is told why the robot needs somebody to put things back, and returns once that is done; raises to end it all."""


def collect(
    settings: CollectSettings,
    folder: Path,
    watcher: Watcher,
    writer: Writer | None,
    *,
    helper: Helper = lambda why: None,
    ray: str | None = None,
    batch: int = BATCH,
) -> Summary:
    """Collect until there are as many valid episodes as wanted; an earlier, interrupted call is gone on with.

    Without `writer` episodes stay staged, else every `batch` of them goes into the dataset. In simulation the station
    puts things back by itself, as soon as `helper` returns. `ray` is the address of a cluster whose nodes work. At any
    moment everything may be killed: what was kept stays, and at most the episodes in progress are lost.

    Raises UsageError for a folder that holds something else or is collected into already, SetupError where nothing can
    be kept or no worker gets anywhere, WriterFailure where lerobot fails, whatever `helper` raises.
    """
    settings.save(folder)
    with locked(folder, wait=1.0, name=_LOCK):
        _check(settings, folder, writer)
        try:
            watcher.begin(settings.count, read_attempts(folder))
            session = Session(folder, settings.workers)
            with (
                RayCluster(settings, folder, ray) if ray is not None else ThisMachine(settings, folder) as place,
                Crew(place, settings.workers, folder) as crew,
                _Publisher(folder, writer, batch, watcher, session) as publisher,
            ):
                while crew.busy:
                    for said in crew.hear(_PATIENCE):
                        if isinstance(said, Asked):
                            helper(said.why)
                        else:
                            watcher.add(said.info)
                            session.add(writing=said.seconds)
                            publisher.add(said.info)
                    publisher.check()
                    if not publisher.behind:
                        crew.go_on()
                publisher.finish()
        finally:
            summary = write_summary(settings, folder)
    return summary


def _check(settings: CollectSettings, folder: Path, writer: Writer | None) -> None:
    """Find what would end the collection before it takes an hour, and mend what a killed one left."""
    Staging(folder / STAGED).sweep()
    if writer is not None:
        writer.check()
        check_dataset(folder, settings.sampling)
    for worker in range(settings.workers):
        Table.load(folder, worker)


def write_summary(settings: CollectSettings, folder: Path) -> Summary:
    """Figures and a map of what there is."""
    attempts = read_attempts(folder)
    summary = summarise(settings.task, settings.count, attempts, read_costs(folder))
    write_whole(folder / "summary.json", summary.model_dump_json(indent=2) + "\n")
    covered = [_covered(settings, folder, worker, attempts) for worker in range(settings.workers)]
    tables = [table for table in covered if table is not None]
    write_whole(folder / "summary.md", to_markdown(summary) + _PICTURE * bool(tables))
    if tables:
        viewpoint = Viewpoint.from_camera(MAIN_CAMERA.T_base_camera)
        with disk_errors_told(folder / MAP):
            draw_coverage(tables, viewpoint, folder / MAP, settings.threshold)
    return summary


def _covered(settings: CollectSettings, folder: Path, worker: int, attempts: Sequence[EpisodeInfo]) -> Covered | None:
    """What has come of one worker's starts; None where it has tried none."""
    mine = [info for info in attempts if parts_of(info.key)[0] == worker]
    table = Table.load(folder, worker)
    if not mine or table is None:
        return None
    planned = {info.start: Start(parts_of(info.key)[1], info.start[:2], info.start[2]) for info in mine}
    return Covered(table.region(settings), list(planned.values()), [Tried.of(info) for info in mine])


class _Publisher:
    """Puts episodes into the dataset while the workers go on; one batch at a time, in a thread of its own."""

    def __init__(self, folder: Path, writer: Writer | None, batch: int, watcher: Watcher, session: Session) -> None:
        self._folder, self._writer, self._batch = folder, writer, batch
        self._watcher, self._session = watcher, session
        self._thread = ThreadPoolExecutor(max_workers=1)
        self._running: Future[Published] | None = None
        self._waiting = len(Staging(folder / STAGED).episodes())

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *ending: object) -> None:
        if ending != (None, None, None) and self._writer is not None:
            self._writer.interrupt()  # what goes into the dataset now stays staged
        self._thread.shutdown()

    @property
    def behind(self) -> bool:
        """Whether so much waits for the dataset that the disk should not have to hold more."""
        return self._writer is not None and self._waiting > MOST_WAITING * self._batch

    def add(self, info: EpisodeInfo) -> None:
        """Count what waits."""
        self._waiting += info.label == "valid"

    def check(self) -> None:
        """Begin with a batch where one waits and the last one is done. Raises what that one failed by."""
        if self._running is not None and self._running.done():
            self._take(self._running)
        if self._running is None and self._writer is not None and self._waiting >= self._batch:
            self._running = self._thread.submit(publish, self._folder, writer=self._writer, batch=self._batch)

    def finish(self) -> None:
        """Put in all that is left."""
        if self._running is not None:
            self._take(self._running)
        if self._writer is not None:
            self._take(self._thread.submit(publish, self._folder, writer=self._writer, batch=self._batch))

    def _take(self, running: Future[Published]) -> None:
        published = running.result()
        self._running = None
        self._waiting -= published.added
        self._session.add(encoding=published.processor_seconds)
        self._watcher.published(published)
