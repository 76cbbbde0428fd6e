"""The loop with agents that say what they are told and a robot that writes down what is asked of it."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from maniagent.agents.events import EventLog
from maniagent.agents.loop import AgentLoop, Budget
from maniagent.agents.protocols import Located
from maniagent.errors import (
    CameraFailure,
    DetectionFailure,
    FormatFailure,
    GraspFailure,
    MotionRejected,
    ReasoningFailure,
    SceneFailure,
    StageFailure,
)
from maniagent.testing import FakeRobot, ScriptedAgents, made_object
from maniagent.types import (
    ActionSequence,
    ActionStep,
    Event,
    ExecutionReport,
    Gripper,
    KeyPoint,
    ObjectAnchor,
    Orientation,
    Part,
    RunResult,
    RunVerdict,
    Subtask,
    Verdict,
)

PEPPER, PLATE = made_object(0, "pepper", grasps=3), made_object(1, "plate", (0.3, 0.2), grasps=0)
CUP = made_object(2, "cup", (0.3, -0.2))
FOUND = Located((PEPPER, PLATE), (), (CUP,))
TRY = Subtask(previous=Verdict.INITIAL, reason="first", text="put it there", objects=("pepper", "plate"))
AGAIN = TRY.model_copy(update={"previous": Verdict.FAILURE, "reason": "it isn't there"})
DONE = Subtask(previous=Verdict.SUCCESS, reason="it is there", done=True)
CANNOT = Subtask(previous=Verdict.FAILURE, reason="it never will", cannot=True)
TAKE = ActionSequence(
    skill="take",
    steps=(
        ActionStep(
            description="Take it",
            anchor=ObjectAnchor(index=0, part=Part.GRASP),
            orientation=Orientation(kind="grasp", index=0),
            gripper=Gripper.CLOSE,
        ),
    ),
)
OTHER = TAKE.model_copy(update={"skill": "take otherwise"})
NONSENSE = ActionSequence(
    skill="nonsense",
    steps=(ActionStep(description="Go", anchor=ObjectAnchor(index=9), orientation=Orientation(kind="top-down")),),
)
SLIPPED = ExecutionReport(completed=False, reached=1, reason="It slipped.", stage="grasp")


class Listener:
    def __init__(self) -> None:
        self.events: list[Event] = []

    def on_event(self, event: Event) -> None:
        self.events.append(event)

    @property
    def kinds(self) -> list[str]:
        return [event.kind for event in self.events]

    def data(self, kind: str) -> list[Any]:
        return [event.data for event in self.events if event.kind == kind]


def carry_out(agents: ScriptedAgents, robot: FakeRobot, listener: Listener | None = None, **budget: Any) -> RunResult:
    log = EventLog([listener] if listener else [])
    return AgentLoop(robot, agents.as_agents(), log, Budget(**budget)).run("put it there")


def refuse_first(count: int, reason: str = "It is out of reach.") -> Any:
    left = [count]

    def refuse(keypoints: Sequence[KeyPoint]) -> str:
        left[0] -= 1
        return reason if left[0] >= 0 else ""

    return refuse


# A run that goes well -------------------------------------------------------------------------------------------


def test_a_turn_is_told_in_its_order_and_the_last_look_ends_the_run() -> None:
    listener, robot = Listener(), FakeRobot()
    result = carry_out(ScriptedAgents([TRY, DONE], [FOUND], [TAKE]), robot, listener)
    assert listener.kinds == [
        "begun", "homed",
        "observed", "described", "reasoned", "located", "checked", "planned", "move", "homed", "executed",
        "observed", "described", "reasoned", "homed",
    ]  # fmt: skip
    assert [event.data["turn"] for event in listener.events[1:]] == [0] + [1] * 9 + [2] * 4
    assert robot.calls == ["go_home", "observe", "check", "execute", "go_home", "observe", "go_home"]
    assert (result.verdict, result.reason) == (RunVerdict.ACHIEVED, "it is there")


def test_what_the_loop_was_given_is_told_first() -> None:
    listener, robot = Listener(), FakeRobot()
    carry_out(ScriptedAgents([DONE]), robot, listener, turns=7)
    assert listener.events[0].data == {"instruction": "put it there", "budget": Budget(turns=7), "rig": robot.rig}


def test_the_record_holds_the_attempt_and_next_turns_verdict_on_it() -> None:
    agents = ScriptedAgents([TRY, DONE], [FOUND], [TAKE])
    (record,) = carry_out(agents, FakeRobot()).subtasks
    assert (record.text, record.queries, record.objects) == ("put it there", ("pepper", "plate"), FOUND.objects)
    assert record.outcome.completed
    assert (record.verdict, record.evidence) == (Verdict.SUCCESS, "it is there")
    assert record.sequence == TAKE
    assert agents.remembered == [0, 1]


def test_the_controller_hears_the_verdict_on_every_attempt_once() -> None:
    again_after_nothing = AGAIN.model_copy(update={"text": "something else"})
    agents = ScriptedAgents(
        [TRY, again_after_nothing, AGAIN, DONE], [FOUND, CameraFailure("Blocked."), FOUND], [TAKE, OTHER]
    )
    result = carry_out(agents, FakeRobot())
    assert [(r.sequence, r.verdict) for r in agents.learned] == [(TAKE, Verdict.FAILURE), (OTHER, Verdict.SUCCESS)]
    assert [r.sequence for r in result.subtasks] == [TAKE, OTHER]


def test_nothing_that_moved_is_nothing_that_was_carried_out() -> None:
    agents = ScriptedAgents([TRY, CANNOT], [FOUND], [NONSENSE])
    (record,) = carry_out(agents, FakeRobot()).subtasks
    assert record.sequence is None
    assert agents.learned == [record]


def test_every_answer_of_the_robot_to_a_check_is_told() -> None:
    listener, robot = Listener(), FakeRobot(refuse=refuse_first(1))
    carry_out(ScriptedAgents([TRY, DONE], [FOUND], [TAKE]), robot, listener)
    assert [data["reason"] for data in listener.data("checked")] == ["It is out of reach.", ""]
    assert [data["keypoints"] for data in listener.data("checked")] == robot.checked


def test_everything_located_is_in_the_way() -> None:
    robot = FakeRobot()
    carry_out(ScriptedAgents([TRY, DONE], [FOUND], [TAKE]), robot)
    assert set(robot.boxes) == {0, 1, 2}
    np.testing.assert_array_equal(robot.boxes[2].centre, CUP.centre)


def test_time_is_kept_by_stage() -> None:
    seconds = carry_out(ScriptedAgents([TRY, DONE], [FOUND], [TAKE]), FakeRobot()).seconds
    assert set(seconds) == {"observe", "scene", "reasoning", "detection", "control", "planning", "execution"}
    assert all(value >= 0 for value in seconds.values())


def test_one_loop_carries_out_several_instructions_and_tells_each_move_once() -> None:
    listener, robot = Listener(), FakeRobot()
    agents = ScriptedAgents([TRY, DONE, TRY, DONE], [FOUND], [TAKE])
    loop = AgentLoop(robot, agents.as_agents(), EventLog([listener]))
    results = [loop.run("put it there") for _ in range(2)]
    assert [len(result.subtasks) for result in results] == [1, 1]
    assert [data["turn"] for data in listener.data("move")] == [1, 1]


# Attempts that fail ---------------------------------------------------------------------------------------------


def test_a_failed_motion_is_told_remembered_and_tried_again() -> None:
    listener, robot = Listener(), FakeRobot(reports=[SLIPPED, ExecutionReport(True, 1)])
    result = carry_out(ScriptedAgents([TRY, AGAIN, DONE], [FOUND], [TAKE]), robot, listener)
    assert [r.outcome.reason for r in result.subtasks] == ["It slipped.", ""]
    assert [r.verdict for r in result.subtasks] == [Verdict.FAILURE, Verdict.SUCCESS]
    assert listener.data("failed") == [{"turn": 1, "stage": "grasp", "reason": "It slipped."}]
    assert result.verdict is RunVerdict.ACHIEVED


@pytest.mark.parametrize("failure", [DetectionFailure("Not seen."), GraspFailure("Not seen.")])
def test_what_is_not_found_is_remembered_without_objects_and_nothing_moves(failure: StageFailure) -> None:
    robot = FakeRobot()
    result = carry_out(ScriptedAgents([TRY, CANNOT], [failure]), robot)
    (record,) = result.subtasks
    assert (record.objects, record.outcome.reason, record.outcome.stage) == ((), "Not seen.", failure.stage)
    assert robot.executed == []
    assert (result.verdict, result.reason) == (RunVerdict.CANNOT, "it never will")


def test_a_refused_grasp_gives_way_to_the_next_one() -> None:
    listener, robot = Listener(), FakeRobot(refuse=refuse_first(2))
    result = carry_out(ScriptedAgents([TRY, DONE], [FOUND], [TAKE]), robot, listener)
    poses = [grasp.T_base_grasp for grasp in PEPPER.grasps]
    for keypoints, pose in zip(robot.checked, poses, strict=True):
        np.testing.assert_array_equal(keypoints[0].T_base_tcp, pose)
    assert robot.executed == [robot.checked[2]]
    assert result.subtasks[0].objects[0].grasp is PEPPER.grasps[2], "the record holds the grasp that was used"
    assert sorted(g.score for g in result.subtasks[0].objects[0].grasps) == sorted(g.score for g in PEPPER.grasps)
    assert "failed" not in listener.kinds


def test_no_more_grasps_are_tried_than_the_budget_says() -> None:
    robot = FakeRobot(refuse=refuse_first(99))
    carry_out(ScriptedAgents([TRY, CANNOT], [FOUND], [TAKE]), robot, grasps=2, answers=1)
    assert len(robot.checked) == 2


@pytest.mark.parametrize(
    ("robot", "bad", "reason"),
    [
        (FakeRobot(refuse=refuse_first(3)), OTHER, "It is out of reach."),
        (FakeRobot(), NONSENSE, "Step 1 (Go): there is no object 9; the objects are [0, 1]."),
    ],
)
def test_a_refused_sequence_goes_back_to_the_controller_with_the_reason(
    robot: FakeRobot, bad: ActionSequence, reason: str
) -> None:
    listener = Listener()
    agents = ScriptedAgents([TRY, DONE], [FOUND], [bad, TAKE])
    carry_out(agents, robot, listener)
    assert agents.feedback == ["", reason]
    assert [data["reason"] for data in listener.data("failed")] == [reason]
    assert [data["sequence"] for data in listener.data("planned")] == [TAKE]
    assert len(robot.executed) == 1


def test_nothing_moves_when_no_answer_of_the_controller_is_accepted() -> None:
    robot, listener = FakeRobot(refuse=refuse_first(99)), Listener()
    agents = ScriptedAgents([TRY, CANNOT], [FOUND], [TAKE, OTHER, TAKE])
    (record,) = carry_out(agents, robot, listener, answers=3).subtasks
    assert len(agents.feedback) == 3
    assert len(listener.data("failed")) == 3
    assert robot.executed == []
    assert (record.outcome.completed, record.outcome.stage) == (False, "planning")
    assert record.outcome.reason == "It is out of reach."


def test_a_controller_that_repeats_itself_is_not_tried_again() -> None:
    robot, listener = FakeRobot(refuse=refuse_first(99)), Listener()
    carry_out(ScriptedAgents([TRY, CANNOT], [FOUND], [TAKE]), robot, listener, answers=5)
    assert len(robot.checked) == len(PEPPER.grasps)
    assert len(listener.data("failed")) == 1


def test_an_arm_that_does_not_get_home_failed_the_attempt_and_the_run_says_so() -> None:
    stuck = ExecutionReport(completed=False, reached=0, reason="The arm is blocked.", stage="control")
    result = carry_out(ScriptedAgents([TRY, DONE], [FOUND], [TAKE]), FakeRobot(way_home=[stuck]))
    assert result.subtasks[0].outcome is stuck
    assert result.reason.endswith("did not get home: The arm is blocked.")


# Budget ---------------------------------------------------------------------------------------------------------

FAILURES = [
    CameraFailure("Trouble."), SceneFailure("Trouble."), ReasoningFailure("Trouble."), FormatFailure("Trouble."),
    MotionRejected("Trouble."), DetectionFailure("Trouble."), GraspFailure("Trouble."), StageFailure("Trouble."),
]  # fmt: skip


@pytest.mark.parametrize("failure", FAILURES, ids=lambda failure: type(failure).__name__)
@pytest.mark.parametrize("stage", ["observe", "scene", "reasoning", "objects", "controller"])
def test_no_stage_failure_ever_escapes_and_the_arm_ends_at_home(failure: StageFailure, stage: str) -> None:
    agents = ScriptedAgents(
        [failure] if stage == "reasoning" else [TRY, AGAIN],
        [failure] if stage == "objects" else [FOUND],
        [failure] if stage == "controller" else [TAKE],
        **({"scenes": [failure]} if stage == "scene" else {}),
    )
    robot = FakeRobot(observations=[failure] if stage == "observe" else ())
    listener = Listener()
    result = carry_out(agents, robot, listener, turns=4)
    assert result.verdict in (RunVerdict.CANNOT, RunVerdict.OUT_OF_BUDGET)
    assert robot.executed == []
    assert robot.calls[-1] == "go_home"
    assert {(data["stage"], data["reason"]) for data in listener.data("failed")} == {(failure.stage, "Trouble.")}


def test_so_many_failed_looks_in_a_row_end_the_run_with_their_reason() -> None:
    agents = ScriptedAgents([TRY], scenes=[SceneFailure("It is dark.")])
    result = carry_out(agents, FakeRobot(), failed_looks=3)
    assert (result.verdict, result.reason) == (RunVerdict.CANNOT, "It is dark.")
    assert len(agents.described) == 3


def test_a_look_that_works_lets_the_count_begin_anew() -> None:
    dark = ReasoningFailure("What?")
    agents = ScriptedAgents([dark, dark, TRY, dark, dark, DONE], [FOUND], [TAKE])
    assert carry_out(agents, FakeRobot(), failed_looks=3).verdict is RunVerdict.ACHIEVED


def test_a_camera_that_fails_while_objects_are_sought_is_a_failed_look_and_no_attempt() -> None:
    result = carry_out(ScriptedAgents([TRY, DONE], [CameraFailure("Blocked.")]), FakeRobot())
    assert result.subtasks == ()


def test_turns_run_out() -> None:
    agents = ScriptedAgents([TRY, AGAIN], [FOUND], [TAKE])
    result = carry_out(agents, robot := FakeRobot(), turns=3)
    assert (result.verdict, result.reason) == (RunVerdict.OUT_OF_BUDGET, "Not done after 3 turns.")
    assert len(robot.executed) == 3


def test_time_runs_out_between_turns(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [0.0]
    monkeypatch.setattr("maniagent.agents.loop.time.monotonic", lambda: now[0])

    class Slow(FakeRobot):
        def go_home(self) -> ExecutionReport:
            now[0] += 6.0
            return super().go_home()

    agents = ScriptedAgents([TRY, AGAIN], [FOUND], [TAKE])
    result = carry_out(agents, robot := Slow(), seconds=17.0)
    assert (result.verdict, len(robot.executed)) == (RunVerdict.OUT_OF_BUDGET, 2)
    assert result.seconds["execution"] == pytest.approx(24.0)


# Stopped from outside -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("fault", [KeyboardInterrupt(), RuntimeError("driver")])
def test_whatever_is_no_stage_failure_stops_the_arm_and_is_raised_on(fault: BaseException) -> None:
    for agents, robot in (
        (ScriptedAgents([TRY], [FOUND], [TAKE]), FakeRobot(reports=[fault])),
        (ScriptedAgents([fault]), FakeRobot()),
        (ScriptedAgents([DONE]), FakeRobot(way_home=[fault])),
    ):
        with pytest.raises(type(fault)):
            carry_out(agents, robot)
        assert robot.calls[-1] == "stop"
