"""Words meet segments: what is named, what is meant, and what is said where it can't be told."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_segments import THINGS, block, make, pepper, plate

from maniagent.errors import DetectionFailure, UsageError
from maniagent.geometry import look_at
from maniagent.perception.lexicon import Lexicon
from maniagent.perception.segments import Segment
from maniagent.perception.viewpoint import Viewpoint

LEXICON = Lexicon.load()
VIEW = Viewpoint.from_camera(look_at([0.85, 0.0, 0.55], [0.3, 0.0, 0.0]))
"""In front of the robot, looking back at it: the viewer's right is base +y, away is base -x."""


@cache
def all_things(light: float) -> list[Segment]:
    looks = enumerate(THINGS.values())
    return [make(*look, xy=(0.1 * i, 0.0), yaw=0.3 * i, light=light, seed=i) for i, look in looks]


@pytest.mark.parametrize("light", [0.35, 0.7, 1.0])
@pytest.mark.parametrize("noun", THINGS)
def test_each_thing_is_found_among_all_others_in_light_and_shade(noun: str, light: float) -> None:
    assert LEXICON.ground(noun, all_things(light), VIEW) == list(THINGS).index(noun)


@pytest.mark.parametrize(
    ("said", "noun"),
    [
        ("chili", "red pepper"),
        ("chilli pepper", "red pepper"),
        ("aubergine", "eggplant"),
        ("cloth", "towel"),
        ("bowl", "dish"),
        ("pen", "marker"),
        ("the duck", "toy"),
        ("wooden cube", "blue block"),
        ("open human hand", "hand"),
        ("any blocks", "blue block"),
        ("blue one", "blue block"),
        ("orange thing", "carrot"),
        ("golden banana", "banana"),
    ],
)
def test_synonyms(said: str, noun: str) -> None:
    assert LEXICON.score(said, make(*THINGS[noun])) > 0.8


@pytest.mark.parametrize(
    ("noun", "name"),
    [
        ("red pepper", "red pepper"),
        ("plate", "plate"),
        ("yellow block", "small yellow block"),
        ("blue block", "large blue block"),
        ("carrot", "carrot"),
    ],
)
def test_names_tell_things_of_a_kind_apart(noun: str, name: str) -> None:
    assert LEXICON.name(make(*THINGS[noun])) == name


def test_what_has_no_name_is_described() -> None:
    assert LEXICON.name(make("box", (0.3, 0.03, 0.03), "red")) == "red elongated object"
    assert LEXICON.name(make("box", (0.05, 0.05, 0.004), "purple")) == "purple flat object"


# Relative words -------------------------------------------------------------------------------------------------

ROW = [pepper("green", xy=(0.3, -0.1)), pepper(xy=(0.3, 0.0)), pepper(xy=(0.3, 0.1)), plate(xy=(0.15, 0.2))]
"""From the viewer's left to right."""


@pytest.mark.parametrize(
    ("phrase", "index"),
    [
        ("pepper in the middle", 1),
        ("middle pepper", 1),
        ("left pepper", 0),
        ("leftmost pepper", 0),
        ("pepper on the far right", 2),
        ("red pepper on the left", 1),
        ("second pepper from the right", 1),
        ("third pepper", 2),
        ("first red pepper", 1),
        ("last pepper", 2),
        ("green pepper", 0),
        ("any green pepper", 0),
        ("pepper closest to the plate", 2),
        ("pepper nearest to plate", 2),
        ("pepper farthest from the plate", 0),
        ("plate in the middle", 3),
    ],
)
def test_places_in_a_row(phrase: str, index: int) -> None:
    assert LEXICON.ground(phrase, ROW, VIEW) == index


BLOCKS = [
    block("red", xy=(0.3, -0.15)),
    block("red", xy=(0.3, 0.15)),
    block("red", xy=(0.18, 0.0)),
    block("red", size=0.05, xy=(0.42, 0.0)),
    plate(xy=(0.3, 0.0)),
    block("red", xy=(0.3, 0.02), support_z=0.004),
]


@pytest.mark.parametrize(
    ("phrase", "index"),
    [
        ("block that is left of the plate", 0),
        ("block to the right of the plate", 1),
        ("block behind the plate", 2),
        ("block in front of the plate", 3),
        ("block that is on the plate", 5),
        ("block in the plate", 5),
        ("largest block", 3),
        ("big red cube", 3),
        ("tallest block", 3),
        ("nearest block", 3),
        ("block at the back", 2),
    ],
)
def test_places_about_a_landmark_and_sizes(phrase: str, index: int) -> None:
    assert LEXICON.ground(phrase, BLOCKS, VIEW) == index


def test_next_to_and_on_the_table() -> None:
    segments = [block(xy=(0.3, -0.14)), block(xy=(0.3, 0.3)), plate(), block(xy=(0.3, 0.01), support_z=0.004)]
    assert LEXICON.ground("block next to the plate", segments, VIEW) == 0
    assert LEXICON.ground("block on the table", segments[1:], VIEW) == 0


def test_relative_clauses_nest() -> None:
    phrase = "block that is closest to the plate that is left of the banana"
    banana = make("disc", (0.13, 0.042, 0.032), "yellow", xy=(0.3, 0.3))
    segments = [plate(xy=(0.3, 0.05)), block(xy=(0.3, -0.1)), block(xy=(0.45, 0.3)), banana]
    assert LEXICON.ground(phrase, segments, VIEW) == 1


# What can't be told ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("phrase", "complaint"),
    [
        ("unicorn", "no word 'unicorn'"),
        ("bananna", "Did you mean 'banana'"),
        ("gren pepper", "Did you mean 'green'"),
        ("banana", "No banana is in view. Seen: green pepper"),
        ("pepper", "3 objects fit 'pepper'.*'the middle pepper'"),
        ("red pepper", "2 objects fit 'red pepper'.*'the left red pepper', 'the right red pepper'"),
        ("peppers", "several"),
        ("middle red pepper", "2 objects fit"),
        ("fourth pepper", "No fourth pepper"),
        ("largest pepper", "3 objects fit"),
        ("pepper on the plate", "No pepper on the plate"),
        ("red", "add a noun"),
        ("", "add a noun"),
        ("ingredients needed for menemen", "no word"),
        ("knife and fork", "no word"),
        ("pepper left of the unicorn", "unicorn"),
    ],
)
def test_what_it_cannot_ground_it_says(phrase: str, complaint: str) -> None:
    with pytest.raises(DetectionFailure, match=complaint):
        LEXICON.ground(phrase, ROW, VIEW)


def test_different_names_are_offered_where_they_help() -> None:
    with pytest.raises(DetectionFailure, match="'the small red block', 'the small blue block'"):
        LEXICON.ground("block", [block("red"), block("blue", xy=(0.3, 0.2))], VIEW)


@pytest.mark.parametrize("phrase", ["pepper", "red pepper", "thing", "pepper that is next to the plate"])
def test_what_is_offered_is_understood(phrase: str) -> None:
    segments = [*ROW, pepper(xy=(0.15, 0.32), yaw=1.5)]
    with pytest.raises(DetectionFailure) as failure:
        LEXICON.ground(phrase, segments, VIEW)
    offers = re.findall("'([^']*)'", str(failure.value).split("Say which:")[1])
    assert len({LEXICON.ground(offer, segments, VIEW) for offer in offers}) == len(offers) >= 2


def test_an_empty_table_is_called_empty() -> None:
    with pytest.raises(DetectionFailure, match="table is empty"):
        LEXICON.ground("pepper", [], VIEW)


@given(st.text(max_size=60))
def test_any_phrase_grounds_or_fails_cleanly(phrase: str) -> None:
    try:
        index = LEXICON.ground(phrase, ROW, VIEW)
    except DetectionFailure:
        return
    assert 0 <= index < len(ROW)


# Laws -----------------------------------------------------------------------------------------------------------

_grid = st.integers(-5, 5).map(lambda n: 0.05 * n)
_apart = st.lists(st.tuples(_grid, _grid), min_size=2, max_size=5, unique_by=(lambda p: p[0], lambda p: p[1]))


@settings(max_examples=30, deadline=None)
@given(_apart, st.sampled_from(["left right", "right left", "middle middle", "nearest nearest", "farthest farthest"]))
def test_left_and_right_are_mirror_images(places: list[tuple[float, float]], sides: str) -> None:
    def meant(mirror: int) -> int | str:
        segments = [block(xy=(0.3 + x, -y if mirror else y), seed=i) for i, (x, y) in enumerate(places)]
        try:
            return LEXICON.ground(f"{sides.split()[mirror]} block", segments, VIEW)
        except DetectionFailure:
            return "several are equally good"

    assert meant(0) == meant(1)


@settings(max_examples=20, deadline=None)
@given(st.floats(-np.pi, np.pi))
def test_sides_turn_with_the_viewer(bearing: float) -> None:
    eye = [0.3 + 0.6 * np.cos(bearing), 0.6 * np.sin(bearing), 0.5]
    view = Viewpoint.from_camera(look_at(eye, [0.3, 0.0, 0.0]))
    middle = np.array([0.3, 0.0])
    segments = [block(xy=tuple(middle + 0.1 * d)) for d in (-view.right, view.right, -view.away, view.away)]
    found = [LEXICON.ground(f"{side} block", segments, view) for side in ("left", "right", "nearest", "farthest")]
    assert found == [0, 1, 2, 3]


@given(st.permutations(range(4)))
@settings(max_examples=10, deadline=None)
def test_the_order_of_segments_does_not_matter(order: list[int]) -> None:
    for phrase, index in (("pepper in the middle", 1), ("green pepper", 0), ("plate", 3)):
        assert order[LEXICON.ground(phrase, [ROW[i] for i in order], VIEW)] == index


# The data file --------------------------------------------------------------------------------------------------


def test_users_add_words_in_their_own_file(tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text(
        "colours: {red: {hue: [10, 46]}}\nnouns: {ruler: {length: [0.25, 0.35], colours: {red: [0.5, 1]}}}\n"
    )
    mine = Lexicon.load(file)
    assert mine.name(make("box", (0.3, 0.03, 0.03), "red")) == "ruler"


def test_a_kind_may_have_several_looks(tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    long, short = "length: [0.25, 0.35]", "length: [0.05, 0.09]"
    file.write_text(f"colours: {{}}\nnouns: {{ruler: {{{long}, also: [{{{short}}}]}}}}\n")
    mine = Lexicon.load(file)
    seen = [mine.name(make("box", (length, 0.03, 0.03), "red")) for length in (0.3, 0.07)]
    assert seen == ["ruler", "ruler"]
    assert mine.name(make("box", (0.15, 0.03, 0.03), "red")) != "ruler"


@pytest.mark.parametrize(
    ("said", "shape", "extent", "colours"),
    [
        ("spoon", "disc", (0.14, 0.03, 0.022), {"green": 0.65, "white": 0.35}),  # its handle in any colour
        ("plate", "disc", (0.11, 0.11, 0.006), "green"),  # a toy's
        ("plate", "vessel", (0.24, 0.24, 0.02), "white"),
        ("eggplant", "disc", (0.07, 0.036, 0.036), "purple"),
    ],
)
def test_looks_that_vary_within_a_kind(
    said: str, shape: str, extent: tuple[float, float, float], colours: dict[str, float] | str
) -> None:
    other = block("purple", 0.045, xy=(0.1, 0.0))
    thing = make(shape, extent, colours, xy=(0.3, 0.0))
    assert LEXICON.ground(said, [other, thing, pepper("green", xy=(0.2, 0.1))], VIEW) == 1
    assert said in LEXICON.name(thing)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("nouns: {}", "colours"),
        ("colours: {}\nnouns: {egg: {lenght: [0, 1]}}", "lenght"),
        ("colours: {}\nnouns: {egg: {length: [1, 0]}}", "backwards"),
        ("colours: {}\nnouns: {egg: {also: [{lenght: [0, 1]}]}}", "lenght"),
        ("colours: {}\nnouns: {egg: {also: [{colours: {ochre: [0, 1]}}]}}", "ochre"),
        ("colours: {}\nnouns: {egg: {length: [.nan, 1]}}", "finite"),
        ("colours: {}\nnouns: {egg: {colours: {ochre: [0, 1]}}}", "ochre"),
        ("colours: {}\nnouns: {egg: {synonyms: [oval]}, ball: {synonyms: [oval]}}", "means both"),
        ("colours: [", "not valid YAML"),
        ("just text", "no lexicon"),
    ],
)
def test_a_bad_file_is_refused_with_the_reason(tmp_path: Path, text: str, complaint: str) -> None:
    file = tmp_path / "bad.yaml"
    file.write_text(text)
    with pytest.raises(UsageError, match=complaint):
        Lexicon.load(file)


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="Can't read"):
        Lexicon.load(tmp_path / "none.yaml")
