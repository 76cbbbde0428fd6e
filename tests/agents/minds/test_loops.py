"""Circles are named, then refused."""

import pytest

from maniagent.agents.minds.loops import MOST_ATTEMPTS, MOST_FAILURES, notice, refuse_loop
from maniagent.models.question import Unfit
from maniagent.types import ExecutionReport, SubtaskRecord, Verdict


def tried(text: str, verdict: Verdict = Verdict.FAILURE, stage: str = "grasp") -> SubtaskRecord:
    done = verdict is Verdict.SUCCESS
    return SubtaskRecord(text, (), ExecutionReport(completed=done, reached=0, reason="", stage=stage), verdict)


A, B = "put the egg on the plate", "put the egg on the table"


def test_a_second_attempt_is_allowed_and_one_too_many_is_not() -> None:
    refuse_loop(A, [])
    refuse_loop(A, [tried(A)] * (MOST_ATTEMPTS - 1))
    with pytest.raises(Unfit, match=f"failed {MOST_ATTEMPTS} times in a row"):
        refuse_loop(A, [tried(A)] * MOST_ATTEMPTS)


def test_other_words_for_the_same_don_t_hide_a_loop() -> None:
    with pytest.raises(Unfit):
        refuse_loop("Put the  EGG on the plate.", [tried(A)] * MOST_ATTEMPTS)


def test_a_success_in_between_makes_a_new_start() -> None:
    refuse_loop(A, [tried(A), tried(A), tried(A, Verdict.SUCCESS)])


def test_to_and_fro_is_refused_even_where_each_move_succeeded() -> None:
    circle = [tried(A, Verdict.SUCCESS), tried(B, Verdict.SUCCESS), tried(A, Verdict.SUCCESS)]
    with pytest.raises(Unfit, match="round in circles"):
        refuse_loop(B, circle)
    refuse_loop(A, [tried(A, Verdict.SUCCESS), tried(B, Verdict.SUCCESS)])


def test_the_notice_grows_with_the_number_of_attempts() -> None:
    assert notice([]) == notice([tried(A)]) == ""
    assert "tried 2 times in a row; if it failed again" in notice([tried(A)] * 2)
    assert "try another way" in notice([tried(A)] * MOST_ATTEMPTS)
    assert "answer cannot" in notice([tried(f"{A} {n}") for n in range(MOST_FAILURES)])


def test_after_many_failures_of_any_kind_only_giving_up_is_left() -> None:
    with pytest.raises(Unfit, match="answer cannot"):
        refuse_loop(A, [tried(f"{B} {n}") for n in range(MOST_FAILURES + 1)])


def test_a_model_out_of_reach_is_not_the_subtasks_fault() -> None:
    unreached = [tried(A, stage="model")] * MOST_FAILURES
    refuse_loop(A, [*unreached, tried(A)])
    assert notice(unreached) == ""
