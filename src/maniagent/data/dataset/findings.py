"""What verifying a dataset found: checks by name, each passed or not, with where and what to do."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from typing import Any, Literal

from .layout import DatasetError

Outcome = Literal["passed", "warned", "failed", "skipped"]

LIMIT = 20
"""Findings of one check that are kept; the rest are counted."""


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong, or looks wrong."""

    where: str
    what: str
    todo: str
    is_problem: bool
    """False: a warning; LeRobot loads and trains, but somebody should look."""


@dataclass
class Check:
    """One question put to a dataset, and what was found."""

    name: str
    question: str
    findings: list[Finding] = field(default_factory=list)
    problems: int = 0
    warnings: int = 0
    skipped: str = ""
    """Why it was not asked."""

    @property
    def outcome(self) -> Outcome:
        """The check in one word."""
        if self.problems:
            return "failed"
        if self.skipped:
            return "skipped"
        return "warned" if self.warnings else "passed"

    @property
    def more(self) -> int:
        """Findings that were counted, but not kept."""
        return self.problems + self.warnings - len(self.findings)

    def problem(self, where: str, what: str, todo: str = "") -> None:
        """Something is wrong."""
        self.problems += 1
        self._keep(Finding(where, what, todo, True))

    def warning(self, where: str, what: str, todo: str = "") -> None:
        """Something looks wrong."""
        self.warnings += 1
        self._keep(Finding(where, what, todo, False))

    def broken(self, error: DatasetError) -> None:
        """Something can't be read."""
        self.problem(error.where, error.what, error.todo)

    def _keep(self, finding: Finding) -> None:
        if len(self.findings) < LIMIT:
            self.findings.append(finding)
        elif finding.is_problem:  # a problem is never hidden behind warnings
            for i, kept in enumerate(self.findings):
                if not kept.is_problem:
                    self.findings[i] = finding
                    return


@dataclass(frozen=True)
class Report:
    """All checks of a dataset."""

    path: str
    checks: tuple[Check, ...]
    deep: bool

    @property
    def problems(self) -> int:
        """How many things are wrong."""
        return sum(check.problems for check in self.checks)

    @property
    def warnings(self) -> int:
        """How many things look wrong."""
        return sum(check.warnings for check in self.checks)

    @property
    def sound(self) -> bool:
        """Whether nothing is wrong."""
        return self.problems == 0

    def to_plain(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "path": self.path,
            "sound": self.sound,
            "problems": self.problems,
            "warnings": self.warnings,
            "deep": self.deep,
            "checks": [_plain(check) for check in self.checks],
        }


def _plain(check: Check) -> dict[str, Any]:
    return {
        "name": check.name,
        "question": check.question,
        "outcome": check.outcome,
        "skipped": check.skipped,
        "problems": check.problems,
        "warnings": check.warnings,
        "findings": [asdict(finding) for finding in check.findings],
        "more": check.more,
    }


def named(items: Iterable[object], limit: int = 8) -> str:
    """A few of many things in words."""
    texts = [str(item) for item in items]
    shown = ", ".join(texts[:limit])
    return f"{shown} and {len(texts) - limit} more" if len(texts) > limit else shown
