"""The forms of the agents' answers: flat, small, every text and list bounded, so that a weak model copes with them.

The order of the fields is the order of thinking: evidence stands before what follows from it. What the fields mean is
said in the prompts; `steps` says what becomes of a written step.
"""

from __future__ import annotations

import re
from typing import Annotated, Any, Literal, get_args

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field

_NO_NAME = re.compile(r"[^\w '()/,&+.-]")


def _tidy(text: object) -> object:
    return " ".join(text.split()) if isinstance(text, str) else text


def _is_name(name: str) -> str:
    if found := _NO_NAME.search(name):
        raise ValueError(f"a name is plain words, without {found[0]!r}")
    return name


Name = Annotated[str, BeforeValidator(_tidy), AfterValidator(_is_name), Field(min_length=1, max_length=60)]
"""Of an object."""
Sentence = Annotated[str, BeforeValidator(_tidy), Field(max_length=300)]
Paragraph = Annotated[str, BeforeValidator(_tidy), Field(max_length=1200)]
Offset = Annotated[float, Field(ge=-1.0, le=1.0, allow_inf_nan=False)]
"""m"""
Coordinate = Annotated[float, Field(ge=-2.0, le=2.0, allow_inf_nan=False)]
"""m"""
Heading = Literal["left", "right", "away", "towards"]
"""As the viewer sees it."""
OfObject = Literal["surface", "free", "top", "base", "centre", "left", "right", "near", "far"]
Place = Literal["grasp", OfObject, "point", "here"]
LONGEST = 12
"""Steps; what has more goes round in circles."""


def _untitled(schema: dict[str, Any]) -> None:
    """Take the titles away that say a field's name once more: schemas are part of what is asked, and paid for."""
    for field in schema.get("properties", {}).values():
        field.pop("title", None)


class Answer(BaseModel):
    """Base of all answers: immutable, nothing unknown. A form's docstring is shown to the model."""

    model_config = ConfigDict(frozen=True, extra="forbid", json_schema_extra=_untitled)


class SeenObject(Answer):
    """One thing on the table."""

    name: Name
    state: Sentence


class Seen(Answer):
    """What is seen on the table."""

    objects: Annotated[tuple[SeenObject, ...], Field(max_length=24)]
    summary: Paragraph


class Thought(Answer):
    """A judgement, and the next step."""

    evidence: Paragraph
    previous: Literal["none", "success", "failure"]
    remaining: Paragraph
    next: Literal["act", "done", "cannot", "measure"]
    subtask: Annotated[str, BeforeValidator(_tidy), Field(max_length=200)] = ""
    objects: Annotated[tuple[Name, ...], Field(max_length=8)] = ()


class Choice(Answer):
    """Which numbered thing is meant."""

    reason: Sentence
    number: Annotated[int, Field(ge=0, le=64)]
    """0 for none of them."""


def _only_what_makes_sense(schema: dict[str, Any]) -> None:
    """Offer the kinds of steps apart, so that a schema that is enforced lets no step be written that can't be meant.

    Only object 0 can be grasped, and objects are taken at the grasp alone; a point has coordinates and no object. The
    object comes before its place, as that follows from it.
    """
    _untitled(schema)
    fields = schema["properties"]
    for field in fields.values():
        field.pop("default", None)
    do, index, x, y, lie, end, gripper = (
        fields.pop(name) for name in ("do", "object", "x", "y", "lie", "end", "gripper")
    )
    del fields["to"]
    index, x, y = (optional["anyOf"][0] for optional in (index, x, y))
    place = {"type": "string", "enum": list(get_args(OfObject))}
    release = {**gripper, "enum": ["open", "keep"]}

    def kind(gripper: dict[str, Any], **own: Any) -> dict[str, Any]:
        properties = {"do": do, **own, **fields, "gripper": gripper}
        return {
            "type": "object",
            "properties": properties,
            "required": [name for name in properties if name in ("do", "object", "to", "x", "y")],
            "additionalProperties": False,
        }

    for name in ("type", "properties", "required", "additionalProperties"):
        schema.pop(name)
    schema["anyOf"] = [
        kind(gripper, object={"type": "integer", "const": 0}, to=_only("grasp")),
        kind(release, object=index, to=place, lie=lie, end=end),
        kind(gripper, to=_only("point"), x=x, y=y, lie=lie, end=end),
        kind(gripper, to=_only("here")),
    ]


def _only(word: str) -> dict[str, Any]:
    return {"type": "string", "const": word}


class WrittenStep(Answer):
    """One step of a movement."""

    model_config = ConfigDict(json_schema_extra=_only_what_makes_sense)

    do: Annotated[str, BeforeValidator(_tidy), Field(min_length=1, max_length=120)]
    object: Annotated[int, Field(ge=0, le=63)] | None = None
    to: Place
    x: Coordinate | None = None
    y: Coordinate | None = None
    right: Offset = 0.0
    away: Offset = 0.0
    up: Offset = 0.0
    turn: Annotated[float, Field(ge=-360.0, le=360.0, allow_inf_nan=False)] = 0.0
    """Degrees, counter-clockwise seen from above."""
    lie: Literal["keep", Heading] = "keep"
    """Where a long thing points on arrival."""
    end: Heading | None = None
    """Which end shall point there: the one that points this way now."""
    gripper: Literal["open", "close", "keep"] = "keep"


class Written(Answer):
    """A movement."""

    skill: Annotated[str, BeforeValidator(_tidy), Field(min_length=1, max_length=40)]
    steps: Annotated[tuple[WrittenStep, ...], Field(min_length=1, max_length=LONGEST)]
