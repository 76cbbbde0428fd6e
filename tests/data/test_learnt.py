"""Moves from a recorded run: what worked is taken, and what can't serve elsewhere is refused before anything moves."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

from maniagent.agents.events import EventLog
from maniagent.agents.loop import AgentLoop, Budget
from maniagent.agents.protocols import Located
from maniagent.agents.rules import rules_agents
from maniagent.cli import app
from maniagent.console.recorder import Recorder
from maniagent.data.chain import Chain
from maniagent.data.learnt import learnt_moves
from maniagent.data.moves import Move, check_moves, moves_of
from maniagent.data.settings import checked_settings, phrases_in, read_calls
from maniagent.envs.tabletop import TabletopEnv
from maniagent.errors import UsageError
from maniagent.motion import ArmModel
from maniagent.perception.rig import Rig
from maniagent.robots.body_filter import BodyFilter
from maniagent.robots.sampling import Sampling
from maniagent.robots.simulated import SimulatedRobot
from maniagent.tasks import task_named
from maniagent.testing import FakeRobot, ScriptedAgents, made_object
from maniagent.types import (
    ActionSequence,
    ExecutionReport,
    ObjectInfo,
    Orientation,
    PointAnchor,
    Subtask,
    Verdict,
)

TASK = "menemen"
INSTRUCTION = "put the ingredients needed for Menemen onto the plate"
EGG, PEPPER, PLATE = "brown egg", "green pepper", "white plate"
ON_PLATE = moves_of("put the egg on the plate")[0].sequence
SLIPPED = ExecutionReport(completed=False, reached=3, reason="The object slipped out of the gripper.", stage="grasp")
WENT = ExecutionReport(completed=True, reached=6)


def want(previous: Verdict, thing: str, how: str = "left of its middle") -> Subtask:
    """A sub-task in the words of a model, which the rules couldn't read."""
    text = f"lay the {thing} on the {PLATE} where it is free, {how}"
    return Subtask(previous=previous, reason="so it looks", text=text, objects=(thing, PLATE))


FIRST = want(Verdict.INITIAL, EGG)
AGAIN = want(Verdict.FAILURE, EGG)
NEXT = want(Verdict.SUCCESS, PEPPER)
DONE = Subtask(previous=Verdict.SUCCESS, reason="all is there", done=True)
CANNOT = Subtask(previous=Verdict.FAILURE, reason="the egg always slips", cannot=True)


def run(
    folder: Path,
    subtasks: Sequence[Subtask],
    *,
    sequences: Sequence[ActionSequence] = (ON_PLATE,),
    reports: Sequence[ExecutionReport] = (),
    achieved: bool | None = None,
    instruction: str = INSTRUCTION,
) -> Path:
    """A run folder, as `maniagent run` leaves it, of agents that say `subtasks`."""

    def things(first: str) -> tuple[ObjectInfo, ...]:
        return made_object(0, first, (0.3, 0.1), grasps=2), made_object(1, PLATE, (0.3, -0.1), grasps=0)

    located = [Located(things(subtask.objects[0]), ()) for subtask in subtasks if subtask.objects]
    agents = ScriptedAgents(subtasks, located, sequences).as_agents()
    robot = FakeRobot(reports=reports)
    robot.rig = Rig(BodyFilter(ArmModel()))
    with Recorder(folder) as recorder:
        log = EventLog([recorder])
        log.emit("run_started", instruction=instruction, task=TASK, seed=0, agents=agents.name)
        result = AgentLoop(robot, agents, log, Budget(turns=6)).run(instruction)
        log.emit("run_finished", result=result, achieved=achieved)
    return folder


def changed(**step: object) -> ActionSequence:
    """The sequence with its fourth step (carry it above the plate) changed."""
    steps = list(ON_PLATE.steps)
    steps[3] = steps[3].model_copy(update=step)
    return ON_PLATE.model_copy(update={"steps": tuple(steps)})


# What is taken --------------------------------------------------------------------------------------------------


def test_what_a_model_did_becomes_moves_in_its_own_words_and_order(tmp_path: Path) -> None:
    folder = run(tmp_path / "run", [FIRST, NEXT, DONE], achieved=True)
    moves = learnt_moves(folder, INSTRUCTION)
    assert moves == (
        Move(text=FIRST.text, objects=(EGG, PLATE), sequence=ON_PLATE),
        Move(text=NEXT.text, objects=(PEPPER, PLATE), sequence=ON_PLATE),
    )


def test_a_sub_task_that_failed_first_counts_once_with_the_sequence_that_worked(tmp_path: Path) -> None:
    higher = ON_PLATE.model_copy(update={"skill": "higher"})
    folder = run(
        tmp_path / "run", [FIRST, AGAIN, NEXT, DONE], sequences=[ON_PLATE, higher], reports=[SLIPPED, WENT, WENT]
    )
    assert [(move.text, move.sequence.skill) for move in learnt_moves(folder, INSTRUCTION)] == [
        (FIRST.text, "higher"),
        (NEXT.text, "higher"),
    ]


def test_objects_may_be_called_otherwise(tmp_path: Path) -> None:
    folder = run(tmp_path / "run", [FIRST, DONE])
    (move,) = learnt_moves(folder, INSTRUCTION, {EGG: "egg"})
    assert move.objects == ("egg", PLATE)
    with pytest.raises(UsageError, match="speaks of no spoon; its objects are 'brown egg', 'white plate'"):
        learnt_moves(folder, INSTRUCTION, {"spoon": "ladle"})


def test_a_point_and_a_round_angle_that_the_instruction_says_may_stay(tmp_path: Path) -> None:
    said = "put the egg at (0.31, 0.02)"
    sequence = changed(anchor=PointAnchor(x=0.31, y=0.02), orientation=Orientation(kind="align", yaw=1.5707963))
    folder = run(tmp_path / "run", [FIRST, DONE], sequences=[sequence], instruction=said)
    assert learnt_moves(folder, said)[0].sequence == sequence


# What is refused ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "sequence",
    [changed(anchor=PointAnchor(x=0.31, y=0.02)), changed(orientation=Orientation(kind="turn", yaw=0.37))],
    ids=["a point", "an angle"],
)
def test_numbers_of_the_table_of_that_run_are_refused_though_the_sub_task_says_them(
    tmp_path: Path, sequence: ActionSequence
) -> None:
    said = want(Verdict.INITIAL, EGG, "at (0.31, 0.02), turned by 21.2 degrees")
    folder = run(tmp_path / "run", [said, DONE], sequences=[sequence])
    with pytest.raises(UsageError, match="that the instruction doesn't say: it fits the table of that run"):
        learnt_moves(folder, INSTRUCTION)


def test_a_run_that_ended_otherwise_is_refused_with_its_reason(tmp_path: Path) -> None:
    folder = run(tmp_path / "run", [FIRST, CANNOT], reports=[SLIPPED])
    with pytest.raises(UsageError, match="ended as cannot: the egg always slips"):
        learnt_moves(folder, INSTRUCTION)


def test_a_run_that_only_its_agents_took_for_achieved_is_refused(tmp_path: Path) -> None:
    folder = run(tmp_path / "run", [FIRST, DONE], achieved=False)
    with pytest.raises(UsageError, match="its agents thought so"):
        learnt_moves(folder, INSTRUCTION)


def test_a_sequence_that_was_cut_short_is_not_known_to_work(tmp_path: Path) -> None:
    folder = run(tmp_path / "run", [FIRST, DONE], reports=[SLIPPED])
    with pytest.raises(UsageError, match=r"cut short .The object slipped"):
        learnt_moves(folder, INSTRUCTION)


def test_where_nothing_was_left_to_do_nothing_is_learnt(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="nothing left to do"):
        learnt_moves(run(tmp_path / "run", [DONE]), INSTRUCTION)


def test_a_run_of_another_instruction_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"is a run of 'put the ingredients.*the task says 'I am hungry'"):
        learnt_moves(run(tmp_path / "run", [FIRST, DONE]), "I am hungry")


def test_what_is_no_whole_run_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"no run folder: events\.jsonl is missing"):
        learnt_moves(tmp_path / "nowhere", INSTRUCTION)
    log = run(tmp_path / "run", [FIRST, DONE]) / "events.jsonl"
    lines = log.read_text().splitlines(keepends=True)
    log.write_text("".join(lines[:-1]) + lines[-1][:100])
    with pytest.raises(UsageError, match="was cut short"):
        learnt_moves(log.parent, INSTRUCTION)
    finished = json.loads(lines[-1])
    finished["result"]["subtasks"][0]["sequence"]["steps"] = []
    log.write_text("".join(lines[:-1]) + json.dumps(finished))
    with pytest.raises(UsageError, match=r"damaged: result\.subtasks\.0\.sequence"):
        learnt_moves(log.parent, INSTRUCTION)


# What can be collected ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("put the sextant on the plate", "nothing can be found by the name 'sextant'"),
        ("put the egg on the sextant", "nothing can be found by the name 'sextant'"),
        ("put the pepper in the middle onto the plate", "told by its place"),
        ("put the second block from the left on the plate", "told by its place"),
        ("put the egg that is on the dish onto the plate", "told by its place"),
        ("pick up the egg", "takes nothing anywhere"),
    ],
)
def test_moves_that_can_not_be_collected_are_refused(text: str, reason: str) -> None:
    with pytest.raises(UsageError, match=reason):
        check_moves(moves_of(text))


def test_what_stays_where_it_is_may_be_told_by_its_place() -> None:
    check_moves(moves_of("put the egg on the plate on the left"))


def test_settings_hold_the_moves_of_a_run(tmp_path: Path) -> None:
    folder = run(tmp_path / "run", [FIRST, NEXT, DONE])
    settings = checked_settings(TASK, None, None, run=folder, called={EGG: "egg"}, count=3, texts="move")
    assert [move.objects for move in settings.moves] == [("egg", PLATE), (PEPPER, PLATE)]
    assert (settings.instruction, settings.texts) == (INSTRUCTION, "move")


def test_the_moves_come_from_one_source(tmp_path: Path) -> None:
    folder = run(tmp_path / "run", [FIRST, DONE])
    for do, cache in (("put the egg on the plate", None), (None, tmp_path / "cache")):
        with pytest.raises(UsageError, match="leave out --do and --cache"):
            checked_settings(TASK, do, cache, run=folder, count=1)
    with pytest.raises(UsageError, match="needs --from"):
        checked_settings(TASK, "put the egg on the plate", None, called={EGG: "egg"}, count=1)


# What is said on the command line ---------------------------------------------------------------------------------


def test_paraphrases_are_read_one_a_line_none_twice(tmp_path: Path) -> None:
    file = tmp_path / "says.txt"
    file.write_text("\ufefflay the egg down\n\n  cook Menemen \nlay the egg down\n", encoding="utf-8")
    assert phrases_in(file) == ("lay the egg down", "cook Menemen")


@pytest.mark.parametrize(("content", "reason"), [(b" \n", "says nothing"), (b"\xff\xfe\x00", "no text in UTF-8")])
def test_a_file_without_paraphrases_is_refused(tmp_path: Path, content: bytes, reason: str) -> None:
    (tmp_path / "says.txt").write_bytes(content)
    with pytest.raises(UsageError, match=reason):
        phrases_in(tmp_path / "says.txt")
    with pytest.raises(UsageError, match="No such file"):
        phrases_in(tmp_path / "nowhere.txt")


def test_names_are_given_as_pairs() -> None:
    assert read_calls(["brown egg = egg", "a=b"]) == {"brown egg": "egg", "a": "b"}
    for wrong in ("egg", "=egg", "egg="):
        with pytest.raises(UsageError, match="NAME=OTHER"):
            read_calls([wrong])
    with pytest.raises(UsageError, match="each name once"):
        read_calls(["a=b", "a=c"])


def test_a_run_that_is_no_help_is_one_line_and_status_2(tmp_path: Path) -> None:
    folder = run(tmp_path / "run", [FIRST, CANNOT], reports=[SLIPPED])
    for said in (["--from", str(folder)], ["--call", "egg"], ["--say-file", str(tmp_path / "none")]):
        result = CliRunner().invoke(app, ["collect", TASK, "--out", str(tmp_path / "out"), "--stage-only", *said])
        assert (result.exit_code, result.stdout) == (2, "")
        assert len(result.stderr.splitlines()) <= 4
    assert not (tmp_path / "out").exists()


# The twin -------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_what_was_done_in_words_the_rules_can_not_read_is_done_again_without_a_model(tmp_path: Path) -> None:
    env = TabletopEnv(task_named("hungry").scene)
    env.reset(seed=2)
    robot = SimulatedRobot(env)
    text = "serve the yellow banana on the white plate, so that the person can eat it"
    serve = Subtask(previous=Verdict.INITIAL, reason="hungry", text=text, objects=("yellow banana", PLATE))
    said = ScriptedAgents([serve, DONE], [], [moves_of("put the banana on the plate")[0].sequence])
    agents = replace(rules_agents(robot.rig), reasoning=said, controller=said)
    with Recorder(tmp_path / "run") as recorder:
        log = EventLog([recorder])
        log.emit("run_started", instruction="I am hungry", task="hungry", seed=2, agents=agents.name)
        result = AgentLoop(robot, agents, log).run("I am hungry")
        log.emit("run_finished", result=result, achieved=None)
    moves = learnt_moves(tmp_path / "run", "I am hungry")
    check_moves(moves)
    env.reset(seed=3)  # another table: everything lies elsewhere
    attempt = Chain(SimulatedRobot(env), moves, Sampling(width=64, height=48)).perform(seed=0)
    assert attempt.label == "valid"
    assert attempt.recording is not None
    assert set(attempt.recording.steps.subtasks) == {text}
    env.close()
