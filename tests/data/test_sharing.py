"""Workers: what one tells of its share, what a crew does with those that die, who helps where nothing goes on."""

from __future__ import annotations

import io
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Self

import numpy as np
import pytest
from rich.console import Console
from staged import made_info

from maniagent.data import crew as crew_module
from maniagent.data import share as share_module
from maniagent.data.chain import Attempt, Stuck
from maniagent.data.collector import collect
from maniagent.data.crew import MOST_DEATHS, Crew, Died, Hand
from maniagent.data.helping import AskPerson, helper_for
from maniagent.data.keeper import Kept
from maniagent.data.ledger import key_of
from maniagent.data.sessions import Costs, Session, read_costs
from maniagent.data.settings import CollectSettings, checked_settings
from maniagent.data.share import MOST_FAILURES, MOST_INTERVENTIONS, MOST_REFUSALS, Asked, Said, Share, Tried
from maniagent.data.starts import Start
from maniagent.data.table import Table
from maniagent.errors import SetupError, UnknownNameError, UsageError
from maniagent.testing import made_object

VALID, FAILED = Attempt("valid", "", 0.01, None), Attempt("failed", "it slipped", 0.2, None)
TABLE = Table.seen(made_object(0, "carrot", (0.2, 0.1), size=(0.12, 0.03, 0.03)), [])


def settings(**said: object) -> CollectSettings:
    return checked_settings("carrot-on-plate", None, None, **{"count": 3} | said)


class Station:
    """A table on which bringing and performing go as they are told; the last of each goes on for ever."""

    def __init__(self, brings: Sequence[str | Stuck], attempts: Sequence[Attempt]) -> None:
        self.table, self.chain, self.put_at = TABLE, self, []
        self._brings, self._attempts = _on_and_on(brings), _on_and_on(attempts)

    def __call__(self, *_: object) -> Self:
        return self

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def starts(self, first: int) -> Iterator[Start]:
        return (Start(index, (0.2, 0.0), 0.0) for index in count(first))

    def bring(self, start: Start) -> str:
        went = next(self._brings)
        if isinstance(went, Stuck):
            raise went
        return went

    def perform(self, seed: int) -> Attempt:
        return next(self._attempts)

    def put(self, start: Start) -> None:
        self.put_at.append(start.index)

    def truth(self) -> tuple[None, None]:
        return None, None


def _on_and_on(things: Sequence[Any]) -> Iterator[Any]:
    yield from things
    while True:
        yield things[-1]


@pytest.fixture
def share(monkeypatch: pytest.MonkeyPatch) -> Callable[..., list[Said]]:
    """Work a share off at such a station; returns all that is told."""

    def work(brings: Sequence[str | Stuck], attempts: Sequence[Attempt], **said: Any) -> list[Said]:
        monkeypatch.setattr(share_module, "TwinStation", Station(brings, attempts))
        return list(Share(settings(**said.pop("settings", {})), 0, **said).work())

    return work


def told(said: Sequence[Said]) -> list[tuple[int, str, int]]:
    """Start, label and interventions of each attempt."""
    infos = [one.info for one in said if isinstance(one, Tried)]
    return [(int(info.key[4:10]), info.label, info.interventions) for info in infos]


# A share --------------------------------------------------------------------------------------------------------


def test_a_share_tells_its_table_first_then_every_attempt_until_enough_are_valid(share: Any) -> None:
    said = share([""], [VALID, FAILED, VALID])
    assert said[0] == TABLE
    assert told(said) == [(0, "valid", 0), (1, "failed", 0), (1, "valid", 0), (2, "valid", 0)]


def test_what_earlier_sessions_collected_counts_and_is_not_tried_again(share: Any) -> None:
    before = [made_info(key_of(0, 0, 1)), made_info(key_of(0, 1, 1), label="failed"), made_info(key_of(1, 5, 1))]
    said = share([""], [VALID], before=before, table=TABLE)
    assert told(said) == [(2, "valid", 0), (3, "valid", 0)]
    assert not any(isinstance(one, Table) for one in said)
    assert share([""], [VALID], before=[made_info(key_of(0, i, 1)) for i in range(3)]) == []


def test_where_the_robot_is_stuck_help_is_asked_for_and_counted(share: Any) -> None:
    said = share([Stuck("It rolled away."), ""], [VALID])
    assert said[1] == Asked("It rolled away.")
    assert told(said) == [(0, "valid", 1), (1, "valid", 0), (2, "valid", 0)]


def test_a_start_that_can_not_be_had_is_given_up_and_too_many_of_them_mean_stuck(share: Any) -> None:
    said = share(["out of reach", ""], [VALID])
    assert told(said)[:2] == [(0, "failed", 0), (1, "valid", 0)]
    said = share(["out of reach"] * MOST_REFUSALS + [""], [VALID])
    assert [isinstance(one, Asked) for one in said].index(True) == 1 + MOST_REFUSALS - 1
    assert told(said)[MOST_REFUSALS - 1] == (MOST_REFUSALS - 1, "valid", 1)


def test_help_that_does_not_help_ends_it(share: Any) -> None:
    with pytest.raises(Stuck, match="nailed"):
        share([Stuck("It is nailed down.")], [FAILED])
    with pytest.raises(Stuck):
        share([Stuck("It rolls away each time.")], [VALID], settings={"count": MOST_INTERVENTIONS + 1})


def test_attempts_that_never_succeed_end_it(share: Any) -> None:
    with pytest.raises(SetupError, match=f"{MOST_FAILURES} attempts in a row came to nothing; the last: it slipped"):
        share([""], [FAILED])


@pytest.mark.slow
def test_the_same_seed_makes_the_same_episodes() -> None:
    said = settings(count=2, sampling={"width": 64, "height": 48})
    one, again = (list(Share(said, 0).work()) for _ in range(2))
    assert one[0] == again[0]
    for a, b in zip(one[1:], again[1:], strict=True):
        assert isinstance(a, Tried) and isinstance(b, Tried)  # noqa: PT018
        assert a.info.model_copy(update={"seconds": 0.0}) == b.info.model_copy(update={"seconds": 0.0})
        assert a.recording is not None and b.recording is not None  # noqa: PT018
        assert np.array_equal(a.recording.steps.joints, b.recording.steps.joints)
        assert np.array_equal(a.recording.rgb["main"], b.recording.rgb["main"])
    other = list(Share(settings(count=1, seed=1, sampling={"width": 64, "height": 48}), 0).work())
    assert other[1].info.start != one[1].info.start  # type: ignore[union-attr]


# A crew ---------------------------------------------------------------------------------------------------------


class ScriptedPlace:
    """Where each worker says what its script holds; an exception is raised, and ends that process."""

    def __init__(self, *scripts: list[Any]) -> None:
        self.scripts = scripts
        self.started: list[int] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def start(self, worker: int) -> Hand:
        self.started.append(worker)
        return ScriptedHand(self.scripts[worker])

    def wait(self, hands: Sequence[Hand], seconds: float) -> Sequence[Hand]:
        return [hand for hand in hands if isinstance(hand, ScriptedHand) and hand.ready]

    def log(self, worker: int) -> str:
        return "its log"


class ScriptedHand:
    def __init__(self, script: list[Any]) -> None:
        self._script, self.waits = script, False

    @property
    def ready(self) -> bool:
        return not self.waits and (not self._script or self._script[0] is not ...)

    def take(self) -> Any:
        assert not self.waits
        said = self._script.pop(0) if self._script else None
        if isinstance(said, Exception):
            raise said
        self.waits = said is not None
        return said

    def go_on(self) -> None:
        self.waits = False

    def kill(self) -> None:
        self.waits = True


def kept(key: str) -> Kept:
    return Kept(made_info(key), 0.1)


def hear_all(crew: Crew) -> list[Any]:
    heard = []
    while crew.busy:
        heard += crew.hear(0.0)
        crew.go_on()
    return heard


def test_who_has_said_something_waits_and_the_others_go_on(tmp_path: Path) -> None:
    place = ScriptedPlace([kept("w00-000000-a1"), kept("w00-000001-a1")], [TABLE, kept("w01-000000-a1")])
    crew = Crew(place, 2, tmp_path)
    assert [said.info.key for said in crew.hear(0.0)] == ["w00-000000-a1"]
    assert [said.info.key for said in crew.hear(0.0)] == ["w01-000000-a1"]
    assert list(crew.hear(0.0)) == []
    assert [said.info.key for said in hear_all(crew)] == ["w00-000001-a1"]
    assert Table.load(tmp_path, 1) == TABLE


def test_one_that_dies_is_replaced_and_one_that_always_dies_ends_it(tmp_path: Path) -> None:
    deaths = [Died("exit status 1")] * (MOST_DEATHS - 1)
    place = ScriptedPlace([*deaths, kept("w00-000000-a1"), *deaths, kept("w00-000001-a1")])
    assert len(hear_all(Crew(place, 1, tmp_path))) == 2
    assert len(place.started) == 1 + 2 * len(deaths)
    with pytest.raises(SetupError, match=r"died 3 times running \(exit status 1\); its log may say why"):
        hear_all(Crew(ScriptedPlace([Died("exit status 1")] * MOST_DEATHS), 1, tmp_path))


def test_one_that_says_nothing_for_long_is_replaced_unless_it_waits_itself(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = [0.0]
    monkeypatch.setattr(crew_module, "time", SimpleNamespace(monotonic=lambda: now[0], sleep=lambda seconds: None))
    place = ScriptedPlace([kept("w00-000000-a1"), ...])
    crew = Crew(place, 1, tmp_path)
    assert len(list(crew.hear(0.0))) == 1
    now[0] += 10 * crew_module.SILENCE  # a person is being asked
    list(crew.hear(0.0))
    crew.go_on()
    list(crew.hear(0.0))
    assert place.started == [0]
    now[0] += 1.1 * crew_module.SILENCE
    list(crew.hear(0.0))
    assert place.started == [0, 0]


def test_a_table_that_was_cut_off_is_said_to_be(tmp_path: Path) -> None:
    TABLE.save(tmp_path, 0)
    path = tmp_path / "plan-w00.json"
    assert Table.load(tmp_path, 0) == TABLE
    path.write_bytes(path.read_bytes()[:-20])
    with pytest.raises(UsageError, match=r"plan-w00\.json can't be read.*Remove it"):
        Table.load(tmp_path, 0)


# Help -----------------------------------------------------------------------------------------------------------


def test_a_person_is_told_what_to_do_and_waited_for() -> None:
    console = Console(file=io.StringIO(), width=100)
    paused = []

    @contextmanager
    def pause() -> Iterator[Console]:
        paused.append(True)
        yield console

    AskPerson(pause, io.StringIO("\n"))("The carrot can't be brought to its next start.")
    said = console.file.getvalue()  # type: ignore[attr-defined]
    assert "can't be brought" in said
    assert "press Enter" in said
    assert paused == [True]
    with pytest.raises(SetupError, match="Nobody is there"):
        AskPerson(pause, io.StringIO(""))("The carrot is gone.")


def test_who_helps_is_chosen_by_name() -> None:
    helper_for("put", None)("no matter")  # type: ignore[arg-type]
    with pytest.raises(SetupError, match=r"It is gone\. Put things back"):
        helper_for("stop", None)("It is gone.")  # type: ignore[arg-type]
    with pytest.raises(UnknownNameError, match="ask, put, stop"):
        helper_for("pray", None)  # type: ignore[arg-type]


# Costs ----------------------------------------------------------------------------------------------------------


def test_costs_add_up_over_sessions_and_a_kill_costs_the_last_line_alone(tmp_path: Path) -> None:
    assert read_costs(tmp_path) == Costs()
    for writing in (1.0, 2.0):
        session = Session(tmp_path, workers=2)
        session.add(writing=writing)
        session.add(encoding=4.0)
    whole = read_costs(tmp_path)
    assert (whole.writing, whole.encoding) == (3.0, 8.0)
    assert whole.working == pytest.approx(2 * whole.seconds, abs=0.01)
    with (tmp_path / "sessions.jsonl").open("a") as file:
        file.write('{"session": "x", "seco')
    assert read_costs(tmp_path) == whole


# A cluster ------------------------------------------------------------------------------------------------------


def test_without_ray_the_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(SetupError, match=r"pip install 'maniagent\[ray\]'"):
        collect(settings(), tmp_path, Nobody(), None, ray="auto")


@pytest.mark.slow
def test_on_a_cluster_episodes_come_back_to_where_it_was_called(tmp_path: Path) -> None:
    pytest.importorskip("ray")
    said = settings(count=2, workers=2, reset="teleport", sampling={"width": 64, "height": 48})
    summary = collect(said, tmp_path, Nobody(), None, ray="local")
    assert (summary.valid, summary.precision) == (2, 1.0)
    assert len(list((tmp_path / "episodes").glob("w*/rgb-main.npy"))) == 2
    with pytest.raises(UsageError, match="too few for 200 workers"):
        collect(settings(workers=200, count=200), tmp_path / "more", Nobody(), None, ray="local")


class Nobody:
    """Watches nothing."""

    def begin(self, *_: object) -> None: ...

    def add(self, *_: object) -> None: ...

    def published(self, *_: object) -> None: ...
