"""What became of the questions: a line for each, written at once and never asked for twice."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, ValidationError

from maniagent.agents.minds.prompts import Prompt

from .cases import Request

RESULTS = "requests.jsonl"
Role = Literal["reasoning", "controller"]
ROLES: tuple[Role, ...] = ("reasoning", "controller")


class Line(BaseModel):
    """One question to one role, all its rounds, and what became of the answer."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    key: str
    request: int
    task: str
    kind: str
    role: Role
    asked: str
    """The instruction, or the sub-task."""
    fits_first: bool
    """The first answer fitted: its form, and the scene's objects."""
    fits: bool
    """An answer fitted, after repairs at the latest."""
    unfit: int
    """Answers that were sent back because they didn't fit."""
    complaint: str = ""
    """Why the first of them didn't."""
    calls: int
    tokens_in: int
    tokens_out: int
    model_seconds: float
    stage: str = ""
    """Of the failure that ended it; empty where there was none."""
    reason: str = ""

    # of the reasoning
    next: str = ""
    """act, done or cannot."""
    subtask: str = ""
    objects: tuple[str, ...] = ()
    right: bool = False
    """It names the objects that are meant, in their order."""

    # of the controller
    source: Literal["", "model", "rules"] = ""
    """Whose sub-task it was."""
    instead: str = ""
    """Why it wasn't the model's own."""
    sequences: int = 0
    """Sequences that fitted and so came before the gate: the first, and those after a refusal."""
    passes_first: bool = False
    """The first of them bound and passed the gate."""
    passes: bool = False
    """One of them did."""
    rules_pass: bool = False
    """The rules' own sequence for the rule-made sub-task does: it can be done."""
    executed: bool = False
    completed: bool = False
    """The robot made every movement and held what it had to hold."""
    malformed: tuple[str, ...] = ()
    """What reached the robot and shouldn't have (`watch`)."""


def key_of(request: Request, role: Role, model: str, temperature: float | None, prompt: Prompt) -> str:
    """What only the same question to the same model, with the same prompt and temperature, shares."""
    case = request.case
    asked = [request.number, case.task, case.kind, case.commands, case.instruction, role, model, temperature]
    return hashlib.sha256(json.dumps([*asked, prompt.instructions, prompt.question]).encode()).hexdigest()[:24]


class ResultsFile:
    """The lines in a folder, those of earlier calls included."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._path = folder / RESULTS
        self._path.touch()
        content = self._path.read_bytes()
        self._known = {line.key: line for line in map(_read, content.splitlines()) if line is not None}
        self._whole = content.endswith(b"\n") or not content

    def get(self, key: str) -> Line | None:
        """The line of that question, if it was asked before."""
        return self._known.get(key)

    def add(self, line: Line) -> None:
        """Write one more down."""
        with self._path.open("ab") as file:
            file.write((b"" if self._whole else b"\n") + line.model_dump_json().encode() + b"\n")
        self._whole = True
        self._known[line.key] = line


def _read(content: bytes) -> Line | None:
    """The line; None for one that a crash cut short, which is then asked again."""
    try:
        return Line.model_validate_json(content)
    except ValidationError:
        return None
