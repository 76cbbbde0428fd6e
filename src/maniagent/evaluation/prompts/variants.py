"""The prompts that are compared: the packaged one, and those of folders."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from ...agents.minds.prompts import Prompt, Prompts
from ...errors import UsageError

PACKAGED = "packaged"
FILE = "scene.md"


@dataclass(frozen=True)
class Variant:
    """One way of asking what is on the table."""

    name: str
    prompt: Prompt

    @property
    def digest(self) -> str:
        """What only the same words share."""
        text = f"{self.prompt.instructions}\0{self.prompt.question}"
        return hashlib.sha256(text.encode()).hexdigest()


def load_variants(folders: Iterable[Path] = ()) -> tuple[Variant, ...]:
    """The packaged prompt first, then the scene.md of each folder, named as the folder.

    Raises UsageError for a folder without scene.md or with a bad prompt, and for two that say the same.
    """
    variants = [Variant(PACKAGED, Prompts.load().scene)]
    for folder in folders:
        if not (folder / FILE).is_file():
            raise UsageError(f"{folder} holds no {FILE}, the prompt that is scored (docs/prompts.md).")
        names = {variant.name for variant in variants}
        name = folder.resolve().name
        variant = Variant(str(folder) if name in names else name, Prompts.load(folder).scene)
        if same := next((other.name for other in variants if other.digest == variant.digest), None):
            raise UsageError(f"{folder / FILE} says the same as {same!r}; there is nothing to compare.")
        variants.append(variant)
    return tuple(variants)
