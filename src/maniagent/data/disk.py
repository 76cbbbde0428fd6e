"""What to say of a disk that is full, broken or closed, and how a small file is written as a whole."""

from __future__ import annotations

import errno
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..errors import ManiAgentError, SetupError, UsageError

FULL = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG})
"""No room: on the disk, in a quota, or in the largest file that this process may write."""
_BROKEN = frozenset({errno.EIO, errno.ENXIO, errno.ENODEV, errno.ESTALE})


@contextmanager
def disk_errors_told(path: Path, size: int = 0) -> Iterator[None]:
    """Turn the system's errors at a path into ours; `size` (bytes) is that of an episode that is written there.

    Raises SetupError where the disk is full or broken, UsageError where the path may not be written to.
    """
    try:
        yield
    except OSError as error:
        raise _explanation(error, path, size) from error


def draft_of(path: Path) -> Path:
    """Where a file is written before it gets its name; a kill may leave it there."""
    return path.with_name(f".{path.name}.tmp")


def write_whole(path: Path, text: str) -> None:
    """Write a file anew, so that there is the old one or the new one at any moment. Raises as `disk_errors_told`."""
    draft = draft_of(path)
    with disk_errors_told(path):
        try:
            draft.write_text(text, encoding="utf-8")
            draft.replace(path)
        except OSError:
            draft.unlink(missing_ok=True)
            raise


def _explanation(error: OSError, path: Path, size: int) -> ManiAgentError:
    if error.errno in FULL:
        needs = f" for an episode of {size / 1e6:.0f} MB" if size else ""
        return SetupError(f"There is no room on the disk{needs} at {path}. Free some; what was committed is whole.")
    if error.errno in _BROKEN:
        return SetupError(f"The disk fails at {path}: {error.strerror}. What was committed before may need a check.")
    return UsageError(f"{path} can't be written: {error.strerror}. Name another folder, or let yourself write there.")
