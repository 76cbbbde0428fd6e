"""Evaluations of episodes that behave badly, in real worker processes."""

import json
import os
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import fakes
import pytest

from maniagent.errors import SetupError, UnknownNameError, UsageError
from maniagent.evaluation import suites
from maniagent.evaluation.episode import EpisodeResult
from maniagent.evaluation.results import RESULTS
from maniagent.evaluation.runner import evaluate
from maniagent.evaluation.summary import Summary


class Notes:
    """A watcher that writes down what it is told."""

    def __init__(self) -> None:
        self.total, self.before, self.added = 0, 0, list[EpisodeResult]()

    def begin(self, name: str, total: int, done: Sequence[EpisodeResult]) -> None:
        self.total, self.before = total, len(done)

    def add(self, result: EpisodeResult) -> None:
        self.added.append(result)


def play(out: Path, *tasks: str, episodes: int = 1, time_limit: float = 60.0, notes: Notes | None = None) -> Summary:
    return evaluate(
        fakes.suite(*tasks), out=out, episodes=episodes, seeds=1, workers=2, time_limit=time_limit, watcher=notes
    )


@pytest.mark.slow
def test_whatever_happens_to_an_episode_it_alone_fails_and_says_why(tmp_path: Path) -> None:
    summary = play(tmp_path, "win", "lose", "raise", "exit", "die", "hang", "chatter", time_limit=2.0)
    assert summary.finished == summary.total == 7
    told = {failed.result.task: (failed.result.stage, failed.result.reason) for failed in summary.failed}
    assert told == {
        "lose": ("unnoticed", "I see <b>it</b> | there"),
        "raise": ("crash", "ValueError: the <arm> is gone"),
        "exit": ("crash", "The worker process died: exit status 3."),
        "die": ("crash", "The worker process died: killed by SIGKILL."),
        "hang": ("time-limit", "Stopped because it took longer than 2 s."),
    }
    assert [row.task for row in summary.rows if row.success.value == 1] == ["win", "chatter"]
    log = (tmp_path / "workers.log").read_text()
    assert "a library talks" in log
    assert "Traceback" in log
    assert summary.failed[0].repeat == "play lose-s0-e000 --with rules"


@pytest.mark.slow
def test_what_is_finished_is_not_played_again(tmp_path: Path) -> None:
    whole, rest = Notes(), Notes()
    first = play(tmp_path, "win", "lose", episodes=2, notes=whole)
    assert (whole.total, whole.before, len(whole.added)) == (4, 0, 4)
    lines = (tmp_path / RESULTS).read_bytes().splitlines(keepends=True)
    (tmp_path / RESULTS).write_bytes(b"".join(lines[:3]) + lines[3][:25])
    second = play(tmp_path, "win", "lose", episodes=2, notes=rest)
    assert (rest.before, len(rest.added)) == (3, 1)
    assert second.finished == 4
    assert [row.success for row in second.rows] == [row.success for row in first.rows]
    assert (tmp_path / RESULTS).read_bytes().startswith(b"".join(lines[:3]))


@pytest.mark.slow
def test_a_worker_is_replaced_before_it_grows_too_big(tmp_path: Path) -> None:
    suite = replace(fakes.suite("who"), episodes_per_process=2)
    summary = evaluate(suite, out=tmp_path, episodes=6, seeds=1, workers=2, time_limit=60.0)
    assert summary.finished == 6
    told = [json.loads(line)["reason"] for line in (tmp_path / RESULTS).read_bytes().splitlines()]
    assert all(told.count(process) <= 2 for process in told)


@pytest.mark.slow
def test_what_no_episode_can_do_ends_the_evaluation_and_counts_as_nothing(tmp_path: Path) -> None:
    with pytest.raises(SetupError, match="Nothing renders here"):
        play(tmp_path, "refuse")
    assert (tmp_path / RESULTS).read_bytes() == b""
    assert json.loads((tmp_path / "summary.json").read_text())["average"] is None


@pytest.mark.slow
def test_stopping_keeps_what_is_done_and_ends_what_is_under_way(tmp_path: Path) -> None:
    class Impatient(Notes):
        def add(self, result: EpisodeResult) -> None:
            raise KeyboardInterrupt

    start = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        play(tmp_path, "win", "hang", notes=Impatient())
    assert time.monotonic() - start < 30
    told = json.loads((tmp_path / "summary.json").read_text())
    assert (told["complete"], told["finished"], told["total"]) == (False, 1, 2)


@pytest.mark.parametrize(
    "wrong", [{"episodes": 0}, {"seeds": 0}, {"workers": 0}, {"time_limit": 0.0}, {"episodes": 20000}]
)
def test_numbers_that_make_no_sense_are_refused(tmp_path: Path, wrong: dict[str, int]) -> None:
    with pytest.raises(UsageError, match="should be"):
        evaluate("tabletop", out=tmp_path / "new", **wrong)  # type: ignore[arg-type] # one option of several
    assert not (tmp_path / "new").exists()


def test_unknown_names_suggest_the_nearest(tmp_path: Path) -> None:
    with pytest.raises(UnknownNameError, match="Did you mean 'tabletop'"):
        evaluate("table-top", out=tmp_path / "new")
    with pytest.raises(UnknownNameError, match="Did you mean 'rules'"):
        evaluate("tabletop", actor="rule", out=tmp_path / "new")
    assert not (tmp_path / "new").exists()


def test_suites_are_what_they_are_called() -> None:
    sizes = {name: len(suites.get(name).tasks) for name in suites.names()}
    assert sizes == {"paper8": 8, "bridge": 4, "tabletop4": 4, "tabletop": 8, "simpler": 4}
    assert suites.get("carrot-on-plate").tasks == ("carrot-on-plate",)


def test_without_ray_the_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(SetupError, match=r"pip install 'maniagent\[ray\]'"):
        evaluate(fakes.suite("win"), out=tmp_path, ray="auto")


@pytest.mark.slow
def test_ray_tells_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("ray")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(sys.path))  # the cluster's processes import the fakes, too
    summary = evaluate(
        fakes.suite("win", "die", "hang"), out=tmp_path, episodes=1, seeds=1, workers=2, time_limit=2.0, ray="local"
    )
    assert [(row.task, row.success.value) for row in summary.rows] == [("win", 1.0), ("die", 0.0), ("hang", 0.0)]
    assert [failed.result.stage for failed in summary.failed] == ["crash", "time-limit"]
    with pytest.raises(SetupError, match="Nothing renders here"):
        evaluate(fakes.suite("refuse"), out=tmp_path / "refused", episodes=1, seeds=1, ray="local")
