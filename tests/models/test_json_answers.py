"""Finding JSON in what a model writes."""

import contextlib
import json
from typing import Any

import pytest
from asking import CUP, GOOD, Spot, question, refuse_cups
from hypothesis import given, settings
from hypothesis import strategies as st

from maniagent.models.answers import LONGEST, fit, objects
from maniagent.models.question import Unfit

prose = st.text(st.characters(exclude_characters='{}"', codec="utf-8"), max_size=60)
values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(max_size=20),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4),
    max_leaves=12,
)
records = st.dictionaries(st.text(max_size=8), values, min_size=1, max_size=5)


@settings(max_examples=50)
@given(st.lists(records, min_size=1, max_size=4), prose, st.sampled_from(["", "```json\n", "```\n", "Answer: "]))
def test_every_object_is_found_whatever_stands_around_it(found: list[dict[str, Any]], said: str, fence: str) -> None:
    text = said + "".join(f"{fence}{json.dumps(record)}\n{said}" for record in found)
    assert [json.loads(each) for each in objects(text)] == found


@given(st.text(max_size=300) | st.text('{}[]":,0a\\ ', max_size=300))
def test_any_text_at_all_is_fitted_or_unfit(text: str) -> None:
    with contextlib.suppress(Unfit):  # and raises nothing else
        assert isinstance(fit(text, question()), Spot)


@given(st.builds(Spot, name=st.text(max_size=40), x=st.floats(-2, 2), tags=st.lists(st.text(max_size=5), max_size=3)))
def test_what_fits_comes_back_as_it_was(spot: Spot) -> None:
    assert fit(spot.model_dump_json(), question()) == spot


def test_the_last_object_that_fits_is_the_answer() -> None:
    assert fit(f'First {{"name": "bowl", "x": 1}}. No: {GOOD} and {{"other": 1}}', question()) == CUP


def test_thoughts_are_no_answer() -> None:
    assert fit(f'<think>{{"name": "bowl", "x": 1}}</think>{GOOD}', question()) == CUP
    with pytest.raises(Unfit, match="no JSON object"):
        fit(f"<think>{GOOD}", question())


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "no JSON object"),
        ("I can't see it.", "no JSON object"),
        ("[]", "no JSON object"),
        ('["name", "cup"]', "no JSON object"),
        ('{"name": "cup", "x": 0.2', "no complete JSON object"),
        ('{"name": "cup", x: 0.2}', "no complete JSON object"),
        ('{"name": "cup", "x": NaN}', "no strict JSON"),
        ('{"name": "cup", "x": -Infinity}', "no strict JSON"),
        ('{"name": "cup", "x": 1e999}', "infinite"),
        ('{"name": "cup", "x": 1e9}', "x: Input should be less than or equal to 2"),
        ('{"name": "cup", "x": "left"}', "x: Input should be a valid number"),
        ('{"name": ["cup"], "x": 0}', "name: Input should be a valid string"),
        ('{"name": "cup"}', "x: Field required"),
        ('{"name": "cup", "x": 0, "run": "rm"}', "run: Extra inputs are not permitted"),
        ('{"name": "\\ud800", "x": 0}', "no strict JSON"),
        ("{" * 100_000, "no complete JSON object"),
        ('{"a":' * 50_000, "no complete JSON object"),
        ('{"x": ' + "9" * 10_000 + ', "name": "cup"}', "JSON"),
        ('{"name": "' + "cup" * 10_000 + '", "x": 0}', "at most 40 characters"),
        ('{"name": "cup", "x": 0, "tags": [{"name": "a"}, {"name"', "no complete JSON object"),
    ],
)
def test_the_model_is_told_what_is_wrong(text: str, complaint: str) -> None:
    with pytest.raises(Unfit, match=complaint) as told:
        fit(text, question())
    assert len(str(told.value)) < 1000


def test_an_answer_that_does_not_fit_the_situation_is_unfit() -> None:
    with pytest.raises(Unfit, match="no cup"):
        fit(GOOD, question(check=refuse_cups))


def test_only_so_much_of_an_answer_is_looked_at() -> None:
    with pytest.raises(Unfit):
        fit(" " * LONGEST + GOOD, question())


def test_many_faults_are_told_in_few_lines() -> None:
    tags = json.dumps(list(range(50)))
    with pytest.raises(Unfit, match="and 42 more") as told:
        fit(f'{{"name": "cup", "x": 0, "tags": {tags}}}', question())
    assert len(str(told.value).splitlines()) == 10
