"""Intervals agree with published ones; rates and rows add up."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from maniagent.evaluation.episode import MOST_EPISODES, EpisodeResult, Job, lost, scene_seed
from maniagent.evaluation.statistics import Rate, average, rows, stage_counts, wilson


@pytest.mark.parametrize(
    ("successes", "trials", "low", "high"),
    [(81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0, 0.1611), (1, 29, 0.0061, 0.1718)],
)
def test_wilson_gives_the_values_that_newcombe_1998_tabulates(
    successes: int, trials: int, low: float, high: float
) -> None:
    assert wilson(successes, trials) == pytest.approx((low, high), abs=5e-5)


def test_nothing_tried_says_nothing() -> None:
    assert wilson(0, 0) == (0.0, 1.0)


counts = st.integers(1, 2000).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n)))


@given(counts)
def test_an_interval_lies_in_the_unit_interval_and_around_the_rate(count: tuple[int, int]) -> None:
    low, high = wilson(*count)
    assert 0 <= low <= count[0] / count[1] <= high <= 1
    assert low < high


@given(counts)
def test_success_and_failure_mirror_each_other(count: tuple[int, int]) -> None:
    low, high = wilson(*count)
    assert wilson(count[1] - count[0], count[1]) == pytest.approx((1 - high, 1 - low))


@given(counts)
def test_more_episodes_of_the_same_rate_narrow_the_interval(count: tuple[int, int]) -> None:
    def width(factor: int) -> float:
        low, high = wilson(factor * count[0], factor * count[1])
        return high - low

    assert width(4) < width(1)


@given(st.tuples(st.integers(0, 50), st.integers(0, MOST_EPISODES - 1)), st.data())
def test_no_two_episodes_share_a_scene(first: tuple[int, int], data: st.DataObject) -> None:
    second = data.draw(st.tuples(st.integers(0, 50), st.integers(0, MOST_EPISODES - 1)))
    assert (scene_seed(*first) == scene_seed(*second)) == (first == second)


def test_seed_zero_counts_scenes_from_zero() -> None:
    assert [scene_seed(0, episode) for episode in range(3)] == [0, 1, 2]


def result(task: str, episode: int, success: bool, **more: object) -> EpisodeResult:
    data = {"task": task, "seed": 0, "episode": episode, "success": success, **more}
    return EpisodeResult.model_validate(data)


def test_the_average_weighs_every_task_the_same() -> None:
    results = [result("a", 0, True), *(result("b", k, False, stage="grasp") for k in range(3))]
    whole = average(rows(results, ("a", "b")), results)
    assert whole is not None
    assert whole.success.value == 0.5
    assert whole.success.episodes == 4


def test_the_average_of_equally_many_has_the_interval_of_all_together() -> None:
    first, second = Rate.of([True] * 9 + [False]), Rate.of([True] * 5 + [False] * 5)
    assert (lambda rate: (rate.low, rate.high))(Rate.average([first, second])) == pytest.approx(wilson(14, 20))


def test_a_lost_episode_fails_by_every_criterion() -> None:
    results = [result("a", 0, True, believed=True, criteria={"strict": True}), lost(Job("a", 0, 1), "crash", "it died")]
    (row,) = rows(results, ("a",))
    assert (row.success.value, row.criteria["strict"].value) == (0.5, 0.5)
    assert row.agreement is not None
    assert row.agreement.episodes == 1, "nobody knows what a lost episode believed"


def test_a_verdict_agrees_when_it_is_true_either_way() -> None:
    believed = [(True, True), (False, False), (True, False), (False, True)]
    results = [result("a", k, success, believed=word) for k, (word, success) in enumerate(believed)]
    (row,) = rows(results, ("a",))
    assert row.agreement is not None
    assert row.agreement.value == 0.5


def test_stages_count_failed_episodes_and_all_failures_on_the_way() -> None:
    results = [
        result("a", 0, True, failed_turns={"grasp": 2}),
        result("a", 1, False, stage="planning", failed_turns={"planning": 1, "grasp": 1}),
        result("a", 2, False, stage="unnoticed"),
    ]
    told = {count.stage: (count.episodes, count.turns) for count in stage_counts(results)}
    assert told == {"planning": (1, 1), "unnoticed": (1, 0), "grasp": (0, 3)}


def test_nothing_gives_no_rows_and_no_average() -> None:
    assert rows([], ("a",)) == ()
    assert average((), []) is None


def test_a_scene_that_is_repeated_counts_once_in_the_interval() -> None:
    results = [result("a", k, k > 0).model_copy(update={"seed": seed}) for k in range(4) for seed in range(3)]
    (row,) = rows(results, ("a",), seeds_draw_scenes=False)
    assert (row.success.value, row.success.episodes, row.success.scenes) == (0.75, 12, 4)
    assert (row.success.low, row.success.high) == wilson(3, 4)
    assert row.repeats_agree == 1.0
    whole = average((row,), results)
    assert whole is not None
    assert whole.success.scenes == 4
    assert whole.repeats_agree == 1.0


def test_repetitions_that_differ_are_told() -> None:
    results = [result("a", 0, True), result("a", 0, False).model_copy(update={"seed": 1}), result("a", 1, True)]
    (row,) = rows(results, ("a",), seeds_draw_scenes=False)
    assert row.repeats_agree == 0.0


def test_shares_are_of_the_time_that_somebody_took() -> None:
    timed = {"simulator": 3.0, "perception": 1.0}
    results = [result("a", 0, True, seconds=timed, wall_seconds=4.0), result("a", 1, True, wall_seconds=2.0)]
    (row,) = rows(results, ("a",))
    assert row.shares == {"simulator": 0.75, "perception": 0.25}
    assert row.per_minute == 20.0
