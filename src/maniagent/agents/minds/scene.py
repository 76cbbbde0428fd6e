"""The SceneAgent: S = VLM(I, T), what of the scene matters for the instruction (ManiAgent, section III-A)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from ...models.question import ChatModel, Picture, Question, Unfit
from ...types import Observation, SceneDescription
from .answers import Seen
from .eyes import Eyes
from .prompts import Prompt
from .telling import fenced, plain

Views = Literal["main", "all"]


@dataclass(frozen=True)
class NamedScene(SceneDescription):
    """A scene whose objects have names, by which alone they may be asked for."""

    names: tuple[str, ...] = ()


def names_in(scene: SceneDescription) -> tuple[str, ...]:
    """The names of the objects in a scene, whoever described it."""
    return scene.names if isinstance(scene, NamedScene) else tuple(thing.name for thing in scene.objects)


class MindSceneAgent:
    """Asks a vision-language model; recall first: what it leaves out can't be used by anyone."""

    def __init__(self, eyes: Eyes, vlm: ChatModel, prompt: Prompt, views: Views = "main") -> None:
        """`views` says whether the model is shown the main picture only, or those of all cameras."""
        self._eyes = eyes
        self._vlm = vlm
        self._prompt = prompt
        self._views = views
        self._before: tuple[str, tuple[str, ...]] = ("", ())
        """The last instruction, and what things were called then: memory speaks of them by these names."""

    def describe(self, instruction: str, observation: Observation) -> NamedScene:
        """Name what is in view, with states and relations. Raises CameraFailure, ModelFailure and FormatFailure."""
        self._eyes.look(observation)
        said, names = self._before
        known = names if said == instruction else ()
        instructions, question = self._prompt.filled(instruction=fenced(instruction, 1000), names=_tell_names(known))
        seen = self._vlm.ask(
            Question("scene", instructions, (*self._pictures(observation), question), Seen, check=_names_differ)
        )
        scene = _to_scene(seen)
        self._before = (instruction, scene.names)
        return scene

    def _pictures(self, observation: Observation) -> tuple[str | Picture, ...]:
        main = Picture(observation.main, observation.main_frame.rgb)
        if self._views == "main":
            return (main,)
        others = [Picture(name, frame.rgb) for name, frame in observation.frames.items() if name != observation.main]
        return ("The main view, to which left, right, near and far refer:", main, "The same from elsewhere:", *others)


def _tell_names(names: Sequence[str]) -> str:
    if not names:
        return ""
    return (
        f"At the last look things were called:\n<names>{fenced(', '.join(names))}</names>\nCall what you still see by "
        "the same name, unless it says a place where the thing is no longer."
    )


def _names_differ(seen: Seen) -> None:
    counts = Counter(plain(thing.name) for thing in seen.objects)
    if twice := [name for name, count in counts.items() if count > 1]:
        raise Unfit(
            f"Several things are called {', '.join(map(repr, twice))}. Give each a name of its own, by its colour, "
            "size or place."
        )


def _to_scene(seen: Seen) -> NamedScene:
    lines = [f"- {fenced(thing.name)}: {fenced(thing.state)}" for thing in seen.objects]
    text = "\n".join([*(lines or ["No object is seen."]), fenced(seen.summary)])
    return NamedScene(text, names=tuple(thing.name for thing in seen.objects))
