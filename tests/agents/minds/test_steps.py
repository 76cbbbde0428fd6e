"""From a model's flat steps to sequences that bind."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maniagent.agents.binding import bind
from maniagent.agents.minds.answers import Written, WrittenStep
from maniagent.agents.minds.prompts import Prompts
from maniagent.agents.minds.steps import to_sequence
from maniagent.agents.rules.controller import RulesControllerAgent
from maniagent.geometry import rotation_z, yaw_of_top_down
from maniagent.models.question import Unfit
from maniagent.perception.viewpoint import Viewpoint
from maniagent.testing import made_object
from maniagent.types import KeyPoint, Subtask, Verdict

VIEWPOINT = Viewpoint(np.array([0.0, 1.0]), np.array([-1.0, 0.0]))
KNIFE = made_object(0, "knife", (0.20, 0.15), size=(0.18, 0.02, 0.01), yaw=0.9)
PLATE = made_object(1, "plate", (0.30, -0.10), size=(0.18, 0.18, 0.02))
TAKE: list[dict[str, Any]] = [
    {"do": "above", "to": "grasp", "object": 0, "up": 0.1, "gripper": "open"},
    {"do": "take", "to": "grasp", "object": 0, "gripper": "close"},
    {"do": "lift", "to": "here", "up": 0.1},
]


def keypoints(*steps: dict[str, Any], viewpoint: Viewpoint = VIEWPOINT) -> tuple[KeyPoint, ...]:
    written = Written.model_validate({"skill": "test", "steps": steps})
    return bind(to_sequence(written), (KNIFE, PLATE), viewpoint)


def examples() -> list[tuple[str, Written]]:
    """The examples in the controller's prompt, with their sub-tasks."""
    lines = Prompts.load().controller.instructions.splitlines()
    found = []
    for i, line in enumerate(lines):
        if line.startswith('{"skill"'):
            end = next(k for k in range(i, len(lines)) if lines[k].endswith("]}"))
            found.append((lines[i - 1], Written.model_validate_json("".join(lines[i : end + 1]))))
    return found


@pytest.mark.parametrize(("subtask", "written"), examples())
def test_the_prompts_examples_move_as_the_rules_do(subtask: str, written: Written) -> None:
    text, named = subtask.rstrip(")").split(" (0 ")
    names = named.split(", 1 ")
    objects = [made_object(i, name, (0.2 + 0.1 * i, 0.1), yaw=0.4) for i, name in enumerate(names)]
    wanted = RulesControllerAgent().write(
        Subtask(previous=Verdict.INITIAL, reason="", text=text, objects=tuple(names)), objects
    )
    ours, theirs = bind(to_sequence(written), objects, VIEWPOINT), bind(wanted, objects, VIEWPOINT)
    assert to_sequence(written).skill == wanted.skill
    assert [p.gripper for p in ours] == [p.gripper for p in theirs]
    for a, b in zip(ours, theirs, strict=True):
        np.testing.assert_allclose(a.T_base_tcp, b.T_base_tcp, atol=0.007)  # travelling 6 mm higher or not


def test_there_is_an_example_for_every_skill() -> None:
    assert [written.skill for _, written in examples()] == ["pick-and-place", "drag", "rotate"]


def test_what_is_held_is_known_without_being_said() -> None:
    *_, down, up = keypoints(
        *TAKE,
        {"do": "lower", "to": "surface", "object": 1, "gripper": "open"},
        {"do": "leave", "to": "here", "up": 0.1},
    )
    assert (down.held, up.held) == (0, None)
    grasp_height = KNIFE.grasps[0].T_base_grasp[2, 3] - KNIFE.bottom_z
    assert down.T_base_tcp[2, 3] == pytest.approx(PLATE.surface_z + grasp_height)


HEADINGS = {"right": (1, 0), "away": (0, 1), "left": (-1, 0), "towards": (0, -1)}


@given(st.floats(-math.pi, math.pi), st.sampled_from(sorted(HEADINGS)), st.sampled_from([None, *sorted(HEADINGS)]))
def test_a_long_thing_points_as_told_for_every_viewpoint(view_yaw: float, lie: str, end: str | None) -> None:
    turn = rotation_z(view_yaw)[:2, :2]
    viewpoint = Viewpoint(turn @ VIEWPOINT.right, turn @ VIEWPOINT.away)
    seen = {name: x * viewpoint.right + y * viewpoint.away for name, (x, y) in HEADINGS.items()}
    put_down = {"do": "put", "to": "left", "object": 1, "lie": lie, "end": end, "gripper": "open"}
    *_, taken, put = keypoints(*TAKE[:2], put_down, viewpoint=viewpoint)
    turned = yaw_of_top_down(put.T_base_tcp[:3, :3]) - yaw_of_top_down(taken.T_base_tcp[:3, :3])
    axis_before, axis = rotation_z(KNIFE.yaw)[:2, 0], rotation_z(KNIFE.yaw + turned)[:2, 0]
    assert abs(axis @ seen[lie]) == pytest.approx(1.0)
    if end is None:
        assert axis_before @ axis > -1e-9, "turned the longer way round"
    elif abs(axis_before @ seen[end]) > 1e-6:
        leading = axis if axis_before @ seen[end] > 0 else -axis
        assert leading @ seen[lie] == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("steps", "said"),
    [
        ([TAKE[1]], "no step before opens them"),
        ([{"do": "go", "to": "surface"}], "doesn't say of which"),
        ([{"do": "go", "to": "point", "x": 0.2}], "lacks its x or y"),
        ([*TAKE, {"do": "drop", "to": "surface", "object": 1, "up": 0.2, "gripper": "open"}], "drops the object"),
        ([{"do": "lay", "to": "surface", "object": 1, "lie": "away"}], "none is held"),
    ],
)
def test_steps_that_mean_nothing_are_sent_back_with_their_number(steps: list[dict[str, Any]], said: str) -> None:
    with pytest.raises(Unfit, match=rf"Step {len(steps)} .*{said}"):
        keypoints(*steps)


def test_the_schema_offers_no_step_that_can_not_be_meant() -> None:
    kinds = Written.model_json_schema()["$defs"]["WrittenStep"]["anyOf"]
    own, other, point, here = (kind["properties"] for kind in kinds)
    assert (own["to"]["const"], own["object"]["const"]) == ("grasp", 0)
    assert "grasp" not in other["to"]["enum"]
    assert other["gripper"]["enum"] == ["open", "keep"], "things are taken at the grasp"
    assert {"x", "y"} <= set(kinds[2]["required"])
    assert not {"x", "y", "object"} & set(here)
    assert list(own)[:3] == list(other)[:3] == ["do", "object", "to"], "what follows from something comes after it"
    assert set().union(own, other, point, here) == set(WrittenStep.model_fields)


def test_fingers_that_open_too_early_and_once_more_where_it_belongs_are_meant_to_keep() -> None:
    over = {"do": "over", "to": "surface", "object": 1, "up": 0.1}
    lower = {"do": "lower", "to": "surface", "object": 1, "up": 0.006, "gripper": "open"}
    leave = {"do": "leave", "to": "here", "up": 0.1, "gripper": "open"}
    hasty = keypoints(*TAKE[:2], TAKE[2] | {"gripper": "open"}, over | {"gripper": "open"}, lower, leave)
    meant = keypoints(*TAKE, over, lower, leave)
    assert [p.gripper for p in hasty] == [p.gripper for p in meant]
    assert [p.held for p in hasty] == [p.held for p in meant] == [None, None, 0, 0, 0, None]
    with pytest.raises(Unfit, match="drops the object"):
        keypoints(*TAKE, over | {"gripper": "open"}, {"do": "close", "to": "here", "gripper": "close"}, lower)
