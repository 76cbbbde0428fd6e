"""The four roles without a model: an honest baseline that carries out plain imperative English and nothing else."""

from __future__ import annotations

from ...perception.lexicon import Lexicon
from ...perception.sight import Sight
from ...perception.views import RobotFilter
from ..protocols import Agents
from .controller import RulesControllerAgent
from .objects import RulesObjectAgent
from .reasoning import RulesReasoningAgent
from .scene import RulesSceneAgent

__all__ = ["rules_agents"]


def rules_agents(covers_robot: RobotFilter, lexicon: Lexicon | None = None) -> Agents:
    """The `rules` agents for a robot whose own body `covers_robot` tells apart in the images."""
    sight = Sight(covers_robot)
    words = lexicon if lexicon is not None else Lexicon.load()
    return Agents(
        name="rules",
        scene=RulesSceneAgent(sight, words),
        reasoning=RulesReasoningAgent(),
        objects=RulesObjectAgent(sight, words),
        controller=RulesControllerAgent(),
    )
