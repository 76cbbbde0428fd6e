"""The agents' prompts: text files, one a question, kept apart from the code so that they can be tuned and compared.

A file holds two texts with a line of three dashes between them: the instructions (system prompt), and what is asked
(the user's message). `{name}` is a placeholder; any other brace stands for itself, so that examples may hold JSON.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Set
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Self

from ...errors import UsageError

PLACEHOLDERS: Mapping[str, frozenset[str]] = {
    "scene": frozenset({"instruction", "names"}),
    "reasoning": frozenset({"instruction", "scene", "memory", "notice", "opening", "frame"}),
    "alikes": frozenset({"query", "subtask", "count"}),
    "controller": frozenset({"subtask", "objects", "feedback", "frame"}),
}
"""By prompt: what is filled in; every one must be in the file, and no other."""
MAX_LENGTH = 20_000
"""Characters of a prompt file."""
_PLACEHOLDER = re.compile(r"\{([a-z_]+)\}")
_BORDER = re.compile(r"^---[ \t]*$", re.MULTILINE)


@dataclass(frozen=True)
class Prompt:
    """One question's two texts."""

    instructions: str
    question: str

    def filled(self, **values: str) -> tuple[str, str]:
        """Instructions and question with the placeholders filled in; braces in the values stay what they are."""

        def fill(text: str) -> str:
            return _PLACEHOLDER.sub(lambda match: values[match[1]], text).strip()

        return fill(self.instructions), re.sub(r"\n{3,}", "\n\n", fill(self.question))


@dataclass(frozen=True)
class Prompts:
    """A set of prompts."""

    scene: Prompt
    reasoning: Prompt
    alikes: Prompt
    controller: Prompt

    @classmethod
    def load(cls, folder: Path | None = None) -> Self:
        """The prompts in `folder`, and those that come with maniagent for what it doesn't hold.

        Raises UsageError for a folder without a prompt, a file that is no prompt of ours, and placeholders that are
        missing or unknown.
        """
        shipped = resources.files(__package__) / "prompts"
        texts = {name: (shipped / f"{name}.md").read_text(encoding="utf-8") for name in PLACEHOLDERS}
        if folder is not None:
            texts |= _read_folder(folder)
        return cls(**{name: _parse(name, text, folder) for name, text in texts.items()})


def _read_folder(folder: Path) -> dict[str, str]:
    wanted = ", ".join(f"{name}.md" for name in PLACEHOLDERS)
    paths = sorted(folder.glob("*.md"))
    if not paths:
        raise UsageError(f"{folder} holds no prompts. Put at least one of {wanted} there.")
    if unknown := [path.name for path in paths if path.stem not in PLACEHOLDERS]:
        raise UsageError(f"{folder} holds {', '.join(unknown)}, which no agent asks for. The prompts are {wanted}.")
    try:
        return {path.stem: path.read_text(encoding="utf-8") for path in paths}
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(f"The prompts in {folder} can't be read: {error}.") from error


def _parse(name: str, text: str, folder: Path | None) -> Prompt:
    where = f"The prompt {name}.md" + (f" in {folder}" if folder else "")
    if len(text) > MAX_LENGTH:
        raise UsageError(f"{where} has {len(text)} characters; at most {MAX_LENGTH} are sent.")
    parts = _BORDER.split(text)
    if len(parts) != 2 or not all(part.strip() for part in parts):
        raise UsageError(f"{where} needs two texts, instructions and question, with one line '---' between them.")
    found, wanted = set(_PLACEHOLDER.findall(text)), PLACEHOLDERS[name]
    if missing := wanted - found:
        raise UsageError(f"{where} lacks {_listed(missing)}.")
    if unknown := found - wanted:
        raise UsageError(f"{where} has the unknown {_listed(unknown)}; known are {_listed(wanted)}.")
    return Prompt(*parts)


def _listed(names: Set[str]) -> str:
    return ", ".join(f"{{{name}}}" for name in sorted(names))
