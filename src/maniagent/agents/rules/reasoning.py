"""What to do next, without a model: the commands of the instruction, one after the other, each until it is done."""

from __future__ import annotations

from ...errors import FailureStage, ReasoningFailure
from ...types import SceneDescription, Subtask, Verdict
from ..memory import Memory
from .commands import Command
from .judge import judge
from .language import parse_instruction

MAX_ATTEMPTS = 4
"""At one command, before the rules give up."""
MAX_BLIND_ATTEMPTS = 2
"""In which the objects were not even found: a second look may help, a third doesn't."""


class RulesReasoningAgent:
    """Parses the instruction, keeps to its order, judges each step by a fresh look."""

    def next_subtask(self, instruction: str, scene: SceneDescription, memory: Memory) -> Subtask:
        """The next command as a sub-task; `cannot` for what the rules don't understand or failed at too often."""
        try:
            commands = parse_instruction(instruction)
        except ReasoningFailure as failure:
            return Subtask(previous=Verdict.INITIAL, reason=str(failure), cannot=True)
        done = sum(record.verdict is Verdict.SUCCESS for record in memory)
        verdict, evidence = Verdict.INITIAL, "This is the first sub-task."
        if memory.last is not None and memory.last.verdict is Verdict.SUCCESS:  # judged before; nothing tried since
            verdict, evidence = memory.last.verdict, memory.last.evidence
        elif memory.last is not None:
            verdict, evidence = judge(commands[done], memory.last, scene.objects)
            done += verdict is Verdict.SUCCESS
        if done == len(commands):
            return Subtask(previous=verdict, reason=evidence, done=True)
        if verdict is Verdict.FAILURE and (why := _give_up(memory, str(commands[done]), evidence)):
            return Subtask(previous=verdict, reason=why, cannot=True)
        return _subtask(commands[done], verdict, evidence)


def _subtask(command: Command, verdict: Verdict, evidence: str) -> Subtask:
    queries = (command.object,) if command.target is None else (command.object, command.target)
    return Subtask(previous=verdict, reason=evidence, text=str(command), objects=queries)


def _give_up(memory: Memory, text: str, evidence: str) -> str:
    """Why to try no further; empty while there is hope."""
    attempts = memory.attempts(text)
    blind = [a for a in attempts if a.outcome.stage == FailureStage.DETECTION]
    if len(blind) >= MAX_BLIND_ATTEMPTS:
        return blind[-1].outcome.reason
    if len(attempts) >= MAX_ATTEMPTS:
        return f"Gave up on {text!r} after {len(attempts)} attempts. {evidence}"
    return ""
