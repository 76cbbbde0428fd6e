"""Noun phrases are read word for word, and mean the same however the parser of instructions spells them."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from maniagent.agents.rules.nouns import noun_phrase
from maniagent.errors import DetectionFailure
from maniagent.perception.phrases import Pick, Where
from maniagent.perception.referring import Reference, Size, read_reference
from maniagent.perception.vocabulary import ANYTHING, Vocabulary

VOCABULARY = Vocabulary.load()
LEFT_PLATE = Reference("", "plate", pick=Pick.LEFT)


@pytest.mark.parametrize(
    ("phrase", "reference"),
    [
        ("pepper", Reference("", "pepper")),
        ("the big Red chili-pepper", Reference("", "pepper", ("red",), (Size.LARGEST,))),
        ("any block", Reference("", "block", anyone=True)),
        ("left one", Reference("", ANYTHING, pick=Pick.LEFT)),
        ("pepper in the centre", Reference("", "pepper", pick=Pick.MIDDLE)),
        ("second pepper from the right", Reference("", "pepper", pick=Pick.RIGHT, ordinal=2)),
        ("egg on the table", Reference("", "egg", where=Where.ON)),
        (
            "block that is left of the small plate",
            Reference("", "block", where=Where.LEFT_OF, landmark=Reference("", "plate", sizes=(Size.SMALLEST,))),
        ),
        (
            "egg on the left plate",
            Reference("", "egg", where=Where.ON, landmark=Reference("", "plate", pick=Pick.LEFT)),
        ),
        (
            "egg on the plate on the left",
            Reference("", "egg", where=Where.ON, landmark=Reference("", "plate", pick=Pick.LEFT)),
        ),
        ("egg on the left", Reference("", "egg", pick=Pick.LEFT)),
    ],
)
def test_what_a_phrase_asks_for(phrase: str, reference: Reference) -> None:
    assert _meaning(read_reference(phrase, VOCABULARY)) == reference


@pytest.mark.parametrize("phrase", ["", "the", "red", "left of the plate", "egg near", "shiny egg", "egg that is mine"])
def test_words_are_never_skipped(phrase: str) -> None:
    with pytest.raises(DetectionFailure):
        read_reference(phrase, VOCABULARY)


_nouns = st.sampled_from(["egg", "chili pepper", "block", "one", "bowl"])
_adjectives = st.lists(st.sampled_from(["red", "small", "wooden", "left", "second"]), max_size=2).map(" ".join)
_positions = st.sampled_from(["", "in the middle", "on the far left", "to the right", "at the back"])
_simple = st.tuples(st.sampled_from(["the", "any", "", "a"]), _adjectives, _nouns, _positions).map(" ".join)
_relations = st.sampled_from(
    ["on", "which is inside", "lying next to", "that is to the left of", "behind", "closest to", "furthest from"]
)
_landmarks = _simple.filter(lambda said: not said.startswith("any"))


@given(st.one_of(_simple, st.tuples(_simple, _relations, _landmarks).map(" ".join)))
def test_canonical_spelling_keeps_the_meaning(said: str) -> None:
    as_said = read_reference(said, VOCABULARY)
    as_spelt = read_reference(noun_phrase(said.split()), VOCABULARY)
    assert _meaning(as_said) == _meaning(as_spelt)


def _meaning(reference: Reference) -> Reference:
    """Without the wording."""
    landmark = reference.landmark and _meaning(reference.landmark)
    return replace(reference, phrase="", landmark=landmark)
