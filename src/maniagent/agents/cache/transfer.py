"""The cache as a JSON file, to look at, to keep under version control, to hand to others; and back, mistrusted."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Literal

from pydantic import AwareDatetime, BaseModel, ConfigDict, Field, ValidationError, model_validator

from ...errors import UsageError
from ...types import ActionSequence
from .entry import Entry, Key, Kind, may_keep
from .store import CacheStore
from .wording import normal_form, places

_LARGEST_FILE = 64 * 2**20
"""Bytes; more is no export of ours."""

Count = Annotated[int, Field(ge=0, le=10**9, strict=True)]


class _Exported(BaseModel):
    """One entry in the file."""

    model_config = ConfigDict(extra="forbid")

    kind: Kind
    wording: Annotated[str, Field(min_length=1, max_length=2000)]
    objects: Annotated[tuple[Annotated[str, Field(min_length=1, max_length=500)], ...], Field(max_length=64)]
    successes: Annotated[int, Field(ge=1, le=10**9, strict=True)]
    failures: Count
    failed_running: Annotated[int, Field(ge=0, le=1, strict=True)]
    created: AwareDatetime
    judged: AwareDatetime
    sequence: ActionSequence

    @model_validator(mode="after")
    def _could_have_been_written_here(self) -> _Exported:
        if self.kind is Kind.FORM and (
            self.objects != places(len(self.objects)) or normal_form(self.wording, self.objects) != self.wording
        ):
            raise ValueError(f"{self.wording!r} is no normal form of {len(self.objects)} objects")
        if not may_keep(self.key, self.sequence):
            raise ValueError("the sequence names an object or a place that its wording doesn't")
        return self

    @property
    def key(self) -> Key:
        return Key(self.kind, self.wording, self.objects)

    @property
    def entry(self) -> Entry:
        created, judged = self.created.isoformat(), self.judged.isoformat()
        return Entry(0, self.key, self.sequence, self.successes, self.failures, self.failed_running, created, judged)


class _Export(BaseModel):
    model_config = ConfigDict(extra="forbid")

    format: Literal["maniagent-cache"] = "maniagent-cache"
    version: Literal[1] = 1
    entries: Annotated[tuple[_Exported, ...], Field(max_length=100_000)]


def export(store: CacheStore) -> str:
    """All entries as one JSON value."""
    return json.dumps(
        {"format": "maniagent-cache", "version": 1, "entries": [plain(entry) for entry in store.entries()]},
        ensure_ascii=False,
        indent=2,
    )


def plain(entry: Entry) -> dict[str, object]:
    """One entry as the file holds it, without its id, which is this cache's own."""
    return {
        "kind": entry.key.kind.value,
        "wording": entry.key.wording,
        "objects": list(entry.key.objects),
        "successes": entry.successes,
        "failures": entry.failures,
        "failed_running": entry.failed_running,
        "created": entry.created,
        "judged": entry.judged,
        "sequence": entry.sequence.model_dump(mode="json"),
    }


def import_file(store: CacheStore, path: Path) -> tuple[int, int]:
    """Add the entries of an exported file where nothing is kept under their keys; how many were added, and not.

    Raises UsageError, with nothing added, where the file can't be read or any entry is not what this cache could
    have written itself.
    """
    try:
        if path.stat().st_size > _LARGEST_FILE:
            raise UsageError(f"{path} is too large for an exported cache.")
        exported = _Export.model_validate_json(path.read_bytes())
    except OSError as error:
        raise UsageError(f"{path} can't be read: {error.strerror}.") from error
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(map(str, first["loc"])) or "the file"
        raise UsageError(f"{path} is no exported cache: {where}: {first['msg']}. Nothing was imported.") from error
    added = store.add([one.entry for one in exported.entries])
    return added, len(exported.entries) - added
