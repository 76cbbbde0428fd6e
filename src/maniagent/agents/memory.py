"""What the agents remember of the run: the sub-tasks tried, on which objects, and what came of each."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from ..types import SubtaskRecord, Verdict


class Memory:
    """The records of past sub-tasks, oldest first."""

    def __init__(self) -> None:
        self._records: list[SubtaskRecord] = []

    def __iter__(self) -> Iterator[SubtaskRecord]:
        return iter(self._records)

    def __len__(self) -> int:
        return len(self._records)

    @property
    def records(self) -> tuple[SubtaskRecord, ...]:
        """All records, oldest first."""
        return tuple(self._records)

    @property
    def last(self) -> SubtaskRecord | None:
        """The most recent record, or None on the first turn."""
        return self._records[-1] if self._records else None

    def add(self, record: SubtaskRecord) -> None:
        """Remember one attempt."""
        self._records.append(record)

    def judge_last(self, verdict: Verdict, evidence: str) -> None:
        """Write the verdict on the most recent attempt into its record; without one, nothing happens."""
        if self._records and verdict is not Verdict.INITIAL:
            self._records[-1] = replace(self._records[-1], verdict=verdict, evidence=evidence)

    def attempts(self, text: str) -> tuple[SubtaskRecord, ...]:
        """The unbroken run of most recent attempts at the same sub-task, oldest first."""
        tail: list[SubtaskRecord] = []
        for record in reversed(self._records):
            if record.text != text or record.verdict is Verdict.SUCCESS:
                break
            tail.append(record)
        return tuple(reversed(tail))
