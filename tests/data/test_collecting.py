"""Collecting: what was to be where, what is written down, and what survives a kill."""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from staged import made_info, stage

from maniagent.agents.binding import bind
from maniagent.data.ledger import attempts_file, key_of, note, parts_of, read_attempts
from maniagent.data.lerobot.publish import STAGED
from maniagent.data.moves import move_to, moves_of
from maniagent.data.outcome import Outcomes, release_point
from maniagent.data.sessions import Costs
from maniagent.data.settings import CollectSettings, checked_settings, resumed_settings
from maniagent.data.summary import summarise, to_markdown
from maniagent.errors import ManiAgentError, UsageError
from maniagent.geometry import rotation_z
from maniagent.perception.viewpoint import Viewpoint
from maniagent.testing import made_object
from maniagent.types import Event, ExecutionReport, ObjectInfo, SubtaskRecord, Verdict

VIEWPOINT = Viewpoint(np.array([0.0, 1.0]), np.array([-1.0, 0.0]))
CARROT = made_object(0, "carrot", (0.20, 0.15), size=(0.12, 0.03, 0.03), yaw=0.7)
PLATE = made_object(1, "plate", (0.30, -0.10), size=(0.18, 0.18, 0.02))


def planned(text: str, *objects: ObjectInfo) -> Outcomes:
    """What is remembered after the first move of `text` was bound to these objects."""
    outcomes = Outcomes()
    keypoints = bind(moves_of(text)[0].sequence, objects, VIEWPOINT)
    outcomes.on_event(Event("planned", 0.0, {"keypoints": keypoints}))
    return outcomes


def record(*objects: ObjectInfo) -> SubtaskRecord:
    return SubtaskRecord("a move", objects, ExecutionReport(completed=True, reached=6))


def moved(thing: ObjectInfo, x: float, y: float) -> ObjectInfo:
    return made_object(0, thing.name, (x, y), size=tuple(thing.extent), yaw=thing.yaw)


# Where things were to be ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "where"),
    [
        ("put the carrot on the plate", (0.30, -0.10)),
        ("put the carrot at (0.33, 0.05)", (0.33, 0.05)),
        ("drag the carrot to (0.25, 0.00)", (0.25, 0.00)),
        ("rotate the carrot by 90 degrees", (0.20, 0.15)),
    ],
)
def test_a_bound_sequence_says_where_the_object_will_be_whatever_the_skill(
    text: str, where: tuple[float, float]
) -> None:
    objects = (CARROT, PLATE)
    expected = release_point(bind(moves_of(text)[0].sequence, objects, VIEWPOINT), objects)
    assert expected == pytest.approx(where)


def test_what_is_never_let_go_was_to_be_nowhere() -> None:
    outcomes = planned("pick up the carrot", CARROT)
    assert outcomes.landing(record(CARROT), [CARROT]) is None
    assert outcomes.judge(record(CARROT), [CARROT])[0] is Verdict.FAILURE


@given(off=st.floats(0.0, 0.12), way=st.floats(-math.pi, math.pi))
def test_success_is_a_matter_of_distance(off: float, way: float) -> None:
    outcomes = planned("put the carrot on the plate", CARROT, PLATE)
    assume(abs(off - outcomes.threshold) > 1e-9)
    seen = moved(CARROT, 0.30 + off * math.cos(way), -0.10 + off * math.sin(way))
    verdict, evidence = outcomes.judge(record(CARROT, PLATE), [PLATE, seen])
    assert verdict is (Verdict.SUCCESS if off <= outcomes.threshold else Verdict.FAILURE)
    assert "cm from where it should" in evidence
    assert outcomes.distances == [pytest.approx(off, abs=1e-9)]


def test_what_is_out_of_view_did_not_arrive_and_has_no_distance() -> None:
    outcomes = planned("put the carrot on the plate", CARROT, PLATE)
    assert outcomes.judge(record(CARROT, PLATE), [PLATE])[0] is Verdict.FAILURE
    assert outcomes.distances == [None]


@given(yaw=st.floats(-math.pi, math.pi), x=st.floats(0.15, 0.4), y=st.floats(-0.25, 0.25))
def test_an_object_is_brought_to_a_start_with_its_yaw(yaw: float, x: float, y: float) -> None:
    keypoints = bind(move_to("carrot", (x, y), yaw).sequence, (CARROT,), VIEWPOINT)
    assert release_point(keypoints, (CARROT,)) == pytest.approx((x, y), abs=6e-4)  # the millimetre that is said
    turned = keypoints[4].T_base_tcp[:3, :3] @ keypoints[1].T_base_tcp[:3, :3].T
    axis = turned @ rotation_z(CARROT.yaw)[:, 0]
    assert abs(axis[0] * math.cos(yaw) + axis[1] * math.sin(yaw)) == pytest.approx(1.0)


# What is written down -------------------------------------------------------------------------------------------


def settings(**changed: object) -> CollectSettings:
    said = {"count": 5, "workers": 2} | changed
    return checked_settings("carrot-on-plate", None, None, **said)


def test_the_same_settings_go_on_and_may_want_more_and_others_are_refused(tmp_path: Path) -> None:
    settings().save(tmp_path)
    settings(count=9).save(tmp_path)
    assert CollectSettings.load(tmp_path).count == 9
    with pytest.raises(UsageError, match="seed 0, not 1"):
        settings(seed=1).save(tmp_path)


def test_a_collection_is_resumed_as_it_was_begun(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="is no collection"):
        resumed_settings(tmp_path, "carrot-on-plate")
    settings(seed=7).save(tmp_path)
    assert resumed_settings(tmp_path, "carrot-on-plate") == settings(seed=7)
    assert resumed_settings(tmp_path, "carrot-on-plate", 9) == settings(seed=7, count=9)
    with pytest.raises(UsageError, match="a collection of carrot-on-plate, not of spoon-on-towel"):
        resumed_settings(tmp_path, "spoon-on-towel")


def test_a_folder_with_something_else_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("years of work")
    with pytest.raises(UsageError, match="no collection"):
        settings().save(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]


@pytest.mark.parametrize(
    ("task", "do", "said", "reason"),
    [
        ("carrot-on-plaet", None, {}, "Did you mean 'carrot-on-plate'"),
        ("hungry", None, {}, "Say with --do"),
        ("drag-plate", None, {}, "draws the points"),
        ("carrot-on-plate", None, {"reset": "magic"}, "reset"),
        ("carrot-on-plate", None, {"pattern": "spiral"}, "pattern"),
    ],
)
def test_what_can_not_be_collected_is_said_before_anything_moves(
    task: str, do: str | None, said: dict[str, object], reason: str
) -> None:
    with pytest.raises(ManiAgentError, match=reason):
        checked_settings(task, do, None, count=1, **said)


@given(st.integers(1, 200), st.integers(1, 16))
def test_the_shares_add_up(count: int, workers: int) -> None:
    shares = [settings(count=count, workers=workers).quota(worker) for worker in range(workers)]
    assert sum(shares) == count
    assert max(shares) - min(shares) <= 1


@given(st.integers(0, 99), st.integers(0, 999_999), st.integers(1, 9))
def test_keys_say_worker_start_and_attempt(worker: int, start: int, attempt: int) -> None:
    assert parts_of(key_of(worker, start, attempt)) == (worker, start, attempt)


def test_every_attempt_is_found_wherever_it_is_and_a_line_cut_off_by_a_kill_costs_itself_alone(tmp_path: Path) -> None:
    note(tmp_path, 0, made_info(key_of(0, 0, 1), label="failed", reason="it slipped"))
    with attempts_file(tmp_path, 0).open("a") as file:
        file.write(made_info(key_of(0, 1, 1)).model_dump_json()[:40])
    stage(tmp_path / STAGED, key_of(0, 1, 1))
    assert [(info.key, info.label) for info in read_attempts(tmp_path)] == [
        ("w00-000000-a1", "failed"),
        ("w00-000001-a1", "valid"),
    ]


def test_the_figures_count_what_they_say() -> None:
    attempts = [
        made_info("w00-000000-a1", label="valid", distance=0.01, truly_valid=True),
        made_info("w00-000001-a1", label="valid", distance=0.02, truly_valid=False),
        made_info("w00-000002-a1", label="failed", distance=0.10, truly_valid=True, reason="too far"),
        made_info(
            "w00-000003-a1", label="doubtful", distance=None, truly_valid=True, reason="out of view", interventions=1
        ),
    ]
    figures = summarise(
        "carrot-on-plate", 4, attempts, Costs(seconds=3600.0, working=7200.0, writing=72.0, encoding=4.0)
    )
    assert (figures.valid, figures.failed, figures.doubtful, figures.interventions) == (2, 1, 1, 1)
    assert (figures.precision, figures.recall) == (0.5, pytest.approx(1 / 3))
    assert (figures.within_paper_threshold, figures.per_hour) == (3, 2.0)
    assert (figures.writing_share, figures.encoding_seconds) == (0.01, 2.0)
    assert "| 1 | too far |" in to_markdown(figures)


# The whole, in the twin -----------------------------------------------------------------------------------------


def command(folder: Path, count: int) -> list[str]:
    said = ["carrot-on-plate", "-n", str(count), "--out", str(folder), "--stage-only", "--json"]
    return [sys.executable, "-m", "maniagent.cli", "collect", *said, "--width", "64", "--height", "48"]


@pytest.mark.slow
def test_a_collection_that_is_killed_goes_on_and_has_lost_nothing(tmp_path: Path) -> None:
    folder = tmp_path / "carrots"
    process = subprocess.Popen(
        command(folder, 3), stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True
    )
    deadline = time.monotonic() + 120
    while not (kept := list((folder / STAGED).glob("w*"))) and time.monotonic() < deadline:
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGKILL)
    process.communicate()
    before = {path.name: (path / "episode.json").read_bytes() for path in kept}

    done = subprocess.run(command(folder, 3), capture_output=True, text=True, timeout=240, check=False)
    assert done.returncode == 0, done.stderr
    figures = json.loads(done.stdout)
    staged = sorted(path for path in (folder / STAGED).glob("w*"))
    assert (figures["valid"], figures["interventions"]) == (3, 0)
    assert figures["precision"] == 1.0
    assert len(staged) == 3
    assert before.items() <= {path.name: (path / "episode.json").read_bytes() for path in staged}.items()
    assert not list((folder / STAGED).glob(".*"))
    assert (folder / "coverage.png").stat().st_size > 1000
    again = subprocess.run(command(folder, 3), capture_output=True, text=True, timeout=60, check=False)
    assert (again.returncode, json.loads(again.stdout)["attempts"]) == (0, figures["attempts"])
