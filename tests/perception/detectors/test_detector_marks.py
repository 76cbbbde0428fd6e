from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pydantic import ValidationError
from tables import Look, arrange, block

from maniagent.models.question import Picture, Question, Unfit
from maniagent.perception.detectors import make_detector
from maniagent.perception.detectors.marks import MAX_MARKS, NamedMarks


class Namer:
    """A chat model that gives its answers in turn and, like a real one, hears why an answer doesn't fit."""

    name = "namer"

    def __init__(self, *answers: dict[int, list[int]]) -> None:
        self.answers = list(answers)
        self.questions: list[Question] = []
        self.complaints: list[str] = []

    def ask(self, question):
        self.questions.append(question)
        while True:
            numbers = self.answers.pop(0)
            found = [{"query": query, "looks": "a thing", "numbers": ns} for query, ns in numbers.items()]
            try:
                answer = question.answer.model_validate({"found": found})
                question.check(answer)
            except (Unfit, ValidationError) as error:
                self.complaints.append(str(error))
                continue
            return answer


@pytest.fixture(scope="module")
def seen() -> Look:
    return arrange(
        {
            "egg": ("egg", 0.2, -0.15, 0.0),
            "carrot": ("carrot", 0.3, 0.0, 60.0),
            "block": (block("blue"), 0.22, 0.14, 0.0),
        }
    )


def number_of(seen: Look, name: str) -> int:
    (number,) = [i for i, segment in enumerate(seen.view.segments, 1) if segment is seen.segment_of(name)]
    return number


def test_the_numbers_that_the_model_names_become_segments_best_first(seen):
    carrot, egg = number_of(seen, "carrot"), number_of(seen, "egg")
    model = Namer({1: [carrot, egg], 2: []})
    found = make_detector("marks", model).detect(("food", "fork"), seen.view, seen.observation)
    assert [[match.segment for match in matches] for matches in found] == [
        [seen.segment_of("carrot"), seen.segment_of("egg")],
        [],
    ]
    first, second = found[0]
    assert first.detection.score > second.detection.score > 0
    assert (first.detection.query, first.detection.frame) == ("food", "main")
    assert first.detection.mask is seen.segment_of("carrot").masks["main"]


def test_one_question_holds_all_names_and_both_pictures(seen):
    model = Namer({1: [], 2: []})
    make_detector("marks", model).detect(("food", "<b> & {count}"), seen.view, seen.observation)
    (question,) = model.questions
    assert question.role == "objects"
    plain, marked = (part for part in question.parts if isinstance(part, Picture))
    assert (plain.rgb == seen.observation.main_frame.rgb).all()
    assert (marked.rgb != plain.rgb).any()
    text = question.parts[-1]
    assert isinstance(text, str)
    assert f"run from 1 to {len(seen.view.segments)}" in text
    assert '<name number="2">&lt;b&gt; &amp; {count}</name>' in text
    assert "no number" in question.instructions


def test_the_order_in_which_the_model_answers_does_not_matter(seen):
    egg = number_of(seen, "egg")
    found = make_detector("marks", Namer({2: [egg], 1: []})).detect(("fork", "egg"), seen.view, seen.observation)
    assert [len(matches) for matches in found] == [0, 1]


@pytest.mark.parametrize(
    ("unfit", "complaint"),
    [
        ({1: [39], 2: []}, "no thing in the picture has the number 39; 1 to "),
        ({1: [0], 2: []}, "the number 0"),
        ({1: [2, 2], 2: []}, "twice"),
        ({1: [2]}, "exactly one entry for each name, 1 to 2"),
        ({1: [], 2: [], 3: []}, "exactly one entry"),
        ({1: list(range(1, MAX_MARKS + 5)), 2: []}, "at most 40"),
    ],
)
def test_an_answer_that_does_not_fit_goes_back_with_the_reason(unfit, complaint, seen):
    model = Namer(unfit, {1: [1], 2: []})
    found = make_detector("marks", model).detect(("egg", "fork"), seen.view, seen.observation)
    assert complaint in model.complaints[0]
    assert [len(matches) for matches in found] == [1, 0]


def test_no_question_is_asked_about_nothing(seen):
    detector = make_detector("marks", Namer())
    assert detector.detect((), seen.view, seen.observation) == ()
    assert detector.detect(("egg",), replace(seen.view, segments=()), seen.observation) == ((),)


def test_what_the_main_view_does_not_show_gets_no_number(seen):
    segments = tuple(
        replace(segment, masks={"side": segment.masks["side"]}) if i == 0 else segment
        for i, segment in enumerate(seen.view.segments)
    )
    model = Namer({1: [1]})
    ((match,),) = make_detector("marks", model).detect(
        ("egg",), replace(seen.view, segments=segments), seen.observation
    )
    assert match.segment is segments[1]
    assert f"1 to {len(segments) - 1}." in str(model.questions[0].parts[-1])


def test_of_very_many_things_the_largest_are_numbered(seen):
    def dot(i: int) -> np.ndarray:
        mask = np.zeros((480, 640), bool)
        mask[10 + 9 * (i // 20) : 16 + 9 * (i // 20), 10 + 30 * (i % 20) : (16 if i != 7 else 15) + 30 * (i % 20)] = (
            True
        )
        return mask

    segments = tuple(replace(seen.view.segments[0], masks={"main": dot(i)}) for i in range(MAX_MARKS + 1))
    model = Namer({1: [8, MAX_MARKS]})
    ((first, last),) = make_detector("marks", model).detect(
        ("dot",), replace(seen.view, segments=segments), seen.observation
    )
    assert (first.segment, last.segment) == (segments[8], segments[-1])


def test_the_form_of_the_answer_is_bounded():
    with pytest.raises(ValidationError):
        NamedMarks.model_validate({"found": [{"query": 1, "looks": "x" * 301, "numbers": []}]})
    with pytest.raises(ValidationError):
        NamedMarks.model_validate({"found": [], "note": "more"})
