from maniagent.agents.events import EventLog
from maniagent.types import Event


class Listener:
    def __init__(self, name: str, heard: list[tuple[str, Event]]) -> None:
        self.name, self.heard = name, heard

    def on_event(self, event: Event) -> None:
        self.heard.append((self.name, event))


def test_every_observer_hears_every_event_in_the_order_they_were_given() -> None:
    heard: list[tuple[str, Event]] = []
    log = EventLog([Listener("a", heard), Listener("b", heard)])
    log.emit("observed", turn=1)
    log.emit("failed", turn=1, reason="dark")
    assert [(name, event.kind) for name, event in heard] == [
        ("a", "observed"), ("b", "observed"), ("a", "failed"), ("b", "failed"),
    ]  # fmt: skip
    assert heard[0][1] is heard[1][1]
    assert heard[2][1].data == {"turn": 1, "reason": "dark"}


def test_times_count_from_the_logs_creation() -> None:
    heard: list[tuple[str, Event]] = []
    ticks = iter([100.0, 100.5, 103.0])
    log = EventLog([Listener("a", heard)], clock=lambda: next(ticks))
    log.emit("observed")
    log.emit("described")
    assert [event.time for _, event in heard] == [0.5, 3.0]


def test_nobody_has_to_listen() -> None:
    EventLog().emit("observed", turn=1)


def test_the_log_knows_the_turn_it_is() -> None:
    log = EventLog()
    turns = [log.turn]
    for turn in (1, 2):
        log.emit("observed", turn=turn)
        log.emit("frame", rgb=None)
        turns.append(log.turn)
    assert turns == [0, 1, 2]
