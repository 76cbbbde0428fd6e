"""A comparison of prompts from end to end. What the command line and Python call."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

from ...agents.minds.eyes import Eyes
from ...agents.minds.scene import MindSceneAgent
from ...agents.minds.telling import one_line
from ...errors import FormatFailure
from ...models.question import ChatModel
from ...perception.detectors.registry import make_detector
from ...perception.sight import Sight
from . import report
from .answers import Answer, AnswersFile, key_of
from .drawing import keep_misses
from .scenes import LabelledScene, SceneOf, draw
from .scores import Result, Scoring, summarise
from .variants import Variant


class Watcher(Protocol):
    """Anything that wants to follow a comparison."""

    def begin(self, total: int) -> None:
        """So many answers are needed."""
        ...

    def add(self, result: Result, before: bool) -> None:
        """One more is there; `before` says that an earlier call has asked for it."""
        ...


def score_prompts(
    model: ChatModel,
    variants: Sequence[Variant],
    scenes: Sequence[SceneOf],
    out: Path,
    watcher: Watcher | None = None,
) -> Scoring:
    """Ask the SceneAgent about every scene with every prompt, and judge its answers by what is true.

    Every answer is kept in `out` at once; a call that was interrupted goes on there when it is made again. The files
    of `report` are written in any case, on the scenes that every prompt was tried on.

    Raises
    ------
    UsageError
        For a folder that holds something else.
    SetupError
        Where nothing renders.
    ModelFailure
        Where the model can't be reached or the budget is used up: no prompt's fault, so nothing is counted.

    """
    answers = AnswersFile(out)
    names = [variant.name for variant in variants]
    results: list[Result] = []
    if watcher is not None:
        watcher.begin(len(scenes) * len(variants))
    try:
        for drawn in map(draw, scenes):
            of_scene: list[Result] = []
            for variant in variants:
                key = key_of(drawn, variant, model.name)
                known = answers.get(key)
                answer = known or _ask(model, variant, drawn, key)
                if known is None:
                    answers.add(answer)
                # Two folders' names may have changed places since; the words are what was asked with.
                answer = answer.model_copy(update={"scene": drawn.name, "variant": variant.name})
                result = Result.of(answer, drawn.things)
                of_scene.append(result)
                results.append(result)
                if watcher is not None:
                    watcher.add(result, known is not None)
            keep_misses(out, drawn, of_scene)
    finally:
        scoring = summarise(model.name, out, names, len(scenes), results)
        report.write(scoring)
    return scoring


def _ask(model: ChatModel, variant: Variant, scene: LabelledScene, key: str) -> Answer:
    """A SceneAgent of its own for every question: what was said before is no part of it."""
    eyes = Eyes(Sight(scene.rig), make_detector("lexicon"))
    agent = MindSceneAgent(eyes, model, variant.prompt)
    names: tuple[str, ...] = ()
    failure, start = "", time.monotonic()
    try:
        names = agent.describe(scene.instruction, scene.observation).names
    except FormatFailure as error:
        failure = one_line(str(error), 500)
    seconds = round(time.monotonic() - start, 2)
    return Answer(
        key=key, scene=scene.name, variant=variant.name, model=model.name, names=names, failure=failure, seconds=seconds
    )
