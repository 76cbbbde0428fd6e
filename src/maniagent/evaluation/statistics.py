"""Rates with honest intervals, and what is left of many episodes when they are put together."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from statistics import fmean, median
from typing import Self

from .episode import EpisodeResult, Job

Z_95 = 1.959963984540054
"""The normal distribution's 97.5 % quantile."""


def wilson(successes: float, trials: int, z: float = Z_95) -> tuple[float, float]:
    """The Wilson score interval of a success rate; (0, 1) where nothing was tried.

    E. B. Wilson, Probable inference, the law of succession, and statistical inference, JASA 22 (1927), equation 5.
    Unlike the normal approximation it stays within [0, 1] and holds up at rates near 0 and 1 and for few trials.
    """
    if trials == 0:
        return 0.0, 1.0
    rate = successes / trials
    centre = (rate + z**2 / (2 * trials)) / (1 + z**2 / trials)
    margin = z / (1 + z**2 / trials) * math.sqrt(rate * (1 - rate) / trials + z**2 / (4 * trials**2))
    # At rates of exactly 0 and 1 the interval begins and ends there; rounding errors must not say otherwise.
    return (0.0 if successes <= 0 else centre - margin), (1.0 if successes >= trials else centre + margin)


@dataclass(frozen=True)
class Rate:
    """A share of episodes, with its 95 % interval."""

    value: float
    low: float
    high: float
    episodes: int
    scenes: int
    """Different ones among the episodes: what the interval counts, as a repetition proves little."""

    @classmethod
    def of(cls, outcomes: Sequence[bool], scenes: int | None = None) -> Self:
        """The share of outcomes that are true; they are of as many scenes where not of fewer."""
        value = sum(outcomes) / len(outcomes) if outcomes else 0.0
        return cls._around(value, len(outcomes), len(outcomes) if scenes is None else scenes)

    @classmethod
    def average(cls, rates: Sequence[Self]) -> Self:
        """The mean of rates, each of the same weight.

        Its interval is that of all scenes taken together, which is exact where the rates are of equally many.
        """
        value = fmean(rate.value for rate in rates) if rates else 0.0
        return cls._around(value, sum(rate.episodes for rate in rates), sum(rate.scenes for rate in rates))

    @classmethod
    def _around(cls, value: float, episodes: int, scenes: int) -> Self:
        return cls(value, *wilson(value * scenes, scenes), episodes, scenes)


@dataclass(frozen=True)
class Row:
    """What the episodes of one task, or of all, come to."""

    task: str
    success: Rate
    criteria: dict[str, Rate]
    """Success by further measures, where there are any."""
    agreement: Rate | None
    """How often the actor's own verdict is the true one; None where it has none."""
    repeats_agree: float | None
    """Share of the scenes that were played several times and came out the same each time; None without any."""
    turns: float | None
    """Median, as are the following two; None where nobody counted."""
    steps: float | None
    robot_seconds: float | None
    model_calls: int
    """Of all episodes together, as are the tokens."""
    tokens: int
    wall_seconds_median: float
    wall_seconds_max: float
    per_minute: float
    """Episodes that one worker plays in a minute."""
    shares: dict[str, float]
    """What the wall time went into: parts of 1, where somebody took the time."""


@dataclass(frozen=True)
class StageCount:
    """How often one stage went wrong."""

    stage: str
    episodes: int
    """Failed episodes that failed there."""
    turns: int
    """Failures there in all episodes, those that were overcome included."""


def rows(results: Iterable[EpisodeResult], tasks: Sequence[str], seeds_draw_scenes: bool = True) -> tuple[Row, ...]:
    """A row for each task of which there are results, in the order of `tasks`.

    Where seeds don't draw scenes, episodes that differ in their seed alone are repetitions of one scene.
    """
    by_task: dict[str, list[EpisodeResult]] = {task: [] for task in tasks}
    for result in results:
        by_task[result.task].append(result)
    return tuple(_row(task, of_task, seeds_draw_scenes) for task, of_task in by_task.items() if of_task)


def average(per_task: Sequence[Row], results: Sequence[EpisodeResult]) -> Row | None:
    """The average over tasks: rates weigh each task the same, all else is over episodes; None without any."""
    if not results:
        return None
    whole = _row("average", results, seeds_draw_scenes=True)
    repeated = [row.repeats_agree for row in per_task if row.repeats_agree is not None]
    agreements = [row.agreement for row in per_task if row.agreement is not None]
    return Row(
        **{
            **vars(whole),
            "success": Rate.average([row.success for row in per_task]),
            "criteria": {
                name: Rate.average([row.criteria[name] for row in per_task if name in row.criteria])
                for name in whole.criteria
            },
            "agreement": Rate.average(agreements) if agreements else None,
            "repeats_agree": fmean(repeated) if repeated else None,
        }
    )


def stage_counts(results: Iterable[EpisodeResult]) -> tuple[StageCount, ...]:
    """What went wrong, by stage, what cost most episodes first."""
    episodes: Counter[str] = Counter()
    turns: Counter[str] = Counter()
    for result in results:
        turns.update(result.failed_turns)
        if not result.success:
            episodes[result.stage] += 1
    stages = sorted(episodes | turns, key=lambda stage: (-episodes[stage], -turns[stage], stage))
    return tuple(StageCount(stage, episodes[stage], turns[stage]) for stage in stages)


def _row(task: str, results: Sequence[EpisodeResult], seeds_draw_scenes: bool) -> Row:
    scenes: defaultdict[int | Job, list[bool]] = defaultdict(list)
    for result in results:
        scenes[result.job if seeds_draw_scenes else result.episode].append(result.success)
    repeated = [len(set(outcomes)) == 1 for outcomes in scenes.values() if len(outcomes) > 1]
    names = dict.fromkeys(name for result in results for name in result.criteria)
    believed = [result.believed == result.success for result in results if result.believed is not None]
    wall = [result.wall_seconds for result in results]
    return Row(
        task=task,
        success=Rate.of([result.success for result in results], len(scenes)),
        # An episode that broke off has no criteria; it counts as a failure by all of them.
        criteria={
            name: Rate.of([result.criteria.get(name, False) for result in results], len(scenes)) for name in names
        },
        agreement=Rate.of(believed) if believed else None,
        repeats_agree=fmean(repeated) if repeated else None,
        turns=_median([result.turns for result in results]),
        steps=_median([result.steps for result in results]),
        robot_seconds=_median([result.robot_seconds for result in results]),
        model_calls=sum(result.model_calls for result in results),
        tokens=sum(result.tokens for result in results),
        wall_seconds_median=median(wall),
        wall_seconds_max=max(wall),
        per_minute=60 * len(wall) / sum(wall) if sum(wall) > 0 else 0.0,
        shares=_shares(results),
    )


def _shares(results: Iterable[EpisodeResult]) -> dict[str, float]:
    spent: defaultdict[str, float] = defaultdict(float)
    for result in results:
        for name, seconds in result.seconds.items():
            spent[name] += seconds
    total = sum(spent.values())
    return {name: seconds / total for name, seconds in spent.items()} if total > 0 else {}


def _median(values: Iterable[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return median(known) if known else None
