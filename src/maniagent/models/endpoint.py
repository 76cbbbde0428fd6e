"""One request to one model through its provider's own client library; the only module that knows pydantic-ai.

Retries, budgets and repair stand elsewhere: here a request is sent once, and whatever goes wrong becomes a `Fault`.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from pydantic import BaseModel

from .exchange import Mode
from .faults import Fault, to_fault
from .names import Address
from .pictures import to_png
from .question import Picture
from .transport import TooLong, missing_extra, open_client

if TYPE_CHECKING:
    from pydantic_ai.messages import ModelMessage, ModelResponse, UserContent
    from pydantic_ai.models import Model, ModelRequestParameters

_ANSWER_TOOL = "answer"
_LONGEST_SAID = 20_000
"""Characters of an unfit answer that go back with the complaint."""
_SHORTEST_SECRET = 8
"""Characters; a shorter key is a placeholder for a local server, and may be a word of an answer."""
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


class Endpoint:
    """A model behind its client library."""

    def __init__(self, address: Address) -> None:
        """Connects to nothing yet. Raises SetupError where the library or the key is missing."""
        self.address = address
        self._secret = address.key()
        self._client = open_client()
        self._model = _open(address, self._secret, self._client)

    @property
    def schemas(self) -> bool:
        """Whether the provider is said to enforce JSON schemas."""
        return bool(self._model.profile.get("supports_json_schema_output", False))

    async def send(
        self,
        prompt: Prompt,
        mode: Mode,
        *,
        max_tokens: int,
        timeout: float,
        temperature: float | None = None,
        tell_schema: bool | None = None,
    ) -> Reply:
        """One request and its whole answer within `timeout` seconds; raises Fault.

        `tell_schema` also puts the schema into the instructions; None does so where the model wouldn't see it else.
        """
        from pydantic_ai.direct import model_request
        from pydantic_ai.exceptions import AgentRunError
        from pydantic_ai.settings import ModelSettings

        settings = ModelSettings(max_tokens=max_tokens, timeout=timeout, request_timeout=timeout, max_retries=0)
        if temperature is not None:
            settings["temperature"] = temperature
        told = tell_schema if tell_schema is not None else mode == "prompt" or self.address.provider.own
        messages, parameters = _messages(prompt, mode, tell_schema=told), _parameters(prompt.form, mode)
        fault: Fault | None = None
        try:
            response = await model_request(
                self._model, messages, model_settings=settings, model_request_parameters=parameters
            )
        except (AgentRunError, TooLong) as error:
            fault = to_fault(error, timeout)
        if fault is not None:  # raised out here, so that no request, and so no key, hangs on it
            raise Fault(fault.kind, self._without_key(str(fault)), fault.retry_after, sent=fault.sent)
        reply = _reply(response)
        return replace(reply, text=self._without_key(reply.text))

    def _without_key(self, text: str) -> str:
        """A server may say the key it was sent; what it says is shown and recorded."""
        if self._secret is None or len(self._secret) < _SHORTEST_SECRET:
            return text
        return text.replace(self._secret, "[key]")

    async def close(self) -> None:
        """Close the connections."""
        await self._client.aclose()


def _open(address: Address, secret: str | None, client: Any) -> Model:
    try:
        match address.provider.protocol:
            case "anthropic":
                from pydantic_ai.models.anthropic import AnthropicModel
                from pydantic_ai.providers.anthropic import AnthropicProvider

                provider = AnthropicProvider(api_key=secret, base_url=address.base_url, http_client=client)
                return AnthropicModel(address.model, provider=provider)
            case "google":
                from pydantic_ai.models.google import GoogleModel
                from pydantic_ai.providers.google import GoogleProvider

                google = GoogleProvider(api_key=secret, base_url=address.base_url, http_client=client)
                return GoogleModel(address.model, provider=google)
            case _:
                return _open_openai(address, secret, client)
    except ImportError as error:
        raise missing_extra() from error


def _open_openai(address: Address, secret: str | None, client: Any) -> Model:
    from pydantic_ai.models.openai import OpenAIChatModel
    from pydantic_ai.profiles.openai import OpenAIModelProfile
    from pydantic_ai.providers.openai import OpenAIProvider
    from pydantic_ai.providers.openai_compatible import OpenAICompatibleProvider

    if address.provider.protocol == "openai":
        provider = OpenAIProvider(base_url=address.base_url, api_key=secret, http_client=client)
        return OpenAIChatModel(address.model, provider=provider)
    if address.base_url is None:
        raise AssertionError("parse_name gives every compatible server an address")
    profile = OpenAIModelProfile(
        supports_json_schema_output=True,
        # what servers of one's own understand, old and new
        openai_chat_supports_max_completion_tokens=not address.provider.own,
    )
    compatible = OpenAICompatibleProvider(
        address.provider_name, base_url=address.base_url, api_key=secret, http_client=client, profile=profile
    )
    return OpenAIChatModel(address.model, provider=compatible)


def _parameters(form: type[BaseModel], mode: Mode) -> ModelRequestParameters:
    from pydantic_ai.models import ModelRequestParameters
    from pydantic_ai.output import OutputObjectDefinition
    from pydantic_ai.tools import ToolDefinition

    schema = form.model_json_schema()
    match mode:
        case "schema":
            described = OutputObjectDefinition(json_schema=schema, name=form.__name__)
            return ModelRequestParameters(output_mode="native", output_object=described, prompted_output_template=False)
        case "tool":
            tool = ToolDefinition(
                name=_ANSWER_TOOL,
                description="Gives your answer.",
                parameters_json_schema=schema,
                kind="output",
            )
            return ModelRequestParameters(output_mode="tool", output_tools=[tool], allow_text_output=False)
        case "prompt":
            return ModelRequestParameters(output_mode="text")


def _messages(prompt: Prompt, mode: Mode, *, tell_schema: bool) -> list[ModelMessage]:
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


def _reply(response: ModelResponse) -> Reply:
    from pydantic_ai.messages import TextPart

    calls = response.tool_calls
    text = "".join(part.content for part in response.parts if isinstance(part, TextPart))
    if calls:
        text = calls[0].args_as_json_str()
    measured = not response.usage.unmeasured_requests
    if response.finish_reason == "content_filter":
        raise Fault("final", "the provider's content filter withheld the answer")
    return Reply(
        text=text,
        tokens_in=response.usage.input_tokens if measured else None,
        tokens_out=response.usage.output_tokens if measured else None,
        cut_off=response.finish_reason == "length",
        message=response,
    )
