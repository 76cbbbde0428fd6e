"""Whether what a dataset says of itself agrees: files, totals, episodes, tasks, and our collector's own lines."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from pathlib import Path

from ...episode import EpisodeInfo
from ..findings import Check, named
from ..layout import COLLECTED, EPISODES, INFO, TASKS, DatasetError, Info, inside
from ..reading import Episode

_COPY = "Copy it from where the dataset was made."


def check_files(root: Path, info: Info, episodes: tuple[Episode, ...]) -> Check:
    """Every file that an episode lies in is there; nothing lies about that belongs to none."""
    check = Check("files", "Is every file there that an episode lies in, and no other?")
    wanted = {episode.data for episode in episodes}
    wanted |= {clip.file for episode in episodes for clip in episode.clips.values()}
    for relative in sorted(wanted):
        try:
            if not inside(root, relative, EPISODES).is_file():
                check.problem(relative, "is missing", _COPY)
        except DatasetError as error:
            check.broken(error)
    for folder, pattern, of in (("data", "*.parquet", "LeRobot loads it all the same."), ("videos", "*.mp4", "")):
        for path in sorted((root / folder).rglob(pattern)):
            if (relative := path.relative_to(root).as_posix()) not in wanted:
                report = check.problem if of else check.warning
                report(relative, "belongs to no episode", f"{of} Move it out of the dataset.".strip())
    if any((root / "images").glob("*/*")) and not any(info.features[name].dtype == "image" for name in info.pictures):
        check.warning("images", "holds pictures that were not made into a video", "Recording broke off; remove it.")
    return check


def check_totals(info: Info, episodes: tuple[Episode, ...], tasks: Mapping[int, str]) -> Check:
    """meta/info.json counts as the other files do."""
    check = Check("totals", "Does meta/info.json count the episodes, frames and tasks that are there?")
    frames = sum(episode.length for episode in episodes)
    counted = (("total_episodes", info.total_episodes, len(episodes)), ("total_frames", info.total_frames, frames))
    for key, said, found in (*counted, ("total_tasks", info.total_tasks, len(tasks))):
        if said != found:
            check.problem(INFO, f"{key} is {said}, but there are {found}", "Recording broke off: recover the dataset.")
    if not episodes:
        check.problem(EPISODES, "has no episode")
    return check


def check_episodes(episodes: tuple[Episode, ...]) -> Check:
    """The episodes follow each other without gaps."""
    check = Check("episodes", "Are episodes numbered from 0 without gaps, and do their frames follow each other?")
    stop = 0
    for number, episode in enumerate(episodes):
        if episode.index != number:
            check.problem(EPISODES, f"episode_index is {episode.index} in row {number}", "Number the episodes anew.")
        if episode.length == 0:
            check.problem(episode.name, "has no frame", "Leave it out.")
        if episode.stop - episode.start != episode.length:
            what = f"length is {episode.length}, but it goes from frame {episode.start} to {episode.stop}"
            check.problem(episode.name, what)
        if episode.start != stop:
            check.problem(episode.name, f"begins at frame {episode.start}, the one before ends at {stop}")
        stop = episode.stop
    return check


def check_tasks(tasks: Mapping[int, str], episodes: tuple[Episode, ...]) -> Check:
    """Every episode says in words what was to be done, in words that the list of tasks has."""
    check = Check("tasks", "Has every episode a task, and every task a text?")
    if list(tasks) != list(range(len(tasks))):  # LeRobot looks tasks up by row
        check.problem(TASKS, "its rows are not in the order of task_index", "Sort them by task_index.")
    for number, text in tasks.items():
        if not text.strip():
            check.problem(TASKS, f"task {number} has no text", "Say in words what was to be done.")
    for text, count in Counter(tasks.values()).items():
        if count > 1:
            check.problem(TASKS, f"has {text!r} {count} times")
    known, used = set(tasks.values()), set[str]()
    for episode in episodes:
        used |= set(episode.tasks)
        if not episode.tasks:
            check.problem(episode.name, "has no task", "Say in words what was to be done.")
        if unknown := [text for text in episode.tasks if text not in known]:
            check.problem(episode.name, f"has tasks that {TASKS} lacks: {named(map(repr, unknown), 3)}")
    if unused := sorted(known - used):
        check.warning(TASKS, f"has tasks that no episode has: {named(map(repr, unused), 3)}")
    return check


def check_collected(
    infos: tuple[EpisodeInfo, ...] | None, info: Info, episodes: tuple[Episode, ...], broken: DatasetError | None
) -> Check:
    """meta/maniagent.jsonl has a line for each episode, of that episode."""
    check = Check("collection", f"Does {COLLECTED} tell of these episodes?")
    if broken is not None:
        check.broken(broken)
        return check
    if infos is None:
        check.skipped = f"there is no {COLLECTED}: another program collected the dataset"
        return check
    if len(infos) != len(episodes):
        check.problem(COLLECTED, f"has {len(infos)} lines for {len(episodes)} episodes", "Publish the collection anew.")
    for key, count in Counter(line.key for line in infos).items():
        if count > 1:
            check.problem(COLLECTED, f"has {key!r} {count} times: an episode was published twice")
    for line, episode in zip(infos, episodes, strict=False):
        where = f"{COLLECTED}, line {episode.index + 1}"
        if not {line.instruction, *line.paraphrases} & set(episode.tasks):
            check.problem(where, f"says {line.instruction!r}, {episode.name} {named(map(repr, episode.tasks), 3)}")
        if abs(line.fps - info.fps) > 1e-6:
            check.problem(where, f"was recorded at {line.fps:g} frames a second, the dataset has {info.fps:g}")
        if line.label != "valid":
            check.warning(where, f"{line.key} is labelled {line.label}", "Leave it out, or train on it knowingly.")
    return check
