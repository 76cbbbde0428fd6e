"""Where episodes wait, each whole or not at all, until they are made part of a dataset.

    <folder>/<key>/               an episode; what lies in it: episode.py
    <folder>/quarantine/<key>/    one that somebody should look at before it is used
    <folder>/.<key>.part/         one that is being written, or was when its process was killed

An episode is written under a name with a dot, forced onto the disk, and renamed: POSIX renames a folder in one piece,
so that whoever is killed, at whatever moment, leaves whole episodes and perhaps one folder with a dot.
"""

from __future__ import annotations

import os
import re
import shutil
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray
from pydantic import ValidationError

from ..errors import UsageError
from .disk import disk_errors_told
from .episode import EpisodeInfo, Recording, Steps

INFO, STEPS = "episode.json", "steps.npz"
QUARANTINE = "quarantine"
_PART = ".part"
_ARRAYS = ("time", "joints", "opening", "tcp", "joint_targets", "opening_target", "tcp_delta")
_CAMERA = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]*")


class Staging:
    """A folder of whole episodes. Several processes may commit to it at once; the keys keep them apart."""

    def __init__(self, folder: Path, *, keep_failed: bool = True) -> None:
        """With `keep_failed=False`, of an attempt with the label "failed" only its EpisodeInfo is kept.

        Raises UsageError where the folder can't be made or written to.
        """
        self.folder = Path(folder)
        self._keep_failed = keep_failed
        with disk_errors_told(self.folder):
            (self.folder / QUARANTINE).mkdir(parents=True, exist_ok=True)
        if not os.access(self.folder, os.W_OK | os.X_OK):
            raise UsageError(f"{self.folder} can't be written to. Name another folder, or let yourself write there.")

    def commit(self, info: EpisodeInfo, recording: Recording | None) -> Path:
        """Keep an episode: it is on the disk when this returns, and no half of it is there where this raises.

        `recording` is None where there is none: of an attempt that failed before anything moved.

        Raises
        ------
        UsageError
            Where there is an episode with this key, in either place, or the folder can't be written to.
        SetupError
            Where the disk is full or broken: nothing that the agents could get over by trying again.

        """
        return self._keep(self.folder, info, recording)

    def quarantine(self, info: EpisodeInfo, recording: Recording | None) -> Path:
        """Keep an episode apart from the others; otherwise as `commit`."""
        return self._keep(self.folder / QUARANTINE, info, recording)

    def episodes(self) -> tuple[Path, ...]:
        """The whole episodes, by key; those in quarantine are not among them."""
        return _whole(self.folder)

    def quarantined(self) -> tuple[Path, ...]:
        """The whole episodes in quarantine, by key."""
        return _whole(self.folder / QUARANTINE)

    def sweep(self) -> int:
        """Remove what killed processes left half written; returns how many episodes that were.

        To be called before anybody writes: what a living process is writing looks the same.
        """
        with disk_errors_told(self.folder):
            left = [path for place in (self.folder, self.folder / QUARANTINE) for path in place.glob(f".*{_PART}/")]
            for path in left:
                shutil.rmtree(path)
        return len(left)

    def _keep(self, place: Path, info: EpisodeInfo, recording: Recording | None) -> Path:
        if info.key == QUARANTINE:
            raise UsageError(f"An episode can't have the key {QUARANTINE!r}: that folder is taken.")
        for taken in (self.folder / info.key, self.folder / QUARANTINE / info.key):
            if taken.exists():
                raise UsageError(f"There is an episode {taken} already. Give every episode a key of its own.")
        if info.label == "failed" and not self._keep_failed:
            recording = None
        final, draft = place / info.key, place / f".{info.key}{_PART}"
        size = 0 if recording is None else sum(array.nbytes for array in _pictures(recording).values())
        with disk_errors_told(final, size):
            try:
                shutil.rmtree(draft, ignore_errors=True)  # of a process that was killed while it wrote this one
                draft.mkdir()
                _write_episode(draft, info, recording)
                draft.rename(final)
            except BaseException:
                shutil.rmtree(draft, ignore_errors=True)
                raise
            _sync_folder(place)
        return final


def load(path: Path) -> tuple[EpisodeInfo, Recording | None]:
    """An episode's info and its recording, if one was kept; pictures are mapped into memory, not read.

    Raises UsageError where the folder holds no whole episode.
    """
    try:
        info = EpisodeInfo.model_validate_json((path / INFO).read_bytes())
        if not (path / STEPS).exists():
            return info, None
        with np.load(path / STEPS, allow_pickle=False) as held:
            steps = Steps(**{name: held[name] for name in _ARRAYS}, subtasks=tuple(held["subtasks"].tolist()))
        return info, Recording(steps, rgb=_mapped(path, "rgb"), depth=_mapped(path, "depth"))
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
        raise UsageError(f"{path} holds no whole episode ({error}). Remove it, and collect it again.") from error


def read_info(path: Path) -> EpisodeInfo:
    """What is known of an episode. Raises UsageError where its folder says nothing that can be read."""
    try:
        return EpisodeInfo.model_validate_json((path / INFO).read_bytes())
    except (OSError, ValidationError) as error:
        what = "it isn't whole" if isinstance(error, ValidationError) else str(error.strerror)
        raise UsageError(f"{path / INFO} can't be read: {what}. Move the episode out of the folder.") from error


def _mapped(path: Path, kind: str) -> dict[str, NDArray[Any]]:
    files = sorted(path.glob(f"{kind}-*.npy"))
    return {file.stem.removeprefix(f"{kind}-"): np.load(file, mmap_mode="r", allow_pickle=False) for file in files}


def _whole(place: Path) -> tuple[Path, ...]:
    return tuple(sorted(path.parent for path in place.glob(f"*/{INFO}") if not path.parent.name.startswith(".")))


# Writing --------------------------------------------------------------------------------------------------------


def _write_episode(draft: Path, info: EpisodeInfo, recording: Recording | None) -> None:
    """Write all files of an episode, and force them and their names onto the disk."""
    if recording is not None:
        with _synced(draft / STEPS) as file:
            np.savez(file, allow_pickle=False, **_numbers(recording.steps))
        for name, pictures in _pictures(recording).items():
            with _synced(draft / f"{name}.npy") as file:
                _write_array(file, pictures)
    with _synced(draft / INFO) as file:
        file.write(info.model_dump_json(indent=2).encode() + b"\n")
    _sync_folder(draft)


def _numbers(steps: Steps) -> dict[str, NDArray[Any]]:
    return {name: getattr(steps, name) for name in _ARRAYS} | {"subtasks": np.array(steps.subtasks, dtype=np.str_)}


def _pictures(recording: Recording) -> dict[str, NDArray[Any]]:
    """All pictures by the stem of their file. Raises UsageError where a camera's name would be no file's name."""
    for camera in recording.rgb:
        if not _CAMERA.fullmatch(camera):
            raise UsageError(f"A camera called {camera!r} can't be kept: use letters, digits, _ . and - for its name.")
    named: dict[str, NDArray[Any]] = {f"rgb-{camera}": pictures for camera, pictures in recording.rgb.items()}
    return named | {f"depth-{camera}": pictures for camera, pictures in recording.depth.items()}


def _write_array(file: IO[bytes], array: NDArray[Any]) -> None:
    """As `np.save`, which says nothing of why it failed: its OSError on a full disk has no errno."""
    array = np.ascontiguousarray(array)
    npy.write_array_header_1_0(file, npy.header_data_from_array_1_0(array))
    file.write(array.reshape(-1).view(np.uint8).data)


@contextmanager
def _synced(path: Path) -> Iterator[IO[bytes]]:
    """A new file, forced onto the disk in the end."""
    with path.open("wb") as file:
        yield file
        file.flush()
        os.fsync(file.fileno())


def _sync_folder(path: Path) -> None:
    """Force a folder's names onto the disk: a file that is on the disk without its name is lost."""
    descriptor = os.open(path, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
