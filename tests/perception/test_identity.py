"""A thing is known again by colour and size, wherever it was put."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tables import Look

from maniagent.perception.identity import find_again, same_thing
from maniagent.testing import made_object

RED, GREEN, BLUE, WHITE = (190, 30, 30), (40, 130, 50), (30, 60, 180), (235, 232, 225)
COLOURS = st.sampled_from([RED, GREEN, BLUE, WHITE])
LENGTHS = st.sampled_from([0.03, 0.06, 0.12, 0.2])


def thing(colour: tuple[int, int, int] = RED, length: float = 0.1, at: tuple[float, float] = (0.25, 0.0)):
    return made_object(0, "thing", at, size=(length, 0.03, 0.03), colour=colour)


@given(COLOURS, LENGTHS, st.floats(0.65, 1.2))
def test_a_thing_is_itself_in_light_and_in_shade(colour: tuple[int, int, int], length: float, light: float) -> None:
    lit = tuple(min(255, round(channel * light)) for channel in colour)
    assert same_thing(thing(colour, length), thing(lit, 0.8 * length))


@given(COLOURS, COLOURS, LENGTHS, LENGTHS)
def test_likeness_is_mutual(
    a: tuple[int, int, int], b: tuple[int, int, int], length: float, other_length: float
) -> None:
    first, second = thing(a, length), thing(b, other_length)
    assert same_thing(first, second) == same_thing(second, first)


def test_a_strip_as_long_as_a_tray_is_no_tray() -> None:
    tray = made_object(0, "tray", (0.25, 0.0), size=(0.15, 0.09, 0.03), colour=WHITE)
    strip = made_object(1, "strip", (0.25, 0.05), size=(0.12, 0.016, 0.03), colour=WHITE)
    assert not same_thing(tray, strip)


@pytest.mark.parametrize("other", [GREEN, BLUE, WHITE])
def test_another_colour_is_another_thing(other: tuple[int, int, int]) -> None:
    assert not same_thing(thing(RED), thing(other))


def test_a_thing_twice_as_long_is_another_thing() -> None:
    assert not same_thing(thing(length=0.05), thing(length=0.1))


def test_of_two_alike_the_nearer_one_is_meant() -> None:
    near, far = thing(at=(0.3, 0.0)), thing(at=(0.3, 0.2))
    assert find_again(thing(at=(0.25, 0.05)), [far, near], within=1.0) is near


def test_nothing_alike_or_nothing_near_is_nothing() -> None:
    before = thing(at=(0.25, 0.0))
    assert find_again(before, [], within=1.0) is None
    assert find_again(before, [thing(GREEN)], within=1.0) is None
    assert find_again(before, [thing(at=(0.25, 0.2))], within=0.1) is None


def test_every_rendered_thing_is_known_again_in_another_layout(tables: list[Look]) -> None:
    for first, second in zip(tables[::2], tables[1::2], strict=True):
        now = {kind: second.segment_of(kind).to_object(0, kind) for kind in second.truth}
        for kind in first.truth:
            before = first.segment_of(kind).to_object(0, kind)
            assert same_thing(before, now[kind]), kind
            found = find_again(before, list(now.values()), within=np.inf)
            assert found is not None
