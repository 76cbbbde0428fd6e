"""Things that words don't tell any more are known by their looks."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from maniagent.agents.memory import Memory
from maniagent.agents.protocols import Located
from maniagent.data.recall import RecallingObjectAgent
from maniagent.errors import DetectionFailure, GraspFailure
from maniagent.testing import made_object, made_observation
from maniagent.types import ExecutionReport, ObjectInfo, Observation, Subtask, SubtaskRecord, Verdict

MARKER = made_object(0, "marker", (0.2, 0.1), size=(0.12, 0.02, 0.02), colour=(20, 40, 200))
HAND = made_object(1, "hand", (0.3, -0.1), size=(0.17, 0.11, 0.03), colour=(220, 180, 150))
TOY = made_object(2, "toy", (0.4, 0.0), size=(0.05, 0.04, 0.05), colour=(20, 150, 40))
UNKNOWN = DetectionFailure("No marker is in view.")


class Eyes:
    """Answers in order, and keeps what it was told to remember."""

    def __init__(self, *answers: Located | Exception) -> None:
        self._answers = list(answers)
        self.reminded_of: list[tuple[SubtaskRecord, ...]] = []

    def locate(self, subtask: Subtask, observation: Observation, memory: Memory) -> Located:
        self.reminded_of.append(memory.records)
        answer = self._answers.pop(0)
        if isinstance(answer, Exception):
            raise answer
        return answer


def located(*objects: ObjectInfo, others: Sequence[ObjectInfo] = ()) -> Located:
    return Located(objects, (), tuple(others))


def seek(eyes: RecallingObjectAgent, *names: str, memory: Memory | None = None) -> Located:
    subtask = Subtask(previous=Verdict.INITIAL, reason="", text=f"put the {names[0]} away", objects=names)
    return eyes.locate(subtask, made_observation(), memory or Memory())


def test_where_words_tell_them_nothing_is_recalled() -> None:
    inner = Eyes(located(MARKER), located(TOY))
    eyes = RecallingObjectAgent(inner)
    seek(eyes, "marker")
    assert seek(eyes, "marker").objects == (TOY,)
    assert inner.reminded_of == [(), ()]


def test_what_words_do_not_tell_is_sought_as_what_was_seen_last() -> None:
    again = located(MARKER)
    inner = Eyes(located(MARKER, HAND, others=[TOY]), UNKNOWN, again)
    eyes = RecallingObjectAgent(inner)
    seek(eyes, "marker", "hand")
    assert seek(eyes, "marker") is again
    (tried,) = inner.reminded_of[-1]
    assert (tried.text, tried.objects) == ("put the marker away", (MARKER,))
    assert tried.surroundings == (HAND, TOY)


def test_nothing_that_is_sought_counts_as_surroundings() -> None:
    hand = made_object(5, "beige flat object", (0.3, -0.1), size=(0.17, 0.11, 0.03), colour=(220, 180, 150))
    inner = Eyes(located(HAND), located(MARKER, others=[hand, TOY]), UNKNOWN, located(MARKER, HAND))
    eyes = RecallingObjectAgent(inner)
    seek(eyes, "hand")
    seek(eyes, "marker")
    seek(eyes, "marker", "hand")
    assert inner.reminded_of[-1][0].objects == (MARKER, HAND)
    assert inner.reminded_of[-1][0].surroundings == (TOY,)


def test_what_was_tried_since_is_not_forgotten() -> None:
    slipped = SubtaskRecord(
        "put the marker away", (MARKER,), ExecutionReport(completed=False, reached=2, stage="grasp"), Verdict.FAILURE
    )
    memory = Memory()
    memory.add(slipped)
    inner = Eyes(located(MARKER), UNKNOWN, located(MARKER))
    eyes = RecallingObjectAgent(inner)
    seek(eyes, "marker")
    seek(eyes, "marker", memory=memory)
    assert len(inner.reminded_of[-1]) == 2
    assert inner.reminded_of[-1][1] is slipped


def test_what_was_never_seen_can_not_be_recalled() -> None:
    eyes = RecallingObjectAgent(Eyes(located(MARKER), UNKNOWN))
    seek(eyes, "marker")
    with pytest.raises(DetectionFailure, match="No marker"):
        seek(eyes, "marker", "plate")


def test_a_thing_that_is_seen_and_can_not_be_grasped_is_not_sought_again() -> None:
    inner = Eyes(located(MARKER), GraspFailure("It lies too flat."))
    eyes = RecallingObjectAgent(inner)
    seek(eyes, "marker")
    with pytest.raises(GraspFailure):
        seek(eyes, "marker")
    assert len(inner.reminded_of) == 2
