"""Scenes: what a file may say, and that every layout drawn from it can be worked on."""

from __future__ import annotations

import time
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from maniagent import tasks
from maniagent.envs.scene import (
    REACH_RADIUS,
    Placement,
    Scene,
    describe_validation,
    overlap,
    place_objects,
    read_yaml,
    within_reach,
)
from maniagent.errors import UsageError

seeds = st.integers(0, 2**32 - 1)


def scene(*objects: dict[str, Any]) -> Scene:
    """Blocks unless told otherwise."""
    return Scene.model_validate({"objects": [{"kind": "block"} | thing for thing in objects]})


def layout(*objects: dict[str, Any], seed: int = 0) -> dict[str, Placement]:
    return {p.name: p for p in place_objects(scene(*objects), np.random.default_rng(seed))}


def refusal(*objects: dict[str, Any]) -> str:
    """What is said of a scene that is refused."""
    with pytest.raises(ValidationError) as caught:
        scene(*objects)
    return describe_validation(caught.value)


# Validation ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("objects", "said"),
    [
        ([{"name": "a", "kind": "blok"}], "objects.0.kind: no object kind 'blok'; the library has red_chili, "),
        ([{"name": "a"}, {"name": "a"}], "file: two objects are named 'a'"),
        ([{"name": "a", "place": {"beside": "b"}}, {"name": "b"}], "file: a: 'b' must be listed before it"),
        ([{"name": "a", "place": {"on": "a"}}], "file: a: 'a' must be listed before it"),
        ([{"name": "a", "place": {"region": {"x": [0.3, 0.2]}}}], "objects.0.place.region: a region's ranges are"),
        ([{"name": "a", "place": {"region": {"x": [0.3]}}}], "objects.0.place.region.x.1: Field required"),
        ([{"name": "a", "place": {"at": [0.3, 3.0]}}], "objects.0.place.at.1: Input should be less than or equal to 2"),
        ([{"name": "a", "place": {"at": [0.3, float("nan")]}}], "objects.0.place.at.1: Input should be"),
        ([{"name": "a", "place": {"at": [0.3, 0], "on": "b"}}], "objects.0.place: give at most one of at, beside"),
        ([{"name": "a", "colour": "red"}], "objects.0.colour: Extra inputs are not permitted"),
        ([{"name": "Red block"}], "objects.0.name: String should match pattern"),
        ([{"name": "a", "kind": "egg", "params": {"size": 1}}], "objects.0: Object 'egg' takes no parameters"),
        ([{"name": "a", "params": {"size": -1}}], "objects.0: A block's edges must be 0.01 to 0.2 m long, not -1"),
        ([{"name": "a", "params": {"colour": "mauve"}}], "objects.0: No block is 'mauve'. Known colours: red"),
        ([{"name": "a", "params": {"size": {"x": 1}}}], "objects.0.params.size"),
        ([], "objects: Tuple should have at least 1 item"),
        ([{"name": f"a{i}"} for i in range(25)], "objects: Tuple should have at most 24 items"),
    ],
    ids=lambda value: value[:50] if isinstance(value, str) else "",
)
def test_a_mistake_is_told_with_its_place(objects: list[dict[str, Any]], said: str) -> None:
    assert refusal(*objects).startswith(said)


def test_one_mistake_is_told_once_in_one_line() -> None:
    told = refusal({"name": "a", "kind": "blok"}, {"name": "b"})
    assert "\n" not in told
    assert told.count(": ") == 1


def test_parameters_reach_the_model() -> None:
    (placed,) = layout({"name": "a", "params": {"size": [0.05, 0.03, 0.02], "colour": "green"}}).values()
    np.testing.assert_allclose(placed.model.extent, [0.05, 0.03, 0.02])


# Files --------------------------------------------------------------------------------------------------------------


def test_on_is_a_word_with_and_without_quotes(tmp_path: Path) -> None:
    file = tmp_path / "scene.yaml"
    file.write_text('{on: off, "on_": On, yes_: true}', encoding="utf-8")
    assert read_yaml(file) == {"on": "off", "on_": "On", "yes_": True}


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"objects: [", "is not valid YAML: while parsing"),
        (b"\xff\xfe\x00binary\x00", "is not valid YAML"),
        (b"\x00", "is not valid YAML"),
        (b"when: 2026-13-45", "is not valid YAML: month must be in 1..12"),
        (b"who: !!python/object/apply:os.getcwd []", "is not valid YAML: could not determine a constructor"),
        (b"- a\n- b", "should hold a mapping (docs/scenes.md shows one), not list"),
        (b"", "should hold a mapping"),
    ],
    ids=["cut off", "binary", "nul", "no such day", "python object", "list", "empty"],
)
def test_a_file_that_holds_no_mapping_is_refused_by_name(tmp_path: Path, content: bytes, said: str) -> None:
    file = tmp_path / "kitchen.yaml"
    file.write_bytes(content)
    with pytest.raises(UsageError) as caught:
        read_yaml(file)
    assert str(file) in str(caught.value)
    assert said in str(caught.value)


def test_a_file_that_can_not_be_read_is_refused_by_name(tmp_path: Path) -> None:
    missing = tmp_path / "no.yaml"
    with pytest.raises(UsageError, match=r"Can't read .*no\.yaml: No such file or directory\."):
        read_yaml(missing)
    with pytest.raises(UsageError, match=r"Can't read .*: Is a directory\."):
        read_yaml(tmp_path)


# Layouts ------------------------------------------------------------------------------------------------------------


def gap(a: Placement, b: Placement) -> float:
    """m between two footprints, by brute force: from points on one's border to the other rectangle."""
    border = np.linspace(-1, 1, 21)
    sides = [(s, t) for s in border for t in (-1, 1)] + [(t, s) for s in border for t in (-1, 1)]
    distances = []
    for one, other in ((a, b), (b, a)):
        points = np.array(sides) * one.model.extent[:2] / 2
        turn = np.array([[np.cos(one.yaw), -np.sin(one.yaw)], [np.sin(one.yaw), np.cos(one.yaw)]])
        back = np.array([[np.cos(other.yaw), np.sin(other.yaw)], [-np.sin(other.yaw), np.cos(other.yaw)]])
        inside = (points @ turn.T + one.xy - other.xy) @ back.T
        outside = np.maximum(np.abs(inside) - other.model.extent[:2] / 2, 0.0)
        distances.append(np.linalg.norm(outside, axis=1).min())
    return float(min(distances))


@pytest.mark.parametrize("name", tasks.names())
@settings(max_examples=15)
@given(seed=seeds)
def test_in_every_layout_of_every_task_fingers_fit_between_things_within_reach(name: str, seed: int) -> None:
    placed = place_objects(tasks.get(name).scene, np.random.default_rng(seed))
    assert [p.name for p in placed] == [thing.name for thing in tasks.get(name).objects]
    assert all(within_reach(p.xy) for p in placed)
    for a, b in combinations(placed, 2):
        if a.name != b.on:
            assert gap(a, b) > 0.02


@pytest.mark.parametrize("name", tasks.names())
def test_the_same_seed_draws_the_same_layout(name: str) -> None:
    first, again, other = (place_objects(tasks.get(name).scene, np.random.default_rng(seed)) for seed in (5, 5, 6))
    for a, b in zip(first, again, strict=True):
        assert (tuple(a.xy), a.yaw, a.z) == (tuple(b.xy), b.yaw, b.z)
    assert any(a.yaw != b.yaw for a, b in zip(first, other, strict=True))


@given(st.tuples(*[st.floats(-0.1, 0.1)] * 2), st.floats(-4.0, 4.0), st.floats(-4.0, 4.0))
def test_overlap_agrees_with_brute_force(offset: tuple[float, float], yaw: float, other_yaw: float) -> None:
    plank, block = (placed.model for placed in layout({"name": "a", "kind": "knife"}, {"name": "b"}).values())
    a = Placement("a", plank, np.array([0.3, 0.0]), yaw, plank.rest_z)
    b = Placement("b", block, a.xy + offset, other_yaw, block.rest_z)
    assert overlap(a, b) == overlap(b, a)
    if overlap(a, b):
        assert gap(a, b) < 0.005  # the brute force looks every 7.5 mm
    else:
        assert gap(a, b) >= 0.0
    if gap(a, b) > 0.025 * np.sqrt(2):  # grown rectangles have square corners
        assert not overlap(a, b, 0.025)
    if gap(a, b) < 0.02:
        assert overlap(a, b, 0.025)


def test_places_are_what_was_asked_for() -> None:
    placed = layout(
        {"name": "dish", "kind": "dish", "place": {"at": [0.30, 0.05], "yaw": 30}},
        {"name": "egg", "kind": "egg", "place": {"on": "dish"}},
        {"name": "knife", "kind": "knife", "place": {"beside": "dish", "offset": [0.0, -0.12], "yaw": [-5, 5]}},
        {"name": "block", "place": {"region": {"x": [0.2, 0.3], "y": [0.14, 0.24]}}},
    )
    np.testing.assert_allclose(placed["dish"].xy, [0.30, 0.05])
    assert placed["dish"].yaw == pytest.approx(np.radians(30))
    np.testing.assert_allclose(placed["knife"].xy, [0.30, -0.07])
    assert abs(placed["knife"].yaw) <= np.radians(5)
    np.testing.assert_allclose(placed["egg"].xy, placed["dish"].xy)
    assert placed["egg"].z == pytest.approx(placed["dish"].model.surface_z + placed["egg"].model.rest_z)
    x, y = placed["block"].xy
    assert 0.2 <= x <= 0.3
    assert 0.14 <= y <= 0.24


def test_a_tower_stands_on_its_lowest_block() -> None:
    tower = layout({"name": "a"}, {"name": "b", "place": {"on": "a"}}, {"name": "c", "place": {"on": "b"}})
    assert [p.z for p in tower.values()] == pytest.approx([0.02, 0.06, 0.10])


def test_two_things_do_not_stand_on_the_same_spot() -> None:
    with pytest.raises(UsageError, match="c overlaps b"):
        layout({"name": "a", "kind": "plate"}, *({"name": n, "place": {"on": "a"}} for n in "bc"))


@pytest.mark.parametrize(("x", "y"), [(0.1, 0.0), (0.5, 0.0), (-0.3, 0.0), (0.05, -0.5)])
def test_a_fixed_place_out_of_reach_is_refused(x: float, y: float) -> None:
    with pytest.raises(UsageError, match=r"a at \(.*\) is out of reach \(0\.19 to 0\.42 m, in front of the robot\)"):
        layout({"name": "a", "place": {"at": [x, y]}})


def test_reach_ends_where_it_says() -> None:
    near, far = REACH_RADIUS
    assert within_reach(np.array([near, 0.0]))
    assert within_reach(np.array([0.0, -far]))
    assert not within_reach(np.array([near - 1e-6, 0.0]))
    assert not within_reach(np.array([far + 1e-6, 0.0]))


@pytest.mark.parametrize(
    "objects",
    [
        [{"name": f"a{i}", "kind": "plate"} for i in range(8)],
        [{"name": f"a{i}", "params": {"size": 0.05}} for i in range(24)],
        [{"name": f"a{i}", "place": {"at": [0.3, 0.0]}} for i in range(2)],
        [{"name": f"a{i}", "place": {"at": [0.3, 0.0], "yaw": 0}} for i in range(2)],
    ],
    ids=["eight plates", "24 blocks", "one spot, any yaw", "one spot"],
)
def test_what_does_not_fit_is_refused_soon(objects: list[dict[str, Any]]) -> None:
    began = time.process_time()
    with pytest.raises(UsageError, match=r"The scene does not fit on the table: a\d+ overlaps a\d+\. Use fewer"):
        layout(*objects)
    assert time.process_time() - began < 2.0  # about 0.5 s on an idle core
