"""One request's table in the twin: what is seen there without any model that sees, and who is asked about it."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from maniagent.agents.minds import Prompts
from maniagent.agents.minds.controller import MindControllerAgent
from maniagent.agents.minds.eyes import Eyes
from maniagent.agents.minds.objects import MindObjectAgent
from maniagent.agents.minds.reasoning import MindReasoningAgent
from maniagent.agents.minds.scene import NamedScene
from maniagent.agents.rules.language import parse_instruction
from maniagent.errors import DetectionFailure
from maniagent.models.question import ChatModel, Question, T
from maniagent.perception.detectors.lexicon import LexiconDetector
from maniagent.perception.lexicon import Lexicon
from maniagent.perception.segments import Segment
from maniagent.perception.sight import Sight
from maniagent.perception.viewpoint import Viewpoint
from maniagent.tasks import get
from maniagent.types import Observation, Subtask, Verdict

from .cases import Request
from .watch import Door, WatchedEnv


class Blind:
    """Stands where a vision-language model is asked which of several look-alikes is meant."""

    name = "nobody"

    def ask(self, question: Question[T]) -> T:
        """Raises DetectionFailure: there are no eyes to tell them apart."""
        raise DetectionFailure("Several things are alike, and there is no vision-language model to tell them apart.")


@dataclass(frozen=True)
class Table:
    """A scene of the twin, ready to be asked about."""

    env: WatchedEnv
    door: Door
    observation: Observation
    scene: NamedScene
    instruction: str
    subtasks: tuple[Subtask, ...]
    """Those that are right, with the scene's names for their objects; the first is the rule-made one."""
    commands: tuple[str, ...]
    """The same in the rules' own words."""
    reasoning: MindReasoningAgent
    objects: MindObjectAgent
    controller: MindControllerAgent


@contextmanager
def laid(request: Request, llm: ChatModel, prompts: Prompts) -> Iterator[Table]:
    """The request's scene as the loop finds it at its first turn.

    Raises SetupError where nothing renders, DetectionFailure where the lexicon doesn't find what a command means.
    """
    task = get(request.case.task)
    env = WatchedEnv(task.scene)
    try:
        env.reset(seed=request.number)
        door = Door(env)
        door.go_home()
        points = task.episode(env.layout, np.random.default_rng([request.number, 1])).points
        goal = "({:.2f}, {:.2f})".format(*points["goal"]) if "goal" in points else ""
        commands = tuple(command.replace("{goal}", goal) for command in request.case.commands)
        observation, lexicon, rig = door.observe(), Lexicon.load(), door.rig
        eyes = Eyes(Sight(rig), LexiconDetector(lexicon))
        segments, viewpoint = eyes.look(observation).segments, Viewpoint.of(observation)
        names = names_of(segments, viewpoint, lexicon)
        yield Table(
            env=env,
            door=door,
            observation=observation,
            scene=NamedScene("\n".join(map(_line, names, segments)), names=names),
            instruction=request.case.instruction or commands[0],
            subtasks=tuple(_to_subtask(command, names, segments, viewpoint, lexicon) for command in commands),
            commands=commands,
            reasoning=MindReasoningAgent(eyes, llm, prompts.reasoning, rig.gripper.max_opening),
            objects=MindObjectAgent(eyes, rig, Blind(), prompts.alikes),
            controller=MindControllerAgent(eyes, llm, prompts.controller),
        )
    finally:
        env.close()


def names_of(segments: Sequence[Segment], viewpoint: Viewpoint, lexicon: Lexicon) -> tuple[str, ...]:
    """A name for each segment, as a careful onlooker gives them: look-alikes by where they lie."""
    names = [lexicon.name(segment) for segment in segments]
    alike: defaultdict[str, list[int]] = defaultdict(list)
    for i, name in enumerate(names):
        alike[name].append(i)
    for name, those in alike.items():
        if len(those) > 1:
            for word, i in _by_place(those, segments, viewpoint):
                names[i] = f"{word} {name}"
    return tuple(names)


def _by_place(those: list[int], segments: Sequence[Segment], viewpoint: Viewpoint) -> list[tuple[str, int]]:
    """A word for the place of each, in the words that the lexicon understands; numbers beyond three."""
    places = np.array([segments[i].centre[:2] for i in those])
    across = np.ptp(places @ viewpoint.right) >= np.ptp(places @ viewpoint.away)
    ranked = [those[k] for k in np.argsort(places @ (viewpoint.right if across else viewpoint.away))]
    first, last = ("left", "right") if across else ("nearest", "farthest")
    words = {2: [first, last], 3: [first, "middle", last]}.get(len(those), [f"{k + 1}." for k in range(len(those))])
    return list(zip(words, ranked, strict=True))


def _line(name: str, segment: Segment) -> str:
    x, y, _ = segment.centre
    length, width, height = segment.extent * 100
    on = f", lies {segment.support_z * 100:.0f} cm above the table" if segment.support_z > 0.005 else ""
    return f"- {name}: at ({x:.2f}, {y:.2f}), {length:.0f} x {width:.0f} cm, {height:.1f} cm high{on}"


def _to_subtask(
    command: str, names: Sequence[str], segments: Sequence[Segment], viewpoint: Viewpoint, lexicon: Lexicon
) -> Subtask:
    parsed = parse_instruction(command)[0]
    queries = [query for query in (parsed.object, parsed.target) if query is not None]
    objects = tuple(names[lexicon.ground(query, segments, viewpoint)] for query in queries)
    return Subtask(previous=Verdict.INITIAL, reason="", text=command, objects=objects)
