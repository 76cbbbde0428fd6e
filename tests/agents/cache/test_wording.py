"""The normal form: what it folds, what it keeps, and what can't be told apart by it."""

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from maniagent.agents.cache.wording import normal_form, place, places, with_names, without_names

NOUNS = ["carrot", "egg", "plate", "dish", "red pepper", "green pepper", "pepper", "toy duck", "block b", "corn cobs"]
VERBS = ["put", "drag", "rotate", "push", "stack", "lift", "turn over"]
LINKS = ["on", "onto", "in", "to the left of", "beside", "towards"]
TAILS = ["", "by 90 degrees", "by 45 degrees", "gently"]


@st.composite
def skills(draw: st.DrawFn, count: int | None = None) -> tuple[str, ...]:
    """A verb, links between `count` objects, a tail: everything of a sub-task but its objects."""
    count = draw(st.integers(1, 3)) if count is None else count
    links = [draw(st.sampled_from(LINKS)) for _ in range(count - 1)]
    return (draw(st.sampled_from(VERBS)), *links, draw(st.sampled_from(TAILS)))


def say(skill: tuple[str, ...], objects: list[str], article: str = "the") -> str:
    verb, *links, tail = skill
    said = [f"{article} {name}" for name in objects]
    middle = [word for pair in zip(links, said[1:], strict=True) for word in pair]
    return " ".join(filter(None, [verb, said[0], *middle, tail]))


@pytest.mark.parametrize(
    ("text", "queries", "form"),
    [
        ("put the carrot on the plate", ("carrot", "plate"), "put {0} on {1}"),
        ("Put an egg on the plate.", ("egg", "plate"), "put {0} on {1}"),
        ("put the plate under the carrot", ("carrot", "plate"), "put {1} under {0}"),
        ("put the red pepper on the plate", ("red pepper", "plate"), "put {0} on {1}"),
        ("put the red pepper on the plate", ("pepper", "plate"), "put red {0} on {1}"),
        ("put the red pepper beside the pepper", ("pepper", "red pepper"), "put {1} beside {0}"),
        ("stack the plates on the plate", ("plate", "plates"), "stack {1} on {0}"),
        ("rotate the Carrot by 90 degrees", ("the carrot",), "rotate {0} by 90 degrees"),
        ("move it 0.05 m", ("it",), "move {0} 0.05 m"),
    ],
)
def test_names_become_indices_and_the_rest_stays(text: str, queries: tuple[str, ...], form: str) -> None:
    assert normal_form(text, queries) == form


@pytest.mark.parametrize(
    ("text", "queries"),
    [
        ("put it on the plate", ("carrot", "plate")),
        ("put the cup on the cup", ("cup", "a cup")),
        ("put the peppers on the plate", ("pepper", "plate")),
        ("turn it", ("turn",)),
        ("clear the table", ("carrot",)),
        ("put {0} on the plate", ("plate",)),
        ("put the on the plate", ("the", "plate")),
    ],
    ids=["unmentioned", "two of one name", "plural", "a verb", "none named", "braces", "an article"],
)
def test_a_text_that_does_not_say_which_object_is_which_has_none(text: str, queries: tuple[str, ...]) -> None:
    assert normal_form(text, queries) is None


@given(st.text(max_size=60), st.lists(st.text(max_size=12), max_size=3))
def test_a_normal_form_is_its_own(text: str, queries: list[str]) -> None:
    form = normal_form(text, queries)
    if form is not None:
        assert normal_form(form, places(len(queries))) == form


@given(st.data(), skills())
def test_names_articles_and_case_make_no_difference(data: st.DataObject, skill: tuple[str, ...]) -> None:
    count = len(skill) - 1
    several = st.lists(st.sampled_from(NOUNS), min_size=count, max_size=count, unique=True)
    one, other = data.draw(several), data.draw(several)
    said = say(skill, one)
    assert normal_form(said, one) is not None
    assert normal_form(said, one) == normal_form(say(skill, other, "a").upper() + ".", other)


@given(st.data(), skills(), skills())
def test_another_skill_never_has_the_same_form(
    data: st.DataObject, skill: tuple[str, ...], other: tuple[str, ...]
) -> None:
    assume(skill != other)
    forms = []
    for words in (skill, other):
        count = len(words) - 1
        objects = data.draw(st.lists(st.sampled_from(NOUNS), min_size=count, max_size=count, unique=True))
        forms.append(normal_form(say(words, objects), objects))
    assert forms[0] != forms[1]


@given(st.text(max_size=40), st.lists(st.text(max_size=8), max_size=4), st.lists(st.text(max_size=8), max_size=4))
def test_another_number_of_objects_never_has_the_same_form(text: str, some: list[str], others: list[str]) -> None:
    assume(len(some) != len(others))
    form = normal_form(text, some)
    assert form is None or form != normal_form(text, others)


@given(st.text(max_size=40), st.lists(st.text(max_size=8), min_size=1, max_size=3))
def test_a_form_mentions_every_object(text: str, queries: list[str]) -> None:
    form = normal_form(text, queries)
    assert form is None or set(places(len(queries))) <= set(form.split(" "))


@given(skills(2))
def test_numbers_are_kept(skill: tuple[str, ...]) -> None:
    objects = ["carrot", "plate"]
    forms = {normal_form(f"{say(skill, objects)} {number}", objects) for number in ("0.05", "0.5", "5", "-5")}
    assert len(forms) == 4


def test_descriptions_are_written_for_the_objects_at_hand() -> None:
    kept = without_names("Carry the Carrot over the carrots and the plate", ("carrot", "plate"))
    assert kept == "Carry the {0} over the carrots and the {1}"
    assert with_names(kept, ("egg", "blue dish")) == "Carry the egg over the carrots and the blue dish"


def test_of_two_names_the_longer_one_is_meant() -> None:
    assert without_names("take the red pepper", ("pepper", "red pepper")) == "take the {1}"


@given(st.text(max_size=40), st.lists(st.text(min_size=1, max_size=8), min_size=1, max_size=3, unique=True))
def test_no_description_is_too_strange(text: str, queries: list[str]) -> None:
    with_names(without_names(text, queries), queries)


def test_braces_of_objects_that_are_not_there_stay() -> None:
    assert with_names(f"take {place(0)} to {place(7)}", ("egg",)) == "take egg to {7}"
