"""Verifying a dataset: every check by name, each with what it found; nothing that is broken raises."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .checks.overview import check_collected, check_episodes, check_files, check_tasks, check_totals
from .checks.rows import Duplicates, EpisodeRows, Finite, Indices, Motion, RowCheck, Subtasks, Tasks, Timestamps
from .checks.statistics import Statistics
from .checks.videos import Videos
from .findings import Check, Report, named
from .layout import BOOKKEEPING, STATS, DatasetError, Info, load_info, load_json
from .reading import Episode, check_is_dataset, read_collected, read_episodes, read_tasks
from .tables import DataFile, parquet_files, texts, type_fits, values

OnProgress = Callable[[int, int, str], None]
"""Told how many of how many steps are done, and what is looked at."""


def verify(root: Path, *, deep: bool = False, on_progress: OnProgress | None = None) -> Report:
    """Ask everything of the dataset in `root`; with `deep` every picture is decoded.

    Raises UsageError where `root` is no dataset at all. Whatever is broken in one is a finding.
    """
    check_is_dataset(root)
    opening = Check("metadata", "Can the files in meta/ be read, as LeRobotDataset v3?")
    try:
        info = load_info(root)
        tasks = read_tasks(root)
        episodes = read_episodes(root, info, statistics=True)
    except DatasetError as error:
        opening.broken(error)
        return Report(str(root), (opening,), deep)
    stored = _read_statistics(root, opening)
    overview = [
        check_totals(info, episodes, tasks),
        check_episodes(episodes),
        check_tasks(tasks, episodes),
        check_files(root, info, episodes),
        _collected(root, info, episodes),
    ]
    unique = _unique(episodes)
    videos = Videos(root, info, unique, deep)
    progress = _Progress(len(unique) + sum(map(len, videos.files.values())), on_progress)
    rows = _Rows(root, info, unique, tasks, stored)
    rows.run(progress)
    videos.run(progress)
    return Report(str(root), (opening, *overview, *rows.checks, videos.frames, videos.pictures), deep)


class _Progress:
    def __init__(self, total: int, told: OnProgress | None) -> None:
        self._total, self._told, self._done = total, told, 0

    def __call__(self, steps: int, what: str) -> None:
        self._done += steps
        if self._told is not None:
            self._told(self._done, self._total, what)


class _Rows:
    """Reads the data files once and puts every episode before the checks of rows."""

    def __init__(
        self,
        root: Path,
        info: Info,
        episodes: tuple[Episode, ...],
        tasks: Mapping[int, str],
        stored: Mapping[str, Any] | None,
    ) -> None:
        self._root, self._info, self._episodes = root, info, episodes
        self._schema = Check("schema", "Have the data files the columns that meta/info.json promises?")
        self._shapes = Check("shapes", "Has every frame a value of the promised shape?")
        self._belonging = Check("rows", "Has every episode its rows, in one piece, and every row an episode?")
        statistics = Statistics(info, stored, sum(episode.length for episode in episodes))
        self._asked: tuple[RowCheck, ...] = (
            Indices(), Timestamps(info), Finite(), Motion(info), Tasks(tasks), Subtasks(info),
            Duplicates(info), statistics,
        )  # fmt: skip
        asked = (one.check for one in self._asked)
        self.checks = (self._schema, self._belonging, self._shapes, *asked, statistics.by_episode)

    def run(self, progress: _Progress) -> None:
        """Ask; `progress` is told of each episode."""
        position = 0
        wanted = {self._root / episode.data for episode in self._episodes}
        for path in sorted(wanted.union(parquet_files(self._root / "data"))):
            name = path.relative_to(self._root).as_posix()
            try:
                file = DataFile(path, name)
                self._check_schema(file)
                self._visit(file, position, progress)
                position += file.length
            except DatasetError as error:
                self._belonging.broken(error)
                position += sum(episode.length for episode in self._episodes if episode.data == name)
        for one in self._asked:
            one.finish()

    def _check_schema(self, file: DataFile) -> None:
        for feature in self._info.stored:
            if feature.name not in file.columns:
                self._schema.problem(file.where, f"has no column {feature.name}", "Write the dataset anew.")
            elif not type_fits(feature, file.columns[feature.name]):
                kind = file.columns[feature.name]
                self._schema.problem(file.where, f"{feature.name} is {kind}, meta/info.json says {feature.dtype}")
        if extra := sorted(set(file.columns) - {feature.name for feature in self._info.stored}):
            self._schema.warning(file.where, f"has columns that meta/info.json lacks: {named(extra)}")

    def _visit(self, file: DataFile, position: int, progress: _Progress) -> None:
        belongs = file.column("episode_index")
        expected = [episode for episode in self._episodes if episode.data == file.where]
        known = np.isin(belongs, [episode.index for episode in expected])
        if not known.all():
            strange = named(np.unique(belongs[~known]).tolist())
            self._belonging.problem(file.where, f"has {int((~known).sum())} rows of unknown episodes ({strange})")
        for episode in expected:
            rows = np.flatnonzero(belongs == episode.index)
            if self._in_one_piece(file, episode, rows):
                start, stop = int(rows[0]), int(rows[-1]) + 1
                columns, subtasks = self._columns(file, episode, start, stop), self._subtasks(file, start, stop)
                for one in self._asked:
                    one.visit(EpisodeRows(episode, position + start, columns, subtasks))
            progress(1, file.where)

    def _in_one_piece(self, file: DataFile, episode: Episode, rows: NDArray[np.intp]) -> bool:
        where = f"{file.where}, {episode.name}"
        if len(rows) != episode.length:
            self._belonging.problem(where, f"has {len(rows)} rows, meta/episodes says {episode.length}")
        if len(rows) and (np.diff(rows) != 1).any():
            self._belonging.problem(where, "its rows are not in one piece", "Sort the rows by index.")
            return False
        return len(rows) > 0

    def _columns(self, file: DataFile, episode: Episode, start: int, stop: int) -> dict[str, NDArray[Any]]:
        features = [f for f in self._info.stored if f.name in file.columns and f.dtype not in ("string", "image")]
        table = file.table(start, stop, tuple(feature.name for feature in features))
        columns: dict[str, NDArray[Any]] = {}
        for feature in features:
            try:
                column = values(table[feature.name], feature.shape)
            except ValueError as error:
                self._shapes.problem(f"{file.where}, {episode.name}", f"{feature.name} {error}", "Write it anew.")
                continue
            if column.dtype.kind in "biuf":
                columns[feature.name] = column
            elif feature.name in BOOKKEEPING or feature.is_vector:
                self._shapes.problem(f"{file.where}, {episode.name}", f"{feature.name} holds no numbers")
        return columns

    def _subtasks(self, file: DataFile, start: int, stop: int) -> tuple[str, ...]:
        """The texts of the rows; none where they are missing or no texts, which the schema's check says."""
        feature = self._info.features.get("subtask")
        if feature is None or "subtask" not in file.columns or not type_fits(feature, file.columns["subtask"]):
            return ()
        return texts(file.table(start, stop, ("subtask",))["subtask"])


def _read_statistics(root: Path, check: Check) -> Mapping[str, Any] | None:
    try:
        stored = load_json(root / STATS, STATS)
    except DatasetError as error:
        check.broken(error)
        return None
    if not isinstance(stored, dict):
        check.problem(STATS, "is no JSON object")
        return None
    return stored


def _collected(root: Path, info: Info, episodes: tuple[Episode, ...]) -> Check:
    try:
        return check_collected(read_collected(root), info, episodes, None)
    except DatasetError as error:
        return check_collected(None, info, episodes, error)


def _unique(episodes: tuple[Episode, ...]) -> tuple[Episode, ...]:
    """One episode for each number and file; that numbers are there twice was found already."""
    return tuple({(episode.index, episode.data): episode for episode in episodes}.values())
