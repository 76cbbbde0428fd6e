from __future__ import annotations

from dataclasses import replace
from importlib.metadata import EntryPoint, EntryPoints
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tables import Look, arrange

from maniagent.errors import SetupError, UnknownNameError, UsageError
from maniagent.perception.detectors import Match, detector_names, make_detector
from maniagent.perception.detectors.registry import GROUP


class Nothing:
    """Somebody else's detector."""

    def __init__(self, argument: str, model: Any) -> None:
        self.name, self.model = f"nothing:{argument}", model

    def detect(self, queries, view, observation):
        return tuple(() for _ in queries)


@pytest.fixture
def others(monkeypatch: pytest.MonkeyPatch) -> None:
    """Entry points as of installed packages: a good one, two broken ones, and one that wants a name of ours."""
    here = Nothing.__module__
    values = {
        "nothing": f"{here}:Nothing",
        "gone": "no_such_package:make",
        "typo": f"{here}:Nothin",
        "marks": f"{here}:Nothing",
    }
    found = EntryPoints(EntryPoint(name, value, GROUP) for name, value in values.items())
    monkeypatch.setattr("maniagent.perception.detectors.registry.entry_points", lambda **by: found.select(**by))


def test_every_name_is_listed(others):
    assert detector_names() == ("florence2", "gone", "grounding-dino", "lexicon", "marks", "nothing", "owlv2", "typo")


def test_another_packages_detector_is_found_by_its_entry_point(others):
    model: Any = object()
    detector = make_detector("nothing:a:b", model)
    assert isinstance(detector, Nothing)
    assert (detector.name, detector.model) == ("nothing:a:b", model)


def test_another_package_cannot_take_a_name_of_ours(others):
    with pytest.raises(UsageError, match="--vlm"):
        make_detector("marks")


@pytest.mark.parametrize("name", ["gone", "typo"])
def test_a_package_that_does_not_load_is_told(others, name):
    with pytest.raises(SetupError, match=f"'{name}'.*can't be loaded"):
        make_detector(name)


def test_an_unknown_name_is_answered_with_the_nearest():
    with pytest.raises(UnknownNameError, match="Did you mean 'marks'"):
        make_detector("mark")


@pytest.mark.parametrize("name", ["lexicon:x", "marks:x"])
def test_an_argument_that_means_nothing_is_refused(name):
    with pytest.raises(UsageError, match="takes nothing after its name"):
        make_detector(name)


# Matches ----------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def seen() -> Look:
    return arrange({"egg": ("egg", 0.2, -0.15, 0.0)})


def test_a_match_is_told_in_the_main_view_or_where_the_thing_is_seen(seen):
    egg = seen.segment_of("egg")
    in_main = Match.of("egg", egg, 0.5, seen.observation).detection
    left, top, right, bottom = in_main.box
    assert in_main.frame == "main"
    assert in_main.mask is not None
    assert in_main.mask[int(top) : int(bottom) + 1, int(left) : int(right) + 1].sum() == in_main.mask.sum()
    hidden = replace(egg, masks={**egg.masks, "main": np.zeros_like(egg.masks["main"])})
    assert Match.of("egg", hidden, 0.5, seen.observation).detection.frame == "side"
    with pytest.raises(ValueError, match="isn't seen"):
        Match.of("egg", replace(egg, masks={}), 0.5, seen.observation)


# Documentation ----------------------------------------------------------------------------------------------------


def test_the_example_in_the_documentation_finds_both_red_peppers(capsys):
    text = (Path(__file__).parents[3] / "docs" / "detectors.md").read_text(encoding="utf-8")
    _, _, rest = text.partition("```python\n")
    exec(compile(rest.partition("```")[0], "docs/detectors.md", "exec"), {})  # noqa: S102  # our own file
    assert len(capsys.readouterr().out.splitlines()) == 2


def test_the_documentation_names_every_detector():
    text = (Path(__file__).parents[3] / "docs" / "detectors.md").read_text(encoding="utf-8")
    assert all(f"| `{name}`" in text for name in detector_names())
