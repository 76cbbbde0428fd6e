"""Movements that are known beforehand: a task's sub-tasks with their sequences, and the way back to a start.

What was reasoned and written once, by a model or by the rules, is bound to every scene anew without asking anyone
(ManiAgent, section on automatic data collection). The four roles stay: the eyes look, the motion gate decides.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from ..agents.cache import ActionCache
from ..agents.memory import Memory
from ..agents.protocols import Agents
from ..agents.rules import rules_agents
from ..agents.rules.controller import RulesControllerAgent
from ..agents.rules.language import parse_instruction
from ..errors import DetectionFailure, ReasoningFailure, UsageError
from ..perception.referring import read_reference
from ..perception.rig import Rig
from ..perception.vocabulary import Vocabulary
from ..types import ActionSequence, Gripper, ObjectInfo, Orientation, SceneDescription, Subtask, SubtaskRecord, Verdict
from .outcome import Outcomes
from .recall import RecallingObjectAgent


class Move(BaseModel):
    """One sub-task whose sequence is known."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    text: Annotated[str, Field(min_length=1, max_length=500)]
    objects: Annotated[tuple[str, ...], Field(min_length=1, max_length=64)]
    sequence: ActionSequence


def moves_of(instruction: str, cache: ActionCache | None = None) -> tuple[Move, ...]:
    """The moves of an imperative instruction: out of the cache where it has them, else as the rules write them.

    Raises ReasoningFailure for what the rules don't understand.
    """
    controller = RulesControllerAgent()
    moves = []
    for command in parse_instruction(instruction):
        objects = (command.object,) if command.target is None else (command.object, command.target)
        subtask = Subtask(previous=Verdict.INITIAL, reason="", text=str(command), objects=objects)
        hit = cache.find(subtask) if cache is not None else None
        sequence = controller.write(subtask, ()) if hit is None else hit.sequence
        moves.append(Move(text=subtask.text, objects=objects, sequence=sequence))
    return tuple(moves)


def check_moves(moves: Sequence[Move]) -> None:
    """Make sure that moves can be collected, as far as that shows before anything is looked at.

    Raises UsageError for a name that the lexicon, which finds things while collecting, doesn't understand; for a thing
    that moves and is told by its place, since every episode begins with it elsewhere, or that can't be brought back by
    its name; and for what isn't let go, since success is where it lies then.
    """
    vocabulary = Vocabulary.load()
    moved = {move.objects[0] for move in moves}
    for move in moves:
        for name in move.objects:
            try:
                reference = read_reference(name, vocabulary)
            except DetectionFailure as failure:
                raise UsageError(f"While collecting, nothing can be found by the name {name!r}: {failure}") from failure
            if name in moved and (reference.pick or reference.ordinal or reference.where):
                raise UsageError(
                    f"{name!r} is told by its place, and every episode begins with it at another. Name it by its looks."
                )
        try:
            move_to(move.objects[0], (0.3, 0.0))
        except ReasoningFailure as failure:
            raise UsageError(f"How {move.objects[0]!r} should be brought back can't be said: {failure}") from failure
        grips = [step.gripper for step in move.sequence.steps]
        if Gripper.CLOSE not in grips or Gripper.OPEN not in grips[grips.index(Gripper.CLOSE) :]:
            raise UsageError(f"{move.text!r} takes nothing anywhere and lets it go, so success can't be measured.")


def move_to(name: str, xy: Sequence[float], yaw: float | None = None) -> Move:
    """Put object `name` at `xy` (m, base frame); its long side along `yaw` (rad, base frame) where that is given."""
    x, y = xy
    (move,) = moves_of(f"put the {name} at ({x:.3f}, {y:.3f})")
    if yaw is None:
        return move
    steps = list(move.sequence.steps)
    carry = next(i for i, step in enumerate(steps) if step.carrying is not None)
    lie = Orientation(kind="align", yaw=yaw, frame="base")
    steps[carry] = steps[carry].model_copy(update={"orientation": lie})
    return move.model_copy(update={"sequence": move.sequence.model_copy(update={"steps": tuple(steps)})})


class KnownMoves:
    """Two roles in one: it reasons which of the moves set before comes next, and has every sequence already.

    A move is done when what it moved lies where it was let go.
    """

    def __init__(self, outcomes: Outcomes) -> None:
        self._outcomes = outcomes
        self._moves: tuple[Move, ...] = ()
        self._attempts = 1
        self._current: Move | None = None

    def begin(self, moves: Sequence[Move], attempts: int) -> None:
        """From now on carry out `moves`, one after the other, each at most `attempts` times."""
        self._moves, self._attempts, self._current = tuple(moves), attempts, None

    def agents(self, rig: Rig) -> Agents:
        """All four roles; the eyes are those of the rules, and know things again."""
        rules = rules_agents(rig)
        eyes = RecallingObjectAgent(rules.objects)
        return Agents("known moves", scene=rules.scene, reasoning=self, objects=eyes, controller=self)

    def next_subtask(self, instruction: str, scene: SceneDescription, memory: Memory) -> Subtask:
        """The next move, or the same again; cannot once it failed too often."""
        done = sum(record.verdict is Verdict.SUCCESS for record in memory)
        verdict, evidence = Verdict.INITIAL, "The first move."
        if memory.last is not None:
            verdict, evidence = self._outcomes.judge(memory.last, scene.objects)
            done += verdict is Verdict.SUCCESS
        if done == len(self._moves):
            return Subtask(previous=verdict, reason=evidence, done=True)
        self._current = move = self._moves[done]
        if verdict is Verdict.FAILURE and len(memory.attempts(move.text)) >= self._attempts:
            return Subtask(previous=verdict, reason=evidence, cannot=True)
        return Subtask(previous=verdict, reason=evidence, text=move.text, objects=move.objects)

    def write(self, subtask: Subtask, objects: Sequence[ObjectInfo], feedback: str = "") -> ActionSequence:
        """The sequence, the same again where it was refused: the loop then gives the attempt up."""
        if self._current is None:
            raise ReasoningFailure(f"{subtask.text!r} is none of the moves that are known.")
        return self._current.sequence

    def learn(self, record: SubtaskRecord) -> None:
        """Nothing is learnt while collecting."""
