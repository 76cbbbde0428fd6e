"""Whatever goes in, a run ends in a clear verdict or one clear error, with the arm at rest in its safe pose.

Everything here goes through `maniagent.app.run` or the command line, in the real twin, with a fault let in where a
fault would come from: the words, the scene file, the cameras, the things on the table, somebody's hand.
"""

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from maniagent.app import RunOutcome, run
from maniagent.console.journal import read_lines
from maniagent.envs.tabletop import TabletopEnv
from maniagent.geometry import FloatArray
from maniagent.types import CameraFrame, Event, Observation, RobotState, RunVerdict

Fault = Callable[[TabletopEnv, Observation, int], Observation]
"""Twin, what its cameras show, the how-manieth look this is (from 1): what the robot gets to see."""


def no_fault(env: TabletopEnv, seen: Observation, look: int) -> Observation:
    return seen


class Twin(TabletopEnv):
    """The twin with a fault between cameras and robot, that remembers how the arm was left."""

    fault: Fault = staticmethod(no_fault)
    grip = 1.0
    """Friction of everything but the table, as a share of what it should be."""
    looks = 0
    arm: tuple[FloatArray, FloatArray, FloatArray]

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self.model.geom_friction[:, 0] *= self.grip
        Twin.latest = self

    latest: "Twin"

    def reset(self, **options: Any) -> Any:
        answer = super().reset(**options)
        self.looks = 0
        return answer

    def observe(self) -> Observation:
        self.looks += 1
        return type(self).fault(self, super().observe(), self.looks)

    def close(self) -> None:
        self.arm = (self.robot_state().joint_positions, self.joint_velocities, self.home)
        super().close()


@pytest.fixture
def twin(monkeypatch: pytest.MonkeyPatch) -> Callable[..., RunOutcome]:
    """Run with a fault, and see to it that the arm is at home and at rest afterwards."""

    def carry_out(
        instruction: str | None = None, *, task: str = "pepper-on-plate", fault: Fault = no_fault, grip: float = 1.0,
        kind: type[Twin] = Twin, **options: Any,
    ) -> RunOutcome:  # fmt: skip
        faulty = type("FaultyTwin", (kind,), {"fault": staticmethod(fault), "grip": grip})
        monkeypatch.setattr("maniagent.app.TabletopEnv", faulty)
        which = {} if "scene" in options else {"task": task}
        outcome = run(instruction, **which, **options)
        positions, velocities, home = Twin.latest.arm
        assert np.abs(positions - home).max() < 0.05, "the arm is at home"
        assert np.abs(velocities).max() < 0.1, "the arm is at rest"
        assert outcome.result.reason
        return outcome

    return carry_out


# Words ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("instruction", "task", "said"),
    [
        ("put the banana on the plate", "pepper-on-plate", "No banana is in view. Seen: "),
        ("put the pepper into the basket", "pepper-on-plate", "No basket is in view"),
        ("put the red pepper on the plate", "middle-pepper", "2 objects fit 'red pepper' equally well. Say which"),
        ("put the pepper on the red pepper", "pepper-on-plate", "mean the same thing"),
        ("put the pepper at (0.45, 0.35)", "pepper-on-plate", "outside the workspace|out of reach|reach"),
        ("put the pepper at (1.5, 0)", "pepper-on-plate", "x = 1.* m is outside the workspace"),
        ("drag the plate to (-0.3, 0)", "drag-plate", "outside the workspace|No grasp"),
        ("I am hungry", "hungry", "needs a language model"),
    ],
)
def test_what_cannot_be_done_is_said_plainly(
    twin: Callable[..., RunOutcome], instruction: str, task: str, said: str
) -> None:
    outcome = twin(instruction, task=task)
    assert outcome.result.verdict is RunVerdict.CANNOT
    assert outcome.achieved is False
    assert re.search(said, outcome.result.reason), outcome.result.reason


STRANGE = {
    "very long": "put the pepper " * 700,
    "one long word": "x" * 10_000,
    "control characters": "put\x00 the \x1b[2Jpepper\x07 \r\n\x08",
    "HTML": "<script>alert('pepper')</script> & <img src=x onerror=alert(1)>",
    "braces": "put the {pepper} on %s ${HOME} {0}",
    "lone surrogate": "put the \ud83e pepper",
    "other alphabets": "ضع الفلفل على الطبق 把辣椒放在盘子上 🌶️",
    "numbers": "put the pepper at (nan, 1e999)",
}


@pytest.mark.parametrize("text", STRANGE.values(), ids=STRANGE)
def test_strange_text_is_refused_with_a_reason_of_readable_length(twin: Callable[..., RunOutcome], text: str) -> None:
    outcome = twin(text)
    assert outcome.result.verdict is RunVerdict.CANNOT
    assert len(outcome.result.reason) < 500
    assert outcome.result.subtasks == ()


def test_strange_text_leaves_a_whole_folder_without_markup_of_its_own(
    twin: Callable[..., RunOutcome], tmp_path: Path
) -> None:
    text = STRANGE["HTML"] + STRANGE["control characters"] + STRANGE["lone surrogate"]
    twin(text, out=tmp_path / "run")
    page = (tmp_path / "run" / "report.html").read_text(encoding="utf-8")
    assert "<script>alert" not in page
    assert "<img src=x" not in page
    assert json.loads((tmp_path / "run" / "summary.json").read_text())["verdict"] == "cannot"


# Cameras ----------------------------------------------------------------------------------------------------------


def changed(*names: str, depth: float | None = None, rgb: int | None = None) -> Fault:
    """These cameras give that depth and that grey everywhere."""

    def frame(old: CameraFrame) -> CameraFrame:
        depths = old.depth if depth is None else np.full_like(old.depth, depth)
        colours = old.rgb if rgb is None else np.full_like(old.rgb, rgb)
        return replace(old, depth=depths, rgb=colours)

    def fault(env: TabletopEnv, seen: Observation, look: int) -> Observation:
        return replace(seen, frames={n: frame(f) if n in names else f for n, f in seen.frames.items()})

    return fault


@pytest.mark.parametrize(
    "fault",
    [
        changed("main", "side", depth=np.nan),
        changed("main", depth=np.nan),
        changed("main", depth=np.nan, rgb=0),
        changed("main", depth=0.0, rgb=0),
        changed("main", depth=np.inf),
        changed("main", "side", depth=-1.0),
        changed("main", depth=0.02, rgb=30),
    ],
    ids=["all NaN", "main NaN", "main black", "main zero", "main infinite", "negative", "a hand before the lens"],
)
def test_a_main_camera_that_sees_nothing_ends_the_run_and_is_named(
    twin: Callable[..., RunOutcome], fault: Fault
) -> None:
    outcome = twin(fault=fault)
    assert outcome.result.verdict is RunVerdict.CANNOT
    assert "main camera" in outcome.result.reason


def test_a_camera_that_comes_back_lets_the_run_go_on(twin: Callable[..., RunOutcome]) -> None:
    def fault(env: TabletopEnv, seen: Observation, look: int) -> Observation:
        return changed("main", depth=np.nan)(env, seen, look) if look < 3 else seen

    assert "No banana" in twin("put the banana on the plate", fault=fault).result.reason


@pytest.mark.slow
@pytest.mark.parametrize("fault", [changed("side", depth=np.nan), changed("side", depth=np.nan, rgb=0)])
def test_the_side_camera_can_be_done_without(twin: Callable[..., RunOutcome], fault: Fault) -> None:
    outcome = twin(fault=fault)
    assert (outcome.result.verdict, outcome.achieved) == (RunVerdict.ACHIEVED, True)


def test_a_main_camera_without_colour_finds_no_pepper_and_says_so(twin: Callable[..., RunOutcome]) -> None:
    outcome = twin(fault=changed("main", "side", rgb=0))
    assert outcome.result.verdict is RunVerdict.CANNOT
    assert outcome.result.reason


# The world --------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_thing_that_slips_through_the_fingers_ends_in_a_clear_no(twin: Callable[..., RunOutcome]) -> None:
    outcome = twin("put the carrot on the plate", task="carrot-on-plate", grip=0.005)
    assert outcome.result.verdict is RunVerdict.CANNOT
    assert outcome.achieved is False
    assert 1 < len(outcome.result.subtasks) <= 4
    assert any(record.outcome.stage == "grasp" for record in outcome.result.subtasks)


def hand(name: str, to: tuple[float, float], look: int) -> Fault:
    """Somebody puts an object elsewhere just before that look."""

    def fault(env: TabletopEnv, seen: Observation, now: int) -> Observation:
        if now != look:
            return seen
        body = env.model.body(f"object/{name}")
        address = env.model.jnt_qposadr[body.jntadr[0]]
        env.data.qpos[address : address + 3] = [*to, 0.02]
        env.data.qpos[address + 3 : address + 7] = [1.0, 0.0, 0.0, 0.0]
        mujoco.mj_forward(env.model, env.data)
        for _ in range(25):
            env.advance(env.home, env.opening_range[1])
        return TabletopEnv.observe(env)

    return fault


@pytest.mark.slow
def test_a_thing_that_is_taken_away_again_is_fetched_again(twin: Callable[..., RunOutcome]) -> None:
    outcome = twin(fault=hand("pepper", (0.30, 0.14), look=2))
    assert [record.verdict for record in outcome.result.subtasks] == ["failure", "success"]
    assert outcome.achieved


class WeakGripper(Twin):
    """Fingers without force."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        servo = self.model.actuator("gripper").id
        self.model.actuator_gainprm[servo] = self.model.actuator_biasprm[servo] = 0.0


class LostServo(Twin):
    """The elbow's servo stops answering after the first look."""

    def robot_state(self) -> RobotState:
        state = super().robot_state()
        if not self.looks:
            return state
        return replace(state, joint_positions=[*state.joint_positions[:2], np.nan, *state.joint_positions[3:]])

    def close(self) -> None:
        self.looks = 0
        super().close()


class StuckShoulder(Twin):
    """A shoulder that doesn't turn."""

    def advance(self, joint_positions: FloatArray, opening: float) -> None:
        super().advance(np.array([joint_positions[0], self.home[1], *joint_positions[2:]]), opening)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "said"),
    [
        (WeakGripper, "closed on nothing"),
        (LostServo, "A servo reads no valid position"),
        (StuckShoulder, "off its path, mostly at the shoulder"),
    ],
)
def test_a_broken_arm_is_noticed_and_named(twin: Callable[..., RunOutcome], kind: type[Twin], said: str) -> None:
    outcome = twin("put the carrot on the plate", task="carrot-on-plate", seed=3, kind=kind)
    assert outcome.result.verdict is RunVerdict.CANNOT
    assert said in outcome.result.reason


class Interrupting:
    """Somebody presses Ctrl-C during a move."""

    def __init__(self, frames: int) -> None:
        self.frames_left = frames

    def on_event(self, event: Event) -> None:
        self.frames_left -= event.kind == "frame"
        if self.frames_left == 0:
            raise KeyboardInterrupt


@pytest.mark.slow
def test_ctrl_c_stops_the_arm_where_it_is_and_leaves_a_folder_that_can_be_read(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("maniagent.app.TabletopEnv", Twin)
    with pytest.raises(KeyboardInterrupt):
        run(task="carrot-on-plate", seed=3, out=tmp_path / "run", observers=[Interrupting(20)])
    positions, velocities, home = Twin.latest.arm
    assert np.abs(velocities).max() < 0.1, "the arm is at rest"
    assert np.abs(positions - home).max() > 0.1, "it was on its way"
    assert [line["kind"] for line in read_lines(tmp_path / "run" / "events.jsonl")[-2:]] == ["move", "run_finished"]
    summary = json.loads((tmp_path / "run" / "summary.json").read_text(encoding="utf-8"))
    assert (summary["verdict"], summary["achieved"]) == ("aborted", None)
    assert (tmp_path / "run" / "report.html").exists()


@pytest.mark.slow
def test_what_cannot_be_reached_is_refused_before_anything_moves(
    twin: Callable[..., RunOutcome], tmp_path: Path
) -> None:
    scene = tmp_path / "edge.yaml"
    scene.write_text(
        "objects:\n"
        "  - {name: plate, kind: plate, place: {at: [0.28, 0.24]}}\n"
        "  - {name: carrot, kind: carrot, place: {at: [0.25, -0.1], yaw: 0}}\n"
    )
    outcome = twin("put the carrot right of the plate", scene=scene)
    assert outcome.result.verdict is RunVerdict.CANNOT
    assert outcome.achieved is None
    assert all(record.outcome.stage == "planning" for record in outcome.result.subtasks)
    assert "workspace" in outcome.result.reason or "reach" in outcome.result.reason
