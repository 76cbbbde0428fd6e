"""The writer as a process: started, asked, and ended; a dead or a stuck one is an error that says why."""

from __future__ import annotations

import contextlib
import errno
import json
import os
import selectors
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import IO, Any, Self

from ...errors import ManiAgentError, SetupError
from ..disk import FULL
from .interpreter import HOW, find_interpreter

SCRIPT = Path(__file__).with_name("writer.py")
CODEC = "h264"
"""The videos' codec, of new datasets; an old one keeps its own. "libsvtav1" is lerobot's choice (docs/data.md)."""


class WriterFailure(ManiAgentError):
    """The process that writes datasets refused, died or did not answer; the dataset is as it was."""


class Writer:
    """A Python that has lerobot, writing datasets on request; a context manager.

    It is started by the first request and serves any number of them; one that failed is ended, and the next request
    starts another. `python` is found by `find_interpreter`; `start_limit` (s) bounds the import of lerobot, `limit`
    (s) each request.
    """

    def __init__(
        self, python: Path | None = None, *, script: Path = SCRIPT, start_limit: float = 180.0, limit: float = 1800.0
    ) -> None:
        self._python, self._script = find_interpreter(python), script
        self._start_limit, self._limit = start_limit, limit
        self._process: subprocess.Popen[bytes] | None = None
        self._scratch: tempfile.TemporaryDirectory[str] | None = None
        self._said: IO[bytes] | None = None
        self._unread = b""
        self._processor_seconds = 0.0

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def check(self) -> None:
        """Raises SetupError where its Python has no lerobot: told in a tenth of a second, not after an hour."""
        asks = "import importlib.util, sys; sys.exit(importlib.util.find_spec('lerobot') is None)"
        try:
            there = subprocess.run([self._python, "-c", asks], capture_output=True, check=False).returncode == 0  # noqa: S603
        except OSError as error:
            raise SetupError(f"{self._python} doesn't start ({error.strerror}). {HOW}") from error
        if not there:
            raise SetupError(f"{self._python} has no lerobot. {HOW}")

    def interrupt(self) -> None:
        """Let the request that is served fail at once; may be called while another thread waits for it."""
        process = self._process
        if process is not None:
            process.kill()

    def append(
        self, dataset: Path, schema: Mapping[str, Any], episodes: Sequence[tuple[Path, str]], codec: str = CODEC
    ) -> float:
        """Add staged episodes, each a folder and the task that LeRobot is told, to a dataset that nobody reads.

        Returns the processor time (s) that it took, the start of the process included where this was its first.
        """
        plain = [{"folder": str(folder.absolute()), "task": task} for folder, task in episodes]
        answer = self._ask(
            {"do": "append", "dataset": str(dataset.absolute()), "schema": schema, "codec": codec, "episodes": plain}
        )
        before, self._processor_seconds = self._processor_seconds, float(answer["processor_seconds"])
        return self._processor_seconds - before

    def merge(self, datasets: Sequence[Path], out: Path) -> None:
        """Make the dataset `out`, which must not be there, of several."""
        self._ask({"do": "merge", "datasets": [str(d.absolute()) for d in datasets], "out": str(out.absolute())})

    def split(self, dataset: Path, parts: Mapping[str, Sequence[int]], out: Path) -> None:
        """Make a dataset in the folder `out` of each part: its name, and its episodes' numbers in `dataset`."""
        plain = {name: [int(episode) for episode in episodes] for name, episodes in parts.items()}
        self._ask({"do": "split", "dataset": str(dataset.absolute()), "parts": plain, "out": str(out.absolute())})

    def close(self) -> None:
        """End the process, and remove what lerobot left in its caches."""
        process, self._process, self._unread = self._process, None, b""
        self._processor_seconds = 0.0
        if process is not None:
            process.kill()  # nothing that it was not asked to finish is worth waiting for
            process.wait()
            for pipe in (process.stdin, process.stdout):
                if pipe is not None:
                    with contextlib.suppress(BrokenPipeError):
                        pipe.close()
        if self._said is not None:
            self._said.close()
            self._said = None
        if self._scratch is not None:
            self._scratch.cleanup()
            self._scratch = None

    def _ask(self, request: Mapping[str, Any]) -> dict[str, Any]:
        """Send a request and return its answer; any failure ends the process."""
        try:
            process = self._process or self._start()
            assert process.stdin is not None  # noqa: S101 - it was opened with pipes
            with contextlib.suppress(BrokenPipeError):  # that it is dead shows where its answer is read, with why
                process.stdin.write(json.dumps(request).encode() + b"\n")
                process.stdin.flush()
            return _unwrap(self._read(process, self._limit, f"to {request['do']}"))
        except BaseException:
            self.close()
            raise

    def _start(self) -> subprocess.Popen[bytes]:
        self._said = tempfile.TemporaryFile()  # noqa: SIM115 - lives as long as the process
        self._scratch = tempfile.TemporaryDirectory(prefix="maniagent-lerobot-")
        self._process = subprocess.Popen(  # noqa: S603 - our own script
            [self._python, self._script], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._said,
            env=_environment(self._python, Path(self._scratch.name)),
        )  # fmt: skip
        _unwrap(self._read(self._process, self._start_limit, "to start"))
        return self._process

    def _read(self, process: subprocess.Popen[bytes], limit: float, what: str) -> dict[str, Any]:
        """The next line that the process answers with, in `limit` seconds."""
        assert process.stdout is not None  # noqa: S101 - it was opened with pipes
        end = time.monotonic() + limit
        with selectors.DefaultSelector() as selector:
            selector.register(process.stdout, selectors.EVENT_READ)
            while b"\n" not in self._unread:
                if not selector.select(end - time.monotonic()):
                    raise WriterFailure(f"The dataset writer took more than {limit:g} s {what}.{self._last_words()}")
                read = os.read(process.stdout.fileno(), 1 << 16)
                if not read:
                    raise self._death(process)
                self._unread += read
        line, self._unread = self._unread.split(b"\n", 1)
        answered: dict[str, Any] = json.loads(line)
        return answered

    def _death(self, process: subprocess.Popen[bytes]) -> ManiAgentError:
        status, words = process.wait(), self._last_words()
        if "No module named 'lerobot" in words:
            return SetupError(f"{self._python} has no lerobot. {HOW}")
        how = f"by signal {-status}" if status < 0 else f"with status {status}"
        return WriterFailure(f"The dataset writer ended {how}.{words}")

    def _last_words(self) -> str:
        if self._said is None:
            return ""
        self._said.seek(max(0, self._said.seek(0, os.SEEK_END) - 4000))
        lines = self._said.read().decode(errors="replace").strip().splitlines()[-5:]
        return " Its last words: " + " | ".join(lines) if lines else ""


def _unwrap(answer: Mapping[str, Any]) -> dict[str, Any]:
    """What an answer holds. Raises SetupError for what the disk refused, WriterFailure for all else."""
    if "ok" in answer:
        held: dict[str, Any] = answer["ok"]
        return held
    error = answer["error"]
    # An encoder's thread hands its error on as text; the number is lost.
    if error["errno"] in FULL or any(os.strerror(number) in error["message"] for number in FULL):
        raise SetupError(f"The disk is full ({error['message']}). Make room and run this again; nothing is lost.")
    if error["errno"] in (errno.EACCES, errno.EROFS, errno.EPERM):
        raise SetupError(f"The dataset can't be written ({error['message']}). Allow it and run this again.")
    raise WriterFailure(f"lerobot refused ({error['kind']}: {error['message']}); the dataset is as it was.")


def _environment(python: Path, scratch: Path) -> dict[str, str]:
    """Ours, but for what would send lerobot to the network, to our packages, or to a cache that nobody clears.

    The table cache that `datasets` keeps would otherwise hold one copy of the dataset for each time it was appended to.
    """
    foreign = python != Path(sys.executable)
    dropped = {"PYTHONPATH", "PYTHONHOME"} if foreign else set()
    return {
        **{name: value for name, value in os.environ.items() if name not in dropped},
        "PYTHONSAFEPATH": "1",  # the script's folder holds modules that are not for it
        "HF_HUB_OFFLINE": "1",
        "HF_DATASETS_CACHE": str(scratch),
        "HF_DATASETS_DISABLE_PROGRESS_BARS": "1",
    }
