"""What is said to a model and what comes back, put into the client library's words."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pydantic import BaseModel

from .exchange import Mode
from .pictures import to_png
from .question import Picture

if TYPE_CHECKING:
    from pydantic_ai.messages import ModelMessage, ModelResponse, UserContent
    from pydantic_ai.models import ModelRequestParameters

_ANSWER_TOOL = "answer"
_LONGEST_SAID = 20_000
"""Characters of an unfit answer that go back with the complaint."""
_SCHEMA_TOLD = "\n\nAnswer with one JSON object that fits this JSON schema, and nothing else:\n{schema}"


@dataclass(frozen=True)
class Reply:
    """What came back."""

    text: str
    """The answer, or the arguments of the tool call."""
    tokens_in: int | None
    """None where the server doesn't say."""
    tokens_out: int | None
    cut_off: bool
    """The answer reached the most tokens it may have."""
    message: ModelResponse
    """The library's own, to go on from."""


@dataclass(frozen=True)
class Turn:
    """An answer that didn't fit, and why."""

    reply: Reply
    complaint: str


@dataclass(frozen=True)
class Prompt:
    """Everything that a request says, whatever the way in which it is sent."""

    instructions: str
    parts: tuple[str | Picture, ...]
    form: type[BaseModel]
    turns: tuple[Turn, ...] = ()


def to_parameters(form: type[BaseModel], mode: Mode, *, strict: bool | None) -> ModelRequestParameters:
    """How the form of the answer is enforced.

    `strict` asks for what some providers enforce only then; None leaves the schema as it is, with all its bounds.
    """
    from pydantic_ai.models import ModelRequestParameters
    from pydantic_ai.output import OutputObjectDefinition
    from pydantic_ai.tools import ToolDefinition

    schema = form.model_json_schema()
    match mode:
        case "schema":
            described = OutputObjectDefinition(json_schema=schema, name=form.__name__, strict=strict)
            return ModelRequestParameters(output_mode="native", output_object=described, prompted_output_template=False)
        case "tool":
            tool = ToolDefinition(
                name=_ANSWER_TOOL,
                description="Gives your answer.",
                parameters_json_schema=schema,
                kind="output",
                strict=strict,
            )
            return ModelRequestParameters(output_mode="tool", output_tools=[tool], allow_text_output=False)
        case "prompt":
            return ModelRequestParameters(output_mode="text")


def to_messages(prompt: Prompt, mode: Mode, *, tell_schema: bool) -> list[ModelMessage]:
    """The whole conversation; with `tell_schema` the instructions hold the form's JSON schema too."""
    from pydantic_ai.messages import ModelRequest, UserPromptPart

    instructions = prompt.instructions
    if tell_schema:
        instructions += _SCHEMA_TOLD.format(schema=json.dumps(prompt.form.model_json_schema()))
    question = UserPromptPart([_content(part) for part in prompt.parts])
    messages: list[ModelMessage] = [ModelRequest([question], instructions=instructions)]
    for turn in prompt.turns:
        messages += _told_again(turn, mode, instructions)
    return messages


def _content(part: str | Picture) -> UserContent:
    from pydantic_ai.messages import BinaryContent

    return part if isinstance(part, str) else BinaryContent(to_png(part.rgb), media_type="image/png")


def _told_again(turn: Turn, mode: Mode, instructions: str) -> Sequence[ModelMessage]:
    """The model's answer and what is wrong with it, in the form its protocol wants."""
    from pydantic_ai.messages import ModelRequest, ModelResponse, TextPart, ToolReturnPart, UserPromptPart

    complaint = f"{turn.complaint}\nAnswer again, completely."
    calls = turn.reply.message.tool_calls if mode == "tool" else []
    if calls:
        returned = [ToolReturnPart(call.tool_name, complaint, call.tool_call_id) for call in calls]
        return turn.reply.message, ModelRequest(returned, instructions=instructions)
    said = ModelResponse([TextPart(turn.reply.text[:_LONGEST_SAID] or "(nothing)")])
    return said, ModelRequest([UserPromptPart(complaint)], instructions=instructions)


def to_reply(response: ModelResponse) -> Reply:
    """What the model said, and what that took."""
    from pydantic_ai.messages import TextPart

    calls = response.tool_calls
    text = "".join(part.content for part in response.parts if isinstance(part, TextPart))
    if calls:
        text = calls[0].args_as_json_str()
    measured = not response.usage.unmeasured_requests
    return Reply(
        text=text,
        tokens_in=response.usage.input_tokens if measured else None,
        tokens_out=response.usage.output_tokens if measured else None,
        cut_off=response.finish_reason == "length",
        message=response,
    )
