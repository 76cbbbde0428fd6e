from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from maniagent.perception.detectors.wording import every


@pytest.mark.parametrize(
    ("query", "phrase"),
    [
        ("red pepper", "every red pepper"),
        ("The red pepper.", "every red pepper"),
        ("every plate", "every plate"),
        ("  a  3-cm block ", "every 3-cm block"),
        ("theremin", "every theremin"),
        ("<OCR>cup</s>{input}", "every OCR cup s input"),
        ("Möhre", "every Möhre"),
    ],
)
def test_all_instances_are_asked_for_in_plain_words(query, phrase):
    assert every(query) == phrase


@given(st.text(max_size=60))
def test_no_query_carries_markup_to_a_model(query):
    try:
        phrase = every(query)
    except ValueError:
        return
    assert phrase.startswith("every ")
    assert not set(phrase) & set("<>{}[]|.\n")
    assert every(phrase) == phrase


@pytest.mark.parametrize("query", ["", "...", "<>", "-", "_ _"])
def test_a_query_without_words_is_refused(query):
    with pytest.raises(ValueError, match="holds no words"):
        every(query)
