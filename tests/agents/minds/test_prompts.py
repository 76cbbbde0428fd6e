"""Prompt files: what is filled in, what is refused, and texts of others that can't break out of their place."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from maniagent.agents.minds.prompts import PLACEHOLDERS, Prompt, Prompts
from maniagent.agents.minds.telling import fenced, one_line, plain
from maniagent.errors import UsageError

SHIPPED = Path(__file__).parents[3] / "src/maniagent/agents/minds/prompts"


@pytest.mark.parametrize("name", sorted(PLACEHOLDERS))
def test_the_shipped_prompts_leave_no_placeholder_open(name: str) -> None:
    prompt: Prompt = getattr(Prompts.load(), name)
    instructions, question = prompt.filled(**dict.fromkeys(PLACEHOLDERS[name], "FILLED"))
    assert "FILLED" in instructions + question
    assert not any(f"{{{p}}}" in instructions + question for p in PLACEHOLDERS[name])


@given(st.text())
def test_what_is_filled_in_is_never_read_as_a_placeholder(said: str) -> None:
    prompt = Prompt("Say {a}.", "{a} and {b}")
    assert prompt.filled(a="{b}", b=f"x{said}x")[0] == "Say {b}."
    assert prompt.filled(a="1", b=f"x{said}x")[1].startswith("1 and x")


def test_braces_of_examples_stand_for_themselves() -> None:
    assert Prompt('{"to":"grasp"} {a}', "x").filled(a="1")[0] == '{"to":"grasp"} 1'


def own_prompts(folder: Path, name: str, text: str) -> Path:
    (folder / name).write_text(text, encoding="utf-8")
    return folder


def test_a_folder_replaces_the_prompts_it_holds_and_leaves_the_others(tmp_path: Path) -> None:
    own = Prompts.load(own_prompts(tmp_path, "scene.md", "Look.\n---\n{instruction} {names}"))
    assert own.scene.filled(instruction="eat", names="")[0] == "Look."
    assert own.controller == Prompts.load().controller


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("scene.md", "Look.\n---\n{instruction}", r"scene.md in .* lacks \{names\}"),
        ("scene.md", "Look {nms}.\n---\n{instruction} {names}", r"unknown \{nms\}; known are \{instruction\}, \{na"),
        ("scene.md", "Look. {instruction} {names}", "needs two texts"),
        ("scene.md", "\n---\n{instruction} {names}", "needs two texts"),
        ("scene.md", "x" * 30_000 + "\n---\n{instruction} {names}", "at most 20000 are sent"),
        ("sceen.md", "Look.", "holds sceen.md, which no agent asks for"),
        ("scene.txt", "Look.", "holds no prompts"),
    ],
)  # fmt: skip
def test_prompts_that_would_not_do_are_refused(tmp_path: Path, name: str, text: str, said: str) -> None:
    with pytest.raises(UsageError, match=said):
        Prompts.load(own_prompts(tmp_path, name, text))


def test_a_prompt_that_is_no_text_is_refused(tmp_path: Path) -> None:
    (tmp_path / "scene.md").write_bytes(b"\xff\xfe\xff")
    with pytest.raises(UsageError, match="can't be read"):
        Prompts.load(tmp_path)


@given(st.text(max_size=300), st.integers(5, 100))
def test_fenced_text_is_bounded_and_can_not_close_a_fence(text: str, limit: int) -> None:
    inside = fenced(text, limit)
    assert len(inside) <= limit
    assert not set(inside) & set("<>\x00\x1b\u202e")
    assert "\n" not in one_line(text, limit)
    assert fenced(inside, limit) == inside or inside.endswith("...")


@given(st.text(max_size=60))
def test_the_plain_form_of_a_name_is_its_own_plain_form_whatever_its_case_and_spaces(name: str) -> None:
    assert plain(f"  {name.lower()} ") == plain(name.lower())
    assert plain("The  Red\tPepper.") == plain("red pepper") == "red pepper"
