from dataclasses import replace

from hypothesis import given
from hypothesis import strategies as st

from maniagent.agents.memory import Memory
from maniagent.types import ExecutionReport, SubtaskRecord, Verdict

records = st.builds(
    SubtaskRecord,
    text=st.sampled_from(["put it there", "turn it"]),
    objects=st.just(()),
    outcome=st.builds(ExecutionReport, completed=st.booleans(), reached=st.integers(0, 9)),
    verdict=st.sampled_from(Verdict),
)


def filled(*past: SubtaskRecord) -> Memory:
    memory = Memory()
    for record in past:
        memory.add(record)
    return memory


@given(st.lists(records))
def test_records_are_kept_in_order(past: list[SubtaskRecord]) -> None:
    memory = filled(*past)
    assert list(memory) == list(memory.records) == past
    assert len(memory) == len(past)
    assert memory.last is (past[-1] if past else None)


@given(st.lists(records, min_size=1), st.sampled_from([Verdict.SUCCESS, Verdict.FAILURE]))
def test_a_verdict_goes_to_the_last_record_alone(past: list[SubtaskRecord], verdict: Verdict) -> None:
    memory = filled(*past)
    memory.judge_last(verdict, "seen")
    assert memory.records == (*past[:-1], replace(past[-1], verdict=verdict, evidence="seen"))


@given(st.lists(records))
def test_no_verdict_changes_nothing(past: list[SubtaskRecord]) -> None:
    memory = filled(*past)
    memory.judge_last(Verdict.INITIAL, "none yet")
    assert list(memory) == past


def test_without_a_past_there_is_nothing_to_judge() -> None:
    memory = Memory()
    memory.judge_last(Verdict.SUCCESS, "seen")
    assert memory.records == ()


@given(st.lists(records))
def test_attempts_are_the_latest_ones_at_that_text_since_it_last_succeeded(past: list[SubtaskRecord]) -> None:
    attempts = filled(*past).attempts("turn it")
    assert past[len(past) - len(attempts) :] == list(attempts)
    assert all(a.text == "turn it" and a.verdict is not Verdict.SUCCESS for a in attempts)
    before = past[: len(past) - len(attempts)]
    assert not before or before[-1].text != "turn it" or before[-1].verdict is Verdict.SUCCESS
