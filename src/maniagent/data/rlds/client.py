"""The writer as a process: started, fed with episodes, and asked what it wrote."""

from __future__ import annotations

import contextlib
import errno
import json
import os
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import IO, Any

from ...errors import ManiAgentError, SetupError
from ..interpreter import interpreter_with

VARIABLE = "MANIAGENT_TFDS_PYTHON"
SCRIPT = Path(__file__).with_name("writer.py")
LIMIT = 600.0
"""s that the writer may take for its start, for an episode, and for the end."""
HOW = (
    "Install it beside maniagent (pip install 'maniagent[rlds]'), or name a Python that has it, such as that of "
    f"OpenVLA's own environment, with --tfds-python or {VARIABLE}. One of its own takes 2 GB: python3.11 -m venv tfds; "
    "tfds/bin/pip install tensorflow tensorflow-datasets importlib-resources."
)


class WriterFailure(ManiAgentError):
    """The process that writes RLDS datasets refused, died or did not answer; nothing was made."""


def find_interpreter(named: Path | None = None) -> Path:
    """The interpreter named, else that in MANIAGENT_TFDS_PYTHON, else this one. Raises as `interpreter_with`."""
    return interpreter_with(("tensorflow_datasets", "tensorflow"), named, VARIABLE, HOW)


def write(
    python: Path, request: Mapping[str, Any], episodes: Iterable[bytes], *, script: Path = SCRIPT, limit: float = LIMIT
) -> dict[str, int]:
    """Have the dataset written that `request` describes (writer.py), and return the counts of what was read back.

    Episodes are packed while the one before is written. Raises SetupError where that Python has no
    tensorflow_datasets or the disk refuses, WriterFailure for all else; whatever `episodes` raises comes through.
    """
    with tempfile.TemporaryFile() as said:
        process = subprocess.Popen(  # noqa: S603 - our own script
            [python, script], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=said, env=_environment(python)
        )
        try:
            return _converse(process, request, episodes, python, said, limit)
        finally:
            process.kill()  # it has answered, or nobody waits for its answer
            process.wait()
            for pipe in (process.stdin, process.stdout):
                if pipe is not None:
                    with contextlib.suppress(BrokenPipeError):
                        pipe.close()


def _converse(
    process: subprocess.Popen[bytes], request: Mapping[str, Any], episodes: Iterable[bytes], python: Path,
    said: IO[bytes], limit: float,
) -> dict[str, int]:  # fmt: skip
    stdin, stdout = process.stdin, process.stdout
    assert stdin is not None  # noqa: S101 - it was opened with pipes
    assert stdout is not None  # noqa: S101
    watch = _Watch(process, limit)

    def answer() -> dict[str, int]:
        with watch:
            line = stdout.readline()
        if not line:
            raise _death(process, python, said, watch)
        return _unwrap(json.loads(line))

    answer()
    try:
        stdin.write(json.dumps(request).encode() + b"\n")
        for episode in episodes:
            with watch:
                stdin.write(len(episode).to_bytes(8, "big") + episode)
        stdin.write(bytes(8))
        stdin.flush()
    except BrokenPipeError:
        pass  # it ended early, and its answer says why
    return answer()


class _Watch:
    """Ends a process that keeps us waiting for longer than a limit (s), while it is entered."""

    def __init__(self, process: subprocess.Popen[bytes], limit: float) -> None:
        self._process, self.limit = process, limit
        self.has_struck = False

    def __enter__(self) -> None:
        self._timer = threading.Timer(self.limit, self._strike)
        self._timer.daemon = True
        self._timer.start()

    def __exit__(self, *_: object) -> None:
        self._timer.cancel()

    def _strike(self) -> None:
        self.has_struck = True
        self._process.kill()


def _death(process: subprocess.Popen[bytes], python: Path, said: IO[bytes], watch: _Watch) -> ManiAgentError:
    status, words = process.wait(), " | ".join(_last_words(said))
    if watch.has_struck:
        return WriterFailure(f"The RLDS writer took more than {watch.limit:g} s. Its last words: {words}")
    if "No module named 'tensorflow" in words:
        return SetupError(f"{python} has no tensorflow_datasets. {HOW}")
    how = f"by signal {-status}" if status < 0 else f"with status {status}"
    return WriterFailure(f"The RLDS writer ended {how}. Its last words: {words}")


def _last_words(said: IO[bytes]) -> Iterator[str]:
    said.seek(max(0, said.seek(0, os.SEEK_END) - 4000))
    yield from said.read().decode(errors="replace").strip().splitlines()[-5:]


def _unwrap(answer: Mapping[str, Any]) -> dict[str, int]:
    """What an answer holds. Raises SetupError for what the disk refused, WriterFailure for all else."""
    if "ok" in answer:
        held: dict[str, int] = answer["ok"]
        return held
    error = answer["error"]
    if error["errno"] == errno.ENOSPC or os.strerror(errno.ENOSPC) in error["message"]:  # TensorFlow's have no number
        raise SetupError(f"The disk is full ({error['message']}). Make room and run this again; nothing is lost.")
    if error["errno"] in (errno.EACCES, errno.EROFS, errno.EPERM, errno.EDQUOT):
        raise SetupError(f"The dataset can't be written ({error['message']}). Allow it and run this again.")
    raise WriterFailure(f"tensorflow_datasets refused ({error['kind']}: {error['message']}); nothing was made.")


def _environment(python: Path) -> dict[str, str]:
    """Ours, but for what would lead another interpreter to our packages; no GPU is taken from whoever trains on it."""
    dropped = {"PYTHONPATH", "PYTHONHOME"} if python != Path(sys.executable) else set()
    return {
        **{name: value for name, value in os.environ.items() if name not in dropped},
        "PYTHONSAFEPATH": "1",  # the script's folder holds modules that are not for it
        "CUDA_VISIBLE_DEVICES": "-1",
        "TF_CPP_MIN_LOG_LEVEL": "2",
    }
