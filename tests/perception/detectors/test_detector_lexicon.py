from __future__ import annotations

from dataclasses import replace

import pytest
from tables import Look, arrange

from maniagent.errors import DetectionFailure
from maniagent.perception.detectors import make_detector


@pytest.fixture(scope="module")
def seen() -> Look:
    return arrange(
        {
            "left": ("red_chili", 0.25, -0.15, 0.0),
            "middle": ("red_chili", 0.25, -0.05, 0.0),
            "green": ("green_chili", 0.25, 0.06, 0.0),
            "plate": ("plate", 0.22, 0.22, 0.0),
        }
    )


def names(seen: Look, query: str) -> list[str]:
    (matches,) = make_detector("lexicon").detect((query,), seen.view, seen.observation)
    assert [m.detection.score for m in matches] == sorted((m.detection.score for m in matches), reverse=True)
    return [name for match in matches for name in seen.truth if seen.segment_of(name) is match.segment]


def test_several_instances_are_all_found(seen):
    assert sorted(names(seen, "red pepper")) == ["left", "middle"]


def test_what_the_words_single_out_comes_alone(seen):
    assert names(seen, "green pepper") == ["green"]
    assert names(seen, "leftmost red pepper") == ["left"]
    assert names(seen, "plate") == ["plate"]


def test_what_is_not_there_is_not_found(seen):
    assert names(seen, "banana") == []


def test_queries_keep_their_order(seen):
    plate, peppers = make_detector("lexicon").detect(("plate", "red pepper"), seen.view, seen.observation)
    assert (len(plate), len(peppers)) == (1, 2)
    assert plate[0].detection.query == "plate"


def test_a_word_that_the_lexicon_does_not_know_is_told(seen):
    with pytest.raises(DetectionFailure, match="pepperoni"):
        names(seen, "red pepperoni")


def test_on_an_empty_table_nothing_is_found(seen):
    empty = replace(seen.view, segments=())
    assert make_detector("lexicon").detect(("plate",), empty, seen.observation) == ((),)
