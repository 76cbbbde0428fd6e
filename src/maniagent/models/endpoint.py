"""One request to one model through its provider's own client library.

Retries, budgets and repair stand elsewhere: here a request is sent once, and whatever goes wrong becomes a `Fault`.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from .dialogue import Prompt, Reply, to_messages, to_parameters, to_reply
from .exchange import Mode
from .faults import Fault, one_line, to_fault
from .names import Address
from .transport import AnswerRefused, missing_extra, open_client

if TYPE_CHECKING:
    from pydantic_ai.models import Model

_UNREADABLE = (TypeError, ValueError, AttributeError, LookupError, RecursionError)
"""What client libraries raise on bodies that aren't what they trust a server to send."""
_SHORTEST_SECRET = 8
"""Characters; a shorter key is a placeholder for a local server, and may be a word of an answer."""


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
        from httpx2 import HTTPError
        from pydantic_ai.direct import model_request
        from pydantic_ai.exceptions import AgentRunError, UserError
        from pydantic_ai.settings import ModelSettings

        settings = ModelSettings(max_tokens=max_tokens, timeout=timeout, request_timeout=timeout, max_retries=0)
        if temperature is not None:
            settings["temperature"] = temperature
        own = self.address.provider.own
        told = tell_schema if tell_schema is not None else mode == "prompt" or own
        messages = to_messages(prompt, mode, tell_schema=told)
        parameters = to_parameters(prompt.form, mode, strict=None if own else True)
        fault: Fault | None = None
        try:
            response = await model_request(
                self._model, messages, model_settings=settings, model_request_parameters=parameters
            )
        except (AgentRunError, AnswerRefused) as error:
            fault = to_fault(error, timeout)
        except UserError as error:  # what the library knows the model can't do
            fault = Fault("final", str(error))
        except (HTTPError, *_UNREADABLE) as error:
            reason = f"the server's answer can't be read ({type(error).__name__}: {error})"
            fault = Fault("passing", reason, sent=True)
        if fault is not None:  # raised out here, so that no request, and so no key, hangs on it
            raise Fault(fault.kind, one_line(self._without_key(str(fault))), fault.retry_after, sent=fault.sent)
        if response.finish_reason == "content_filter":
            raise Fault("final", "the provider's content filter withheld the answer", sent=True)
        reply = to_reply(response)
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
