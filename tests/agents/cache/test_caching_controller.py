"""The controller before the controller, alone and in the loop."""

from pathlib import Path
from typing import Any

import pytest
from sequences import judged, put, subtask

from maniagent.agents.cache import ActionCache, CacheStore, CachingController, with_cache
from maniagent.agents.events import EventLog
from maniagent.agents.loop import AgentLoop
from maniagent.agents.protocols import Located
from maniagent.testing import FakeRobot, ScriptedAgents, made_object
from maniagent.types import ActionSequence, Event, Subtask, Verdict

OBJECTS = (made_object(0, "carrot"), made_object(1, "plate", (0.3, 0.2)))
DONE = Subtask(previous=Verdict.SUCCESS, reason="it is there", done=True)


@pytest.fixture
def cache(tmp_path: Path) -> ActionCache:
    return ActionCache(CacheStore(tmp_path / "cache.sqlite"))


class Listener:
    def __init__(self) -> None:
        self.events: list[Event] = []

    def on_event(self, event: Event) -> None:
        self.events.append(event)

    def data(self, kind: str) -> list[Any]:
        return [event.data for event in self.events if event.kind == kind]


def carry_out(
    cache: ActionCache, sequences: list[ActionSequence], refuse: Any = lambda keypoints: ""
) -> tuple[ScriptedAgents, CachingController, Listener]:
    """One run of "put the carrot on the plate", achieved at the first attempt that the robot accepts."""
    scripted = ScriptedAgents([subtask(), DONE], [Located(OBJECTS, ())], sequences)
    listener = Listener()
    log = EventLog([listener])
    agents = with_cache(scripted.as_agents(), cache, log)
    AgentLoop(FakeRobot(refuse=refuse), agents, log).run("put the carrot on the plate")
    assert isinstance(agents.controller, CachingController)
    return scripted, agents.controller, listener


def test_the_second_run_does_not_ask_the_controller(cache: ActionCache) -> None:
    scripted, controller, listener = carry_out(cache, [put()])
    assert (scripted.feedback, controller.calls_saved) == ([""], 0)
    assert listener.data("cache") == [{"turn": 1, "found": "", "sequence": None}]
    scripted, controller, listener = carry_out(cache, [])
    assert (scripted.feedback, controller.calls_saved) == ([], 1)
    assert listener.data("cache") == [{"turn": 1, "found": "text", "sequence": put()}]
    assert [record.verdict for record in scripted.learned] == [Verdict.SUCCESS], "the inner controller learns on"


def test_what_is_refused_today_is_written_anew_and_replaced(cache: ActionCache) -> None:
    carry_out(cache, [put()])
    left = ["It is out of reach."]
    scripted, controller, _ = carry_out(cache, [put(height=0.2)], lambda keypoints: left.pop() if left else "")
    assert (scripted.feedback, controller.calls_saved) == (["It is out of reach."], 0)
    hit = cache.find(subtask())
    assert hit is not None
    assert hit.sequence == put(height=0.2)


def test_what_was_refused_long_ago_is_forgotten_at_the_next_sub_task(cache: ActionCache) -> None:
    cache.learn(judged(subtask(), put(), Verdict.SUCCESS), None)
    agents = ScriptedAgents([], [], [put(height=0.2)])
    controller = CachingController(agents, cache)
    assert controller.write(subtask(), OBJECTS) == put()
    assert controller.write(subtask(), OBJECTS, "It is out of reach.") == put(height=0.2)
    assert controller.write(subtask(), OBJECTS) == put()
    controller.learn(judged(subtask(), put(height=0.2), Verdict.SUCCESS))
    hit = cache.find(subtask())
    assert hit is not None
    assert hit.sequence == put()
    assert controller.calls_saved == 1
