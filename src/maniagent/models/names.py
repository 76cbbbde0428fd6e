"""How a model is named: PROVIDER:MODEL, or PROVIDER:MODEL@URL where it is served somewhere else."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal
from urllib.parse import urlsplit

from ..errors import SetupError, UnknownNameError, UsageError


@dataclass(frozen=True)
class Provider:
    """Who serves a model, and how it is talked to."""

    protocol: Literal["openai", "anthropic", "google", "compatible"]
    """"compatible" is the OpenAI chat protocol as others speak it."""
    keys: tuple[str, ...]
    """Environment variables that may hold the key; the first that is set counts."""
    base_url: str | None = None
    """Where it is served when nothing else is said; None leaves that to the provider's own library."""
    own: bool = False
    """It is the user's own server: it needs no key, and an address that is set for all models is meant for it."""


PROVIDERS: Mapping[str, Provider] = MappingProxyType(
    {
        "openai": Provider("openai", ("OPENAI_API_KEY",)),
        "anthropic": Provider("anthropic", ("ANTHROPIC_API_KEY",)),
        "google": Provider("google", ("GOOGLE_API_KEY", "GEMINI_API_KEY")),
        "xai": Provider("compatible", ("XAI_API_KEY",), "https://api.x.ai/v1"),
        "ollama": Provider("compatible", ("OLLAMA_API_KEY",), "http://127.0.0.1:11434/v1", own=True),
        "vllm": Provider("compatible", ("VLLM_API_KEY",), "http://127.0.0.1:8000/v1", own=True),
        "llamacpp": Provider("compatible", ("LLAMA_API_KEY",), "http://127.0.0.1:8080/v1", own=True),
        "openai-compatible": Provider("compatible", ("MANIAGENT_API_KEY",), own=True),
    }
)


@dataclass(frozen=True)
class Address:
    """A model's name, taken apart."""

    provider_name: str
    model: str
    base_url: str | None
    """None where the provider's library knows it."""

    @property
    def provider(self) -> Provider:
        """The provider's entry."""
        return PROVIDERS[self.provider_name]

    @property
    def elsewhere(self) -> bool:
        """It isn't served by the provider itself, so that the provider's published prices don't hold."""
        return self.provider.own or self.base_url != self.provider.base_url

    @property
    def name(self) -> str:
        """As the user named it, without the address."""
        return f"{self.provider_name}:{self.model}"

    def key(self) -> str | None:
        """The key from the environment, or None for an own server without one.

        Raises SetupError where the provider wants a key and none is set.
        """
        for variable in self.provider.keys:
            if value := os.environ.get(variable, "").strip():
                return value
        if self.provider.own:
            return None
        raise SetupError(f"{self.name} needs a key: export {self.provider.keys[0]}=...")


def parse_name(name: str, base_url: str | None = None) -> Address:
    """Take "provider:model" or "provider:model@http://host:port/v1" apart.

    `base_url` is where the model is served if `name` doesn't say. Raises UsageError, naming what is right.
    """
    plain, at, url = name.partition("@http")
    provider_name, colon, model = plain.partition(":")
    if not (provider_name and colon and model):
        raise UsageError(f"A model is named PROVIDER:MODEL, not {plain!r}. Providers: {', '.join(PROVIDERS)}.")
    if provider_name not in PROVIDERS:
        raise UnknownNameError("model provider", provider_name, PROVIDERS)
    provider = PROVIDERS[provider_name]
    address = f"http{url}" if at else base_url or provider.base_url
    if address is None and provider.own:
        raise UsageError(f"{plain} needs an address: {plain}@http://HOST:PORT/v1, or MANIAGENT_BASE_URL.")
    return Address(provider_name, model, address and _checked(address))


def _checked(url: str) -> str:
    parts = urlsplit(url)
    if parts.username or parts.password or parts.query or parts.fragment:
        raise UsageError("A model's address holds no user, password or query; keys come from the environment.")
    if parts.scheme not in ("http", "https") or not parts.hostname:
        raise UsageError(f"{url!r} is no address of a server. Name one like http://127.0.0.1:8080/v1.")
    return url.rstrip("/")
