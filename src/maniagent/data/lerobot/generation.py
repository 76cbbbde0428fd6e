"""Changing a dataset as a whole: work on a copy, then put the copy in its place at one moment.

LeRobot's files can't be read while they are written (a parquet file has no footer until it is closed, meta/*.json are
written over in place), so whatever is to change is changed in a copy beside the dataset. The copy costs little: the
large files are hard links, since lerobot only adds new ones when it goes on with a dataset. Once all of the copy is on
the disk, it and the dataset change names. A kill at any moment leaves the one or the other.

Exchanging two folders' names is one system call where Linux and the file system offer it (renameat2, with
RENAME_EXCHANGE); elsewhere it takes two renames, and `recover` mends what a kill between them leaves. A symbolic link
to the newest folder would change in one step everywhere, but then what users copy and move is the link.
"""

from __future__ import annotations

import contextlib
import ctypes
import errno
import fcntl
import os
import shutil
import time
import uuid
from collections.abc import Callable, Iterator
from pathlib import Path

from ...errors import UsageError

_OLD = "old"
_LINKED = ("data", "videos", "meta/episodes")
"""Where lerobot only ever adds files."""
_AT_FDCWD, _RENAME_EXCHANGE = -100, 2
_NO_EXCHANGE = (errno.EINVAL, errno.ENOSYS, errno.ENOTSUP)
_NO_LINK = (errno.EPERM, errno.EXDEV, errno.EMLINK, errno.ENOTSUP, errno.ENOSYS)


@contextlib.contextmanager
def locked(folder: Path, wait: float = 10.0, *, name: str = ".publish.lock") -> Iterator[None]:
    """Be the only process that changes what is in the folder, of those that lock the same `name` there.

    Raises UsageError where another one still does after `wait` seconds; one that is killed lets go at once.
    """
    end = time.monotonic() + wait
    with (folder / name).open("w") as file:
        while True:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except BlockingIOError as error:
                if time.monotonic() >= end:
                    raise UsageError(f"Another process is changing {folder}. Wait until it is done.") from error
                time.sleep(0.05)
        yield


def recover(dataset: Path) -> None:
    """Mend what killed processes left: the dataset under its name again, and nothing beside it.

    The caller holds the lock.
    """
    scratch = _scratch(dataset)
    for one in scratch.glob("*"):
        _restore(dataset, one)
    shutil.rmtree(scratch, ignore_errors=True)


def _scratch(dataset: Path) -> Path:
    return dataset.with_name(f".{dataset.name}.next")


def _restore(dataset: Path, scratch: Path) -> None:
    if not dataset.exists() and (scratch / _OLD).exists():
        (scratch / _OLD).rename(dataset)


@contextlib.contextmanager
def next_generation(dataset: Path) -> Iterator[Path]:
    """A path at which to change a copy of the dataset (where there is none: to make it), then put it in its place.

    Where the body raises, the dataset stays as it was. Whoever changes a dataset that others may change too holds the
    lock and has recovered.
    """
    scratch = _scratch(dataset) / uuid.uuid4().hex  # a name of its own: an orphaned writer may still be at work
    scratch.mkdir(parents=True)
    new = scratch / "new"
    try:
        if dataset.exists():
            _copy(dataset, new)
        yield new
        _sync(new)
        _put_in_place(new, dataset, scratch)
    finally:
        _restore(dataset, scratch)  # whatever stopped this
        shutil.rmtree(scratch, ignore_errors=True)
        with contextlib.suppress(OSError):  # another's work may lie there
            scratch.parent.rmdir()


def _copy(dataset: Path, copy: Path) -> None:
    shutil.copytree(dataset, copy, copy_function=shutil.copy2, ignore=_linked_folders(dataset))
    for folder in _LINKED:
        if (dataset / folder).exists():
            shutil.copytree(dataset / folder, copy / folder, copy_function=_link)


def _linked_folders(dataset: Path) -> Callable[[str, list[str]], set[str]]:
    """For copytree: which of a folder's names not to copy."""
    linked = {dataset / folder for folder in _LINKED}
    return lambda folder, names: {name for name in names if Path(folder) / name in linked}


def _link(source: str, target: str) -> None:
    try:
        os.link(source, target)
    except OSError as error:
        if error.errno not in _NO_LINK:
            raise
        shutil.copy2(source, target)


def _sync(folder: Path) -> None:
    """Have all that is new in the folder on the disk; a file that has two names was there before."""
    for place, _, names in os.walk(folder):
        for path in (Path(place), *(Path(place) / name for name in names)):
            if path.is_dir() or path.stat().st_nlink == 1:
                sync_path(path)


def sync_path(path: Path) -> None:
    """Have a file, or which names a folder holds, on the disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _put_in_place(new: Path, dataset: Path, scratch: Path) -> None:
    if not dataset.exists():
        new.rename(dataset)
    elif not exchange(new, dataset):
        dataset.rename(scratch / _OLD)
        new.rename(dataset)
    sync_path(dataset.parent)


def exchange(one: Path, other: Path) -> bool:
    """Let two paths change names at one moment; False where this system can't."""
    rename = getattr(ctypes.CDLL(None, use_errno=True), "renameat2", None)
    if rename is None:
        return False
    if rename(_AT_FDCWD, os.fsencode(one), _AT_FDCWD, os.fsencode(other), _RENAME_EXCHANGE) == 0:
        return True
    number = ctypes.get_errno()
    if number in _NO_EXCHANGE:
        return False
    raise OSError(number, os.strerror(number), str(one), None, str(other))
