"""What the cache serves, when it learns, and when it forgets."""

from pathlib import Path

import pytest
from sequences import judged, put, subtask

from maniagent.agents.cache import ActionCache, CacheStore, Hit, Kind
from maniagent.types import ActionSequence, ExecutionReport, Orientation, Subtask, Verdict

CARROT, EGG = subtask(), subtask("Put an egg on the plate.", "egg", "plate")


@pytest.fixture
def store(tmp_path: Path) -> CacheStore:
    return CacheStore(tmp_path / "cache.sqlite")


@pytest.fixture
def cache(store: CacheStore) -> ActionCache:
    return ActionCache(store)


def succeed(cache: ActionCache, task: Subtask, sequence: ActionSequence, refused: ActionSequence | None = None) -> None:
    cache.learn(judged(task, sequence, Verdict.SUCCESS), refused)


def fail(cache: ActionCache, task: Subtask, sequence: ActionSequence) -> None:
    cache.learn(judged(task, sequence, Verdict.FAILURE), None)


def test_what_was_achieved_is_served_for_the_same_words(cache: ActionCache) -> None:
    assert cache.find(CARROT) is None
    succeed(cache, CARROT, put())
    assert cache.find(CARROT) == Hit(Kind.TEXT, put())


def test_and_by_the_normal_form_with_todays_names_in_its_descriptions(cache: ActionCache) -> None:
    succeed(cache, CARROT, put("carrot"))
    assert cache.find(EGG) == Hit(Kind.FORM, put("egg"))


@pytest.mark.parametrize(
    "other",
    [
        subtask("drag the carrot on the plate"),
        subtask("put the carrot beside the plate"),
        subtask("put the carrot on the plate", "plate", "carrot"),
        subtask("put the carrot on the plate", "carrot"),
        subtask("put the carrot on the plate", "carrot", "plate", "carrot on"),
        subtask("put the two carrots on the plate", "carrot", "plate"),
    ],
    ids=["skill", "relation", "order", "fewer objects", "more objects", "plural"],
)
def test_nothing_is_served_for_anything_else(cache: ActionCache, other: Subtask) -> None:
    succeed(cache, CARROT, put())
    assert cache.find(other) is None


@pytest.mark.parametrize("verdict", [Verdict.INITIAL, Verdict.FAILURE])
def test_nothing_is_kept_before_it_was_judged_achieved(cache: ActionCache, verdict: Verdict) -> None:
    cache.learn(judged(CARROT, put(), verdict), None)
    assert cache.find(CARROT) is None


def test_nothing_is_kept_of_what_was_cut_short_or_never_moved(cache: ActionCache, store: CacheStore) -> None:
    slipped = ExecutionReport(completed=False, reached=1, reason="It slipped.", stage="grasp")
    cache.learn(judged(CARROT, put(), Verdict.SUCCESS, slipped), None)
    cache.learn(judged(CARROT, None, Verdict.SUCCESS), None)
    assert store.entries() == ()


def test_successes_and_failures_are_counted(cache: ActionCache, store: CacheStore) -> None:
    for learn in (succeed, succeed, fail, succeed, fail):
        learn(cache, CARROT, put())
    counts = [(entry.successes, entry.failures, entry.failed_running) for entry in store.entries()]
    assert counts == [(3, 2, 1), (3, 2, 1)]


def test_two_failures_running_drop_an_entry(cache: ActionCache, store: CacheStore) -> None:
    for learn in (succeed, fail, succeed, fail, fail):
        learn(cache, CARROT, put())
    assert store.entries() == ()


def test_failures_on_other_objects_drop_the_form_and_leave_the_text(cache: ActionCache) -> None:
    succeed(cache, CARROT, put())
    fail(cache, EGG, put("egg"))
    fail(cache, EGG, put("egg"))
    assert cache.find(EGG) is None
    assert cache.find(CARROT) == Hit(Kind.TEXT, put())


def test_what_fails_without_being_kept_costs_nobody_anything(cache: ActionCache, store: CacheStore) -> None:
    succeed(cache, CARROT, put())
    for _ in range(2):
        fail(cache, CARROT, put(height=0.2))
    assert [entry.failures for entry in store.entries()] == [0, 0]


def test_another_sequence_does_not_push_out_what_works(cache: ActionCache) -> None:
    succeed(cache, CARROT, put())
    succeed(cache, CARROT, put(height=0.2))
    assert cache.find(CARROT) == Hit(Kind.TEXT, put())


def test_it_takes_the_place_of_what_was_refused(cache: ActionCache, store: CacheStore) -> None:
    succeed(cache, CARROT, put())
    succeed(cache, CARROT, put())
    succeed(cache, EGG, put("egg", height=0.2), refused=put("egg"))
    assert cache.find(EGG) == Hit(Kind.TEXT, put("egg", height=0.2))
    assert cache.find(subtask("put the cup on the plate", "cup", "plate")) == Hit(Kind.FORM, put("cup", height=0.2))
    assert cache.find(CARROT) == Hit(Kind.TEXT, put())
    assert {(entry.key.kind, entry.key.wording): entry.successes for entry in store.entries()} == {
        (Kind.TEXT, CARROT.text): 2,
        (Kind.FORM, "put {0} on {1}"): 1,
        (Kind.TEXT, EGG.text): 1,
    }


def test_a_point_that_the_text_says_is_kept_under_the_text_alone(cache: ActionCache) -> None:
    there = subtask("put the carrot at (0.30, -0.1)", "carrot")
    succeed(cache, there, put(point=(0.3, -0.1)))
    assert cache.find(there) == Hit(Kind.TEXT, put(point=(0.3, -0.1)))
    assert cache.find(subtask("put the egg at (0.30, -0.1)", "egg")) is None


@pytest.mark.parametrize(
    ("text", "sequence"),
    [
        ("put the carrot on the plate", put(point=(0.27, 0.08))),
        ("put the carrot 5 cm from the plate", put(point=(0.27, 0.05))),
    ],
)
def test_a_point_read_off_todays_table_is_not_kept(cache: ActionCache, text: str, sequence: ActionSequence) -> None:
    succeed(cache, subtask(text), sequence)
    assert cache.find(subtask(text)) is None


@pytest.mark.parametrize(("yaw", "kept"), [(0.0, True), (1.5708, True), (0.37, False), (-0.5236, True)])
def test_an_angle_is_kept_where_it_is_round_or_said(cache: ActionCache, yaw: float, kept: bool) -> None:
    task = subtask("turn the carrot by 30 degrees", "carrot")
    take, give = put(point=None).steps
    turn = give.model_copy(update={"orientation": Orientation(kind="turn", yaw=yaw), "anchor": take.anchor})
    succeed(cache, task, ActionSequence(skill="rotate", steps=(take, turn)))
    assert (cache.find(task) is not None) == kept


def test_a_sequence_about_more_objects_than_were_named_is_not_kept(cache: ActionCache) -> None:
    lone = subtask("put the carrot there", "carrot")
    succeed(cache, lone, put())
    assert cache.find(lone) is None
