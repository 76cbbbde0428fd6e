"""Objects for a command, found in real pictures of the twin."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest

from maniagent import tasks
from maniagent.agents.memory import Memory
from maniagent.agents.protocols import Located
from maniagent.agents.rules.objects import RulesObjectAgent
from maniagent.envs.tabletop import TabletopEnv, TrueObject
from maniagent.errors import DetectionFailure, FailureStage, GraspFailure
from maniagent.motion import ArmModel
from maniagent.perception.lexicon import Lexicon
from maniagent.perception.rig import Rig
from maniagent.perception.sight import Sight
from maniagent.robots.simulated import BodyFilter
from maniagent.types import ExecutionReport, ObjectInfo, Observation, Subtask, SubtaskRecord, Verdict


@dataclass(frozen=True)
class Table:
    observation: Observation
    truth: Mapping[str, TrueObject]


@cache
def table(task: str) -> Table:
    env = TabletopEnv(tasks.get(task).scene)
    env.reset(seed=0)
    looked = Table(env.observe(), env.truth())
    env.close()
    return looked


@pytest.fixture(scope="module")
def agent() -> RulesObjectAgent:
    return RulesObjectAgent(Sight(Rig(BodyFilter(ArmModel()))), Lexicon.load())


def subtask(text: str, *queries: str) -> Subtask:
    return Subtask(previous=Verdict.INITIAL, reason="", text=text, objects=queries)


PUT = subtask("put the pepper in the middle on the plate", "pepper in the middle", "plate")


def remembering(*attempts: tuple[tuple[ObjectInfo, ...], str], text: str = PUT.text) -> Memory:
    memory = Memory()
    for objects, stage in attempts:
        report = ExecutionReport(completed=False, reached=0, reason="It went wrong.", stage=stage)
        memory.add(SubtaskRecord(text, objects, report, Verdict.FAILURE))
    return memory


@pytest.fixture(scope="module")
def found(agent: RulesObjectAgent) -> Located:
    return agent.locate(PUT, table("middle-pepper").observation, Memory())


def test_each_query_gets_its_object_in_order_and_only_the_one_that_moves_gets_grasps(found: Located) -> None:
    assert [(thing.index, thing.name) for thing in found.objects] == [(0, "pepper in the middle"), (1, "plate")]
    assert found.objects[0].grasps
    assert not found.objects[1].grasps


def test_objects_are_where_they_truly_are(found: Located) -> None:
    truth = table("middle-pepper").truth
    for thing, name in zip(found.objects, ("middle_pepper", "plate"), strict=True):
        assert np.linalg.norm(thing.centre[:2] - truth[name].T_base_object[:2, 3]) < 0.012


def test_everything_else_is_in_the_surroundings_and_no_number_is_given_twice(found: Located) -> None:
    everything = [*found.objects, *found.surroundings]
    assert [thing.index for thing in everything] == list(range(4))
    assert sorted(thing.name for thing in found.surroundings) == ["green pepper", "red pepper"]


def test_detections_lie_in_the_main_view_around_their_masks(found: Located) -> None:
    frame = table("middle-pepper").observation.main_frame
    for detection, query in zip(found.detections, PUT.objects, strict=True):
        assert (detection.query, detection.frame) == (query, "main")
        assert detection.mask is not None
        rows, columns = np.nonzero(detection.mask)
        assert detection.box == (columns.min(), rows.min(), columns.max(), rows.max())
        assert detection.mask.shape == frame.depth.shape


@pytest.mark.parametrize(
    ("command", "said"),
    [
        (subtask("put the red pepper on the plate", "red pepper", "plate"), "2 objects fit 'red pepper' equally"),
        (subtask("put the banana on the plate", "banana", "plate"), "No banana is in view"),
        (subtask("put the plate on the plate", "plate", "plate"), "mean the same thing"),
    ],
)
def test_what_is_not_there_or_not_clear_is_refused(agent: RulesObjectAgent, command: Subtask, said: str) -> None:
    with pytest.raises(DetectionFailure, match=said):
        agent.locate(command, table("middle-pepper").observation, Memory())


def test_what_the_gripper_cannot_span_is_refused_with_both_widths(agent: RulesObjectAgent) -> None:
    command = subtask("pick up the blue block", "blue block")
    with pytest.raises(GraspFailure, match=r"it is \d\.\d cm wide, the gripper opens 4\.8 cm"):
        agent.locate(command, table("stack-yellow-on-blue").observation, Memory())


def test_a_grasp_that_failed_moves_to_the_end(agent: RulesObjectAgent, found: Located) -> None:
    observation = table("middle-pepper").observation
    memory = remembering((found.objects, FailureStage.GRASP), (found.objects, FailureStage.PLANNING))
    again = agent.locate(PUT, observation, memory).objects[0].grasps
    first = found.objects[0].grasps
    assert [g.score for g in again] == [g.score for g in (*first[1:], first[0])]


def test_a_retry_goes_for_the_thing_tried_before_even_where_the_words_fit_another_now(
    agent: RulesObjectAgent, found: Located
) -> None:
    red = next(thing for thing in found.surroundings if thing.name == "red pepper")
    again = agent.locate(PUT, table("middle-pepper").observation, remembering(((red, found.objects[1]), "control")))
    np.testing.assert_allclose(again.objects[0].centre, red.centre)


def test_a_neighbour_that_looks_the_same_is_not_taken_for_the_thing_tried_before(
    agent: RulesObjectAgent, found: Located
) -> None:
    # The other red pepper still lies where it lay; the one that was tried has gone from the picture.
    gone = replace(found.objects[0], centre=found.objects[0].centre + np.array([0.0, 0.02, 0.0]))
    tried = SubtaskRecord(
        PUT.text,
        (gone, found.objects[1]),
        ExecutionReport(completed=False, reached=1, stage="control"),
        surroundings=(*found.surroundings, found.objects[0]),
    )
    memory = Memory()
    memory.add(tried)
    with pytest.raises(DetectionFailure, match="tried before is out of view"):
        agent.locate(PUT, table("middle-pepper").observation, memory)


def test_what_is_dragged_is_taken_on_the_side_towards_which_it_goes(agent: RulesObjectAgent) -> None:
    observation = table("drag-plate").observation
    for point in ((0.2, 0.2), (0.2, -0.2)):
        text = f"drag the plate to ({point[0]}, {point[1]})"
        plate = agent.locate(subtask(text, "plate"), observation, Memory()).objects[0]
        assert plate.grasp is not None
        offset = plate.grasp.T_base_grasp[:2, 3] - plate.centre[:2]
        assert offset @ (np.asarray(point) - plate.centre[:2]) > 0
