"""answers.jsonl: what a model called the things of a scene, kept the moment it is known and never asked for twice."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

from pydantic import BaseModel, ConfigDict, ValidationError

from ... import __version__
from ...errors import UsageError
from ...models.pictures import fingerprint
from .scenes import LabelledScene
from .variants import Variant

ANSWERS = "answers.jsonl"


class Answer(BaseModel):
    """One line: the names as they were given. What they are worth is worked out anew each time."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    key: str
    """Of all that was asked; see `key_of`."""
    scene: str
    variant: str
    model: str
    names: tuple[str, ...] = ()
    failure: str = ""
    """Why there are no names: no answer of the model fitted the form."""
    seconds: float


def key_of(scene: LabelledScene, variant: Variant, model: str) -> str:
    """What only the same question to the same model shares: the words, the picture, the model, and our version."""
    picture = fingerprint(scene.observation.main_frame.rgb)
    asked = json.dumps([__version__, model, variant.digest, scene.instruction, picture])
    return hashlib.sha256(asked.encode()).hexdigest()


def claim(folder: Path) -> Path:
    """Make sure that the folder is for a comparison, and say where its answers go.

    Creates it where it is missing; UsageError where it can't be, or holds something else.
    """
    path = folder / ANSWERS
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if not path.exists() and any(folder.iterdir()):
            raise UsageError(f"{folder} holds what no comparison of prompts left there. Name another --out.")
        path.touch()
    except OSError as error:
        raise UsageError(f"{folder} can't hold a comparison: {error.strerror}. Name another --out.") from error
    return path


class AnswersFile:
    """The answers in a folder, those of earlier calls included."""

    def __init__(self, folder: Path) -> None:
        """Open those in the folder; see `claim` for what is raised."""
        self._path = claim(folder)
        content = self._path.read_bytes()
        self._known = {answer.key: answer for answer in map(_read, content.splitlines()) if answer is not None}
        self._whole = content.endswith(b"\n") or not content

    def get(self, key: str) -> Answer | None:
        """The answer to that question, if it was given before."""
        return self._known.get(key)

    def add(self, answer: Answer) -> None:
        """Write one more down."""
        with self._path.open("ab") as file:
            file.write((b"" if self._whole else b"\n") + answer.model_dump_json().encode() + b"\n")
        self._whole = True
        self._known[answer.key] = answer


def _read(line: bytes) -> Answer | None:
    """The answer in a line; None for one that a crash cut short, which is then asked for again."""
    try:
        return Answer.model_validate_json(line)
    except ValidationError:
        return None
