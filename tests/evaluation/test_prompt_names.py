"""What a model calls a thing, and which true thing that is: the ruler by which prompts are measured."""

import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from maniagent.envs.objects import make_object, object_names
from maniagent.evaluation.prompts.answers import Answer
from maniagent.evaluation.prompts.matching import Thing, match
from maniagent.evaluation.prompts.names import Said, read_name
from maniagent.evaluation.prompts.scenes import SceneOf, draw
from maniagent.evaluation.prompts.scores import Result
from maniagent.perception.phrases import Pick
from maniagent.tasks import get

RECORDED = sorted((Path(__file__).parents[1] / "agents/minds/recorded").glob("*.json"))


def thing(name: str, title: str, right: float = 0.0, away: float = 0.0, matters: bool = True) -> Thing:
    return Thing(name, title, right, away, matters)


PEPPERS = (
    thing("green", "green chili pepper", -0.1, matters=False),
    thing("meant", "red chili pepper", 0.0),
    thing("other", "red chili pepper", 0.1, matters=False),
)
TABLE = (*PEPPERS, thing("plate", "plate", 0.2), thing("small", "yellow block", -0.2, 0.1, matters=False))


# Reading ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "noun", "colours", "sides"),
    [
        ("left red chili", "pepper", {"red"}, {Pick.LEFT}),
        ("Aubergine", "eggplant", (), ()),
        ("small wooden cube", "block", (), ()),
        ("banana-yellow toy", "toy", {"yellow"}, ()),
        ("strawberry on the dish", "strawberry", (), ()),
        ("white plate with a blue rim", "plate", {"white"}, ()),
        ("corn on the cob", "corn", (), ()),
        ("ear of corn", "corn", (), ()),
        ("pepper in the middle", "pepper", (), {Pick.MIDDLE}),
        ("block left of the plate", "block", (), ()),
        ("near cup", "cup", (), {Pick.NEAR}),
        ("violet pens (two)", "marker", {"purple"}, ()),
        ("robot gripper", None, (), ()),
        ("red thing", None, {"red"}, ()),
    ],
)
def test_a_name_says_kind_colours_and_side(name: str, noun: str | None, colours: set[str], sides: set[Pick]) -> None:
    assert read_name(name) == Said(noun, frozenset(colours), frozenset(sides))


@pytest.mark.parametrize("kind", object_names())
def test_every_object_of_the_library_is_known_by_its_own_title(kind: str) -> None:
    assert read_name(make_object(kind).title).noun is not None


@given(st.text(max_size=60))
def test_any_text_can_be_read(text: str) -> None:
    read_name(text)


# Matching ---------------------------------------------------------------------------------------------------------


def meant(*names: str) -> dict[str, str]:
    return {name: found.name for name, found in match(names, TABLE).meant}


def test_alikes_are_told_apart_by_their_side_among_all_or_among_those_of_their_colour() -> None:
    assert meant("middle pepper") == {"middle pepper": "meant"}
    assert meant("middle red pepper") == {"middle red pepper": "meant"}
    assert meant("left red pepper") == {"left red pepper": "meant"}
    assert meant("left pepper") == {"left pepper": "green"}
    assert meant("right red pepper", "red pepper") == {"right red pepper": "other", "red pepper": "meant"}


def test_a_name_that_fits_several_is_not_counted_in_its_favour() -> None:
    assert meant("red pepper") == {"red pepper": "other"}
    assert [missed.name for missed in match(["red pepper"], TABLE).missed] == ["meant", "plate"]


def test_the_side_of_a_thing_without_alikes_is_not_needed() -> None:
    assert meant("left plate") == {"left plate": "plate"}


def test_one_thing_has_one_name_and_the_others_say_why_they_mean_nothing() -> None:
    found = match(["white plate", "saucer", "second plate", "robot arm", "blue block"], TABLE)
    assert [name for name, _ in found.meant] == ["white plate"]
    assert dict(found.unmatched) == {
        "saucer": "not there",
        "second plate": "not there",
        "robot arm": "unknown words",
        "blue block": "not there",
    }


def test_no_names_and_no_things_are_fine() -> None:
    assert match([], TABLE).meant == ()
    assert match(["plate"], []).unmatched == (("plate", "not there"),)


NAMES = st.lists(
    st.sampled_from(
        ["pepper", "red pepper", "left pepper", "middle red pepper", "right red pepper", "green chili", "plate",
         "plate on the left", "yellow cube", "block", "cup", "sofa"]
    ),
    unique=True,
)  # fmt: skip


@given(NAMES, st.sampled_from(["plate", "pepper", "right pepper", "red chili", "brick", "spoon"]))
def test_naming_more_never_lowers_what_is_found(names: list[str], more: str) -> None:
    before, after = match(names, TABLE), match([*names, more], TABLE)
    assert len(after.meant) >= len(before.meant)
    assert len(after.missed) <= len(before.missed)


@given(NAMES)
def test_every_name_means_one_thing_or_nothing(names: list[str]) -> None:
    found = match(names, TABLE)
    assert sorted([*dict(found.meant), *dict(found.unmatched)]) == sorted(names)
    assert len({one.name for _, one in found.meant}) == len(found.meant)


# On real names ----------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_what_answerers_who_saw_only_pictures_called_things_is_understood() -> None:
    for path in RECORDED:
        run = json.loads(path.read_text(encoding="utf-8"))
        scene = draw(SceneOf(get(run["task"]), run["seed"]))
        names = tuple(one["name"] for one in run["answers"]["scene"][0]["objects"])
        answer = Answer(key="", scene=scene.name, variant="packaged", model="relay", names=names, seconds=0.0)
        result = Result.of(answer, scene.things)
        assert scene.instruction == run["instruction"]
        assert (result.recall, result.real, result.coverage) == (1.0, 1.0, 1.0), scene.name
