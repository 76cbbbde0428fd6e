"""The task library and task files."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maniagent import tasks
from maniagent.envs.cameras import CameraSpec
from maniagent.envs.scene import Placement, place_objects, within_reach
from maniagent.envs.tabletop import TabletopEnv
from maniagent.errors import UnknownNameError, UsageError
from maniagent.tasks import Episode, Task, load_task
from maniagent.tasks.conditions import On

DRAG = """
instruction: "drag the plate to {goal}"
points:
  goal: {x: [0.22, 0.32], y: [-0.14, 0.14], away_from: plate, distance: 0.08}
objects:
  - {name: plate, kind: plate}
success:
  - {kind: at, object: plate, point: goal}
"""


def write(folder: Path, content: str) -> Path:
    file = folder / "kitchen.yaml"
    file.write_text(content, encoding="utf-8")
    return file


def episode(task: Task, seed: int) -> Episode:
    rng = np.random.default_rng(seed)
    return task.episode(place_objects(task.scene, rng), rng)


# The library --------------------------------------------------------------------------------------------------------


def test_the_library_holds_the_papers_eight_and_bridges_four() -> None:
    suites = [tasks.get(name).suite for name in tasks.names()]
    assert suites == ["paper8"] * 8 + ["bridge"] * 4


@pytest.mark.parametrize("name", tasks.names())
def test_every_task_says_what_it_is_and_when_it_is_achieved(name: str) -> None:
    task = tasks.get(name)
    assert task.name == name
    assert task.title
    assert task.success
    said = episode(task, seed=0).instruction
    assert said
    assert "{" not in said


@pytest.mark.parametrize("name", tasks.names())
def test_a_task_survives_being_written_and_read(name: str) -> None:
    task = tasks.get(name)
    assert Task.model_validate_json(task.model_dump_json()) == task


def test_an_unknown_task_suggests_the_nearest() -> None:
    with pytest.raises(UnknownNameError, match="Did you mean 'drag-plate'"):
        tasks.get("drag-plates")


# Drawn points -------------------------------------------------------------------------------------------------------


@given(st.integers(0, 2**32 - 1))
def test_a_drawn_point_keeps_its_distance_and_is_said_as_it_is(seed: int) -> None:
    task = tasks.get("drag-plate")
    rng = np.random.default_rng(seed)
    layout = place_objects(task.scene, rng)
    drawn = task.episode(layout, rng)
    goal = drawn.points["goal"]
    assert np.linalg.norm(goal - layout[0].xy) >= 0.08
    assert within_reach(goal)
    assert 0.215 <= goal[0] <= 0.325
    said = re.fullmatch(r"drag the plate to \((\d\.\d\d), (-?\d\.\d\d)\)", drawn.instruction)
    assert said is not None
    np.testing.assert_allclose([float(number) for number in said.groups()], goal, atol=1e-9)
    assert "-0.00" not in drawn.instruction


def test_points_are_drawn_afresh_and_repeatably() -> None:
    task = tasks.get("drag-plate")
    layout = place_objects(task.scene, np.random.default_rng(0))
    first, again, other = (task.episode(layout, np.random.default_rng(seed)) for seed in (1, 1, 2))
    assert first.instruction == again.instruction != other.instruction


def test_a_point_that_can_not_keep_its_distance_is_refused(tmp_path: Path) -> None:
    task = load_task(write(tmp_path, DRAG.replace("distance: 0.08", "distance: 0.4")))
    with pytest.raises(UsageError, match=r"No point within .* keeps 0\.4 m from plate"):
        episode(task, seed=0)


# On real physics ----------------------------------------------------------------------------------------------------

ONTO = [name for name in tasks.names() if any(isinstance(condition, On) for condition in tasks.get(name).success)]
SMALL = (CameraSpec("main", (0.74, 0.0, 0.54), (0.26, 0.0, 0.0), focal_length=60.0, width=64, height=48),)


def handed_over(episode: Episode, layout: tuple[Placement, ...]) -> tuple[Placement, ...]:
    """The layout with everything a centimetre above where it should be; two things on one target side by side."""
    by_name = {placement.name: placement for placement in layout}
    aside = 0.045 if len(episode.success) > 1 else 0.0
    for condition in episode.success:
        assert isinstance(condition, On)
        thing, target = by_name[condition.object], by_name[condition.target]
        z = thing.model.rest_z + target.model.surface_z + 0.01
        by_name[thing.name] = replace(thing, xy=target.xy + np.array([0.0, aside]), z=z, on=target.name)
        aside = -aside
    return tuple(by_name.values())


@pytest.mark.parametrize("name", ONTO)
def test_what_physics_lets_come_to_rest_on_its_target_counts(name: str) -> None:
    task = tasks.get(name)
    env = TabletopEnv(task.scene, cameras=SMALL)
    rng = np.random.default_rng(0)
    for _ in range(2):
        layout = place_objects(task.scene, rng)
        episode = task.episode(layout, rng)
        env.reset(seed=0, options={"layout": handed_over(episode, layout)})
        for _ in range(75):
            env.advance(env.home, env.opening_range[1])
        assert episode.achieved(env.truth())
    env.close()


# Files --------------------------------------------------------------------------------------------------------------


def test_a_scene_needs_objects_alone(tmp_path: Path) -> None:
    task = load_task(write(tmp_path, "objects: [{name: a, kind: egg}]"))
    assert (task.name, task.instruction, task.success) == ("scene", "", ())
    assert episode(task, seed=0).achieved({}) is None


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("objects: [{name: a, kind: eg}]", "objects.0.kind: no object kind 'eg'; the library has"),
        ("objects: [{name: a, kind: egg}, {name: a, kind: egg}]", "file: two objects are named 'a'"),
        ("objects: [{name: a, kind: egg}]\nreward: 1", "reward: Extra inputs are not permitted"),
        ("{}", "objects: Field required"),
        ("1: 2", "Keys should be strings"),
        (DRAG.replace("{goal}", "{gaol}"), "file: the instruction names points that are not given: gaol"),
        (DRAG.replace("point: goal", "point: gaol"), "file: no point is named gaol"),
        (DRAG.replace("away_from: plate", "away_from: dish"), "file: no object is named dish"),
        (DRAG.replace("object: plate", "object: cup"), "file: no object is named cup"),
        (DRAG.replace("point: goal", "point: [0.3, .nan]"), "success.0.at.point"),
        (DRAG.replace("kind: at", "kind: near"), "success.0: Input tag 'near' found using 'kind' does not match"),
        (DRAG + "  - {kind: on, object: plate}", "success.1.on.target: Field required"),
        (DRAG + "  - {kind: on, object: plate, target: plate, inset: 1}", "success.1.on.inset: Input should be less"),
    ],
    ids=lambda value: "" if "\n" in value or "{" in value else value[:40],
)
def test_a_mistake_in_a_file_is_told_with_file_and_place(tmp_path: Path, content: str, said: str) -> None:
    file = write(tmp_path, content)
    with pytest.raises(UsageError) as caught:
        load_task(file)
    assert str(caught.value).startswith(f"{file}: ")
    assert said in str(caught.value)
    assert str(caught.value).endswith("(docs/scenes.md explains the format).")
    assert "\n" not in str(caught.value)


def test_a_missing_file_a_folder_and_a_picture_are_no_scenes(tmp_path: Path) -> None:
    picture = tmp_path / "scene.png"
    picture.write_bytes(b"\x89PNG\r\n\x1a\n\x00")
    for path in (tmp_path / "no.yaml", tmp_path, picture):
        with pytest.raises(UsageError, match=re.escape(str(path))):
            load_task(path)
