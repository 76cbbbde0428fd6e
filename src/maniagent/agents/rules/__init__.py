"""The four roles without a model: an honest baseline that carries out plain imperative English and nothing else."""

from __future__ import annotations

from ...perception.lexicon import Lexicon
from ...perception.rig import Rig
from ...perception.sight import Sight
from ..protocols import Agents
from .controller import RulesControllerAgent
from .objects import RulesObjectAgent
from .reasoning import RulesReasoningAgent
from .scene import RulesSceneAgent

__all__ = ["rules_agents"]


def rules_agents(rig: Rig, lexicon: Lexicon | None = None) -> Agents:
    """The `rules` agents for a robot with that rig."""
    sight = Sight(rig)
    words = lexicon if lexicon is not None else Lexicon.load()
    return Agents(
        name="rules",
        scene=RulesSceneAgent(sight, words),
        reasoning=RulesReasoningAgent(),
        objects=RulesObjectAgent(sight, words),
        controller=RulesControllerAgent(),
    )
