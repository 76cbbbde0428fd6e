"""The scene in words, without a model: what the lexicon calls each segment, and where it lies."""

from __future__ import annotations

from ...perception.lexicon import Lexicon
from ...perception.sight import Sight
from ...types import Observation, SceneDescription


class RulesSceneAgent:
    """Names every segment; invents nothing, leaves nothing out."""

    def __init__(self, sight: Sight, lexicon: Lexicon) -> None:
        self._sight = sight
        self._lexicon = lexicon

    def describe(self, instruction: str, observation: Observation) -> SceneDescription:
        """All segments, left to right in the main view; the instruction doesn't matter to the rules."""
        segments = self._sight.look(observation).segments
        objects = tuple(s.to_object(i, self._lexicon.name(s)) for i, s in enumerate(segments))
        lines = [f"{len(objects)} things on the table:", *map(str, objects)]
        return SceneDescription("\n".join(lines) if objects else "The table is empty.", objects)
