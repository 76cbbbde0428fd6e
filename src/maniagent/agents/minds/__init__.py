"""The four roles on real models: a vision-language model that sees, a language model that thinks."""

from __future__ import annotations

from ...models.question import ChatModel
from ...perception.detectors.protocol import Detector
from ...perception.rig import Rig
from ...perception.sight import Sight
from ..protocols import Agents
from .controller import MindControllerAgent
from .eyes import Eyes
from .objects import MindObjectAgent
from .prompts import Prompts
from .reasoning import MindReasoningAgent
from .scene import MindSceneAgent, Views

__all__ = ["Prompts", "minds_agents"]


def minds_agents(
    rig: Rig,
    vlm: ChatModel,
    llm: ChatModel,
    detector: Detector,
    prompts: Prompts | None = None,
    views: Views = "main",
) -> Agents:
    """The agents for a robot with that rig.

    `vlm` describes scenes and tells look-alikes apart, `llm` reasons and writes movements from text alone, `detector`
    finds objects by their names. `views` says which cameras' pictures the scene's description is made from.
    """
    texts = prompts if prompts is not None else Prompts.load()
    eyes = Eyes(Sight(rig), detector)
    return Agents(
        name=f"agents (vlm {vlm.name}, llm {llm.name}, detector {detector.name})",
        scene=MindSceneAgent(eyes, vlm, texts.scene, views),
        reasoning=MindReasoningAgent(eyes, llm, texts.reasoning, rig.gripper.max_opening),
        objects=MindObjectAgent(eyes, rig, vlm, texts.alikes),
        controller=MindControllerAgent(eyes, llm, texts.controller),
    )
