"""Replays a run folder: the agents decide anew about what was seen then, and every decision is compared."""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from ..agents.cache import Hit, Kind, with_cache
from ..agents.events import EventLog, Observer
from ..agents.loop import AgentLoop
from ..agents.minds import minds_agents
from ..agents.protocols import Agents
from ..agents.rules import rules_agents
from ..errors import UsageError
from ..models.replay import ReplayModel
from ..perception.detectors.registry import make_detector
from ..perception.rig import Rig
from ..types import ActionSequence, RunVerdict, Subtask, SubtaskRecord
from .compare import Comparison, Difference, Different
from .record import RecordedRun, read_run
from .robot import EndOfRecord, ReplayRobot

MakeAgents = Callable[[Rig], Agents]
_ON_MODELS = re.compile(r"agents \(vlm .*, llm .*, detector (?P<detector>.+)\)")
"""How agents on models are named."""


@dataclass(frozen=True)
class ReplayResult:
    """What a replay found."""

    folder: Path
    turns: int
    """Replayed, the last one perhaps not to its end."""
    decisions: int
    """Scenes, sub-tasks, located objects and sequences that were the same as recorded."""
    complete: bool
    """Whether the recorded run came to its own end; else the replay goes as far as the record."""
    difference: Difference | None
    """The first one; None where everything is the same."""

    @property
    def same(self) -> bool:
        """Whether every decision was the same."""
        return self.difference is None


def replay(folder: Path, make_agents: MakeAgents | None = None, observers: Sequence[Observer] = ()) -> ReplayResult:
    """Carry out a recorded run again, without robot, simulator or network, until its end or the first difference.

    `make_agents` makes the agents that decide; without it they are those of the run: the rules, or the four agents with
    maniagent's own prompts and the recorded answers in the models' place. They are made without a cache: where the run
    had one, it answers as it did then.

    Raises UsageError where the folder can't be replayed.
    """
    run = read_run(folder)
    comparison = Comparison(run)
    log = EventLog([comparison, *observers])
    robot = ReplayRobot(run)
    agents = (make_agents or _agents_of(run))(run.rig)
    looked_up = [event for event in run.events if event["kind"] == "cache"]
    if looked_up:
        agents = with_cache(agents, _RecordedCache(run), log)
    budget = replace(run.budget, seconds=float("inf"))  # the clock is no part of the record
    difference = None
    try:
        result = AgentLoop(robot, agents, log, budget).run(run.instruction)
    except Different as found:
        difference = found.difference
    except EndOfRecord:
        difference = _ended_early(run, comparison)
    else:
        if run.complete and (result.verdict, result.reason) != (run.verdict, run.reason):
            told, tells = f"{run.verdict}: {run.reason}", f"{result.verdict}: {result.reason}"
            difference = Difference(comparison.turn, "run_finished", "", told, tells)
    return ReplayResult(folder, comparison.turn, comparison.decisions, run.complete, difference)


def _agents_of(run: RecordedRun) -> MakeAgents:
    if run.agents == "rules":
        return rules_agents
    named = _ON_MODELS.fullmatch(run.agents)
    if named is None:
        raise UsageError(f"The run's agents were {run.agents!r}; only those that maniagent brings can be made by name.")
    model = ReplayModel(run.folder)
    return lambda rig: minds_agents(rig, model, model, make_detector(named["detector"], model))


def _ended_early(run: RecordedRun, comparison: Comparison) -> Difference | None:
    """What it means that the replay asks for more than the record holds: nothing, where the run was stopped there.

    A run is stopped by a kill, by hand, or by the clock; the arm may still have been on its way home.
    """
    rest = run.events[comparison.compared :]
    stopped = not run.complete or run.verdict is RunVerdict.OUT_OF_BUDGET
    if stopped and all(event["kind"] in ("move", "homed") for event in rest):
        return None
    recorded = rest[0] if rest else f"{run.verdict}: {run.reason}"
    return Difference(comparison.turn, "the robot", "", recorded, "asked for something else")


class _RecordedCache:
    """A `Cache` that serves what was served in a recorded run."""

    def __init__(self, run: RecordedRun) -> None:
        self._lookups = deque(event for event in run.events if event["kind"] == "cache")

    def find(self, subtask: Subtask) -> Hit | None:
        """The next lookup's sequence; whether the same was looked up, the comparison finds out."""
        if not self._lookups:
            raise EndOfRecord
        lookup = self._lookups.popleft()
        if not lookup["found"]:
            return None
        try:
            return Hit(Kind(lookup["found"]), ActionSequence.model_validate(lookup["sequence"]))
        except ValueError as error:
            raise UsageError(
                f"The log is damaged: what the cache served on turn {lookup['turn']} is no sequence."
            ) from error

    def learn(self, record: SubtaskRecord, refused: ActionSequence | None) -> None:
        """A recorded run teaches nothing new."""
