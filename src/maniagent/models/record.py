"""Exchanges written into a folder as they happen: what was written before a crash is readable after it.

exchanges.jsonl has a line for each exchange; the pictures lie beside it as PNG, each once, named by their pixels.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import UsageError
from .exchange import Exchange
from .pictures import fingerprint, to_png
from .question import Picture

EXCHANGES, PICTURES = "exchanges.jsonl", "pictures"
VERSION = 1
"""Of the lines' format."""


class ExchangeRecorder:
    """An OnExchange that appends to a folder."""

    def __init__(self, folder: Path) -> None:
        """Creates the folder where it is missing; an earlier recording in it goes on."""
        self._folder = folder
        (folder / PICTURES).mkdir(parents=True, exist_ok=True)

    def __call__(self, exchange: Exchange) -> None:
        """Write one exchange: its pictures first, so that a line never names one that isn't there."""
        for part in exchange.parts:
            if isinstance(part, Picture):
                self._keep(part)
        path = self._folder / EXCHANGES
        line = (json.dumps(_to_plain(exchange), ensure_ascii=True, allow_nan=False) + "\n").encode()
        with path.open("ab") as file:
            if file.tell() and not _ends_a_line(path):
                line = b"\n" + line  # after a crash in the middle of a line
            file.write(line)
            file.flush()
            os.fsync(file.fileno())

    def _keep(self, picture: Picture) -> None:
        path = self._folder / _picture_path(fingerprint(picture.rgb))
        if path.exists():
            return
        part = path.with_suffix(f".{os.getpid()}.part")
        part.write_bytes(to_png(picture.rgb))
        part.replace(path)


def _ends_a_line(path: Path) -> bool:
    with path.open("rb") as file:
        file.seek(-1, os.SEEK_END)
        return file.read(1) == b"\n"


def _picture_path(picture: str) -> str:
    return f"{PICTURES}/{picture}.png"


def _to_plain(exchange: Exchange) -> dict[str, Any]:
    names = ("role", "model", "instructions", "form", "mode", "answers", "complaints", "answer", "failure", "error")
    counts = ("tokens_in", "tokens_out", "seconds", "attempts", "repairs", "money")
    plain: dict[str, Any] = {"version": VERSION} | {name: getattr(exchange, name) for name in names + counts}
    plain["seconds"] = round(exchange.seconds, 3)
    plain["parts"] = [
        part if isinstance(part, str) else {"name": part.name, "picture": _picture_path(fingerprint(part.rgb))}
        for part in exchange.parts
    ]
    return plain


@dataclass(frozen=True)
class Recorded:
    """An exchange as it stands in a recording: pictures by their path in the folder."""

    role: str
    model: str
    instructions: str
    parts: tuple[str | tuple[str, str], ...]
    """Texts, and pictures as (name, path)."""
    form: str
    answer: Mapping[str, Any] | None
    failure: str | None
    error: str
    plain: Mapping[str, Any]
    """The whole line."""

    def key(self, *, pictures: bool = True) -> str:
        """What exchanges share that ask the same; without `pictures`, whatever is on them."""
        parts = [part if isinstance(part, str) else ["picture", part[1] if pictures else ""] for part in self.parts]
        asked = json.dumps([self.role, self.instructions, self.form, parts])
        return hashlib.sha256(asked.encode()).hexdigest()


def as_recorded(role: str, instructions: str, parts: Sequence[str | Picture], form: str) -> Recorded:
    """A question in the form in which a recording holds it, not answered."""
    told = tuple(part if isinstance(part, str) else (part.name, _picture_path(fingerprint(part.rgb))) for part in parts)
    return Recorded(role, "", instructions, told, form, None, None, "", {})


def read_exchanges(folder: Path) -> tuple[Recorded, ...]:
    """The exchanges of a recording, in order; a line that a crash cut short is left out.

    Raises UsageError where there is no recording, or one that isn't ours.
    """
    path = folder / EXCHANGES
    try:
        lines = path.read_text(encoding="utf-8", errors="replace").split("\n")
    except OSError as error:
        raise UsageError(f"{folder} holds no recorded exchanges ({EXCHANGES}): {error.strerror}.") from error
    return tuple(_from_lines(lines, path))


def _from_lines(lines: Sequence[str], path: Path) -> Iterator[Recorded]:
    for number, line in enumerate(lines, 1):
        if not line.strip():
            continue
        try:
            plain = json.loads(line)
        except json.JSONDecodeError:
            continue  # cut short; whoever went on recording began a new line
        if not isinstance(plain, dict) or plain.get("version") != VERSION:
            raise UsageError(f"{path}, line {number}: not an exchange that this version of maniagent wrote.")
        try:
            yield _from_plain(plain)
        except (KeyError, TypeError) as error:
            raise UsageError(f"{path}, line {number}: not a whole exchange ({error}).") from error


def _from_plain(plain: Mapping[str, Any]) -> Recorded:
    parts = tuple(part if isinstance(part, str) else (part["name"], part["picture"]) for part in plain["parts"])
    names = ("role", "model", "instructions", "form", "answer", "failure", "error")
    return Recorded(parts=parts, plain=plain, **{name: plain[name] for name in names})
