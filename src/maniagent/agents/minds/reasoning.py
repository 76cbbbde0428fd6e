"""The ReasoningAgent: judges the last sub-task, names the next one only (ManiAgent, section III-B). Text only."""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from dataclasses import replace

from ...models.question import ChatModel, Question, Unfit
from ...types import SceneDescription, Subtask, SubtaskRecord, Verdict
from ..memory import Memory
from .answers import Thought
from .eyes import Eyes
from .loops import notice, refuse_loop
from .prompts import Prompt
from .scene import names_in
from .telling import fenced, one_line, plain, tell_frame, tell_memory

MEASURED = "The positions in the scene are all that can be measured: answer act, done or cannot."
_VERDICTS = {"success": Verdict.SUCCESS, "failure": Verdict.FAILURE, "none": Verdict.INITIAL}


class MindReasoningAgent:
    """Asks a language model, which is told the scene and the memory, and may ask once for measurements."""

    def __init__(self, eyes: Eyes, llm: ChatModel, prompt: Prompt, opening: float) -> None:
        """`opening` is how far the gripper opens, m."""
        self._eyes = eyes
        self._llm = llm
        self._prompt = prompt
        self._opening = opening

    def next_subtask(self, instruction: str, scene: SceneDescription, memory: Memory) -> Subtask:
        """The next sub-task, done, or cannot. Raises ModelFailure and FormatFailure."""
        thought = self._think(instruction, scene, memory, may_measure=True)
        if thought.next == "measure":
            measured = f"{scene.text}\nMeasured, in the robot's frame:\n{self._eyes.measure(thought.objects)}"
            thought = self._think(instruction, replace(scene, text=measured), memory, may_measure=False)
        return _to_subtask(thought, names_in(scene), memory)

    def _think(self, instruction: str, scene: SceneDescription, memory: Memory, *, may_measure: bool) -> Thought:
        last = memory.last
        instructions, question = self._prompt.filled(
            instruction=fenced(instruction, 1000),
            scene=fenced(scene.text, 8000),
            memory=tell_memory(memory.records, self._eyes.follow(last) if last is not None else ""),
            notice=notice(memory.records) if may_measure else MEASURED,
            frame=tell_frame(self._eyes.viewpoint),
            opening=f"{self._opening * 100:.1f}",
        )

        def check(thought: Thought) -> None:
            _check(thought, names_in(scene), memory.records, may_measure=may_measure)

        return self._llm.ask(Question("reasoning", instructions, (question,), Thought, check))


def _check(thought: Thought, names: Sequence[str], records: Sequence[SubtaskRecord], *, may_measure: bool) -> None:
    if records and thought.previous == "none":
        raise Unfit("There is a last sub-task in memory: say whether it is a success or a failure.")
    if thought.next == "measure" and not may_measure:
        raise Unfit("What can be measured is in the scene now. Decide: act, done or cannot.")
    if thought.next in ("act", "measure"):
        _check_objects(thought.objects, names)
    if thought.next == "act":
        if not thought.subtask:
            raise Unfit("next is act, and subtask is empty. Say the one next sub-task, or answer done or cannot.")
        refuse_loop(thought.subtask, _judged(records, thought))


def _check_objects(objects: Sequence[str], names: Sequence[str]) -> None:
    """Refuse what the scene doesn't list: it would be sought in vain (the paper's failure on its seventh task)."""
    if not objects:
        raise Unfit("objects is empty. Name the object that moves, then what it is brought to.")
    known = {plain(name): name for name in names}
    for name in objects:
        if plain(name) not in known:
            near = difflib.get_close_matches(plain(name), known, n=1)
            if near:
                raise Unfit(f"The scene lists no {one_line(name)!r}. If you mean {known[near[0]]!r}, write just that.")
            raise Unfit(
                f"The scene lists no {one_line(name)!r}. It lists: {', '.join(names) or 'nothing'}. Use these names; "
                "if what is needed isn't there, do without it or answer cannot."
            )
    if len({plain(name) for name in objects}) < len(objects):
        raise Unfit("objects names the same thing twice. Name each once: first what moves, then what it is brought to.")


def _judged(records: Sequence[SubtaskRecord], thought: Thought) -> tuple[SubtaskRecord, ...]:
    """The memory as it will be once this answer's verdict stands in it."""
    if not records:
        return ()
    return (*records[:-1], replace(records[-1], verdict=_VERDICTS[thought.previous]))


def _to_subtask(thought: Thought, names: Sequence[str], memory: Memory) -> Subtask:
    verdict = _VERDICTS[thought.previous] if len(memory) else Verdict.INITIAL
    if thought.next != "act":
        done = thought.next == "done"
        why = [thought.evidence] if done and thought.evidence else [thought.evidence, thought.remaining]
        return Subtask(previous=verdict, reason=" ".join(filter(None, why))[:2000], done=done, cannot=not done)
    known = {plain(name): name for name in names}
    objects = tuple(known[plain(name)] for name in thought.objects)
    return Subtask(previous=verdict, reason=thought.evidence, text=thought.subtask, objects=objects)
