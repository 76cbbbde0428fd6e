"""Which models, where, and within what bounds: from maniagent.toml, the environment and flags, the last strongest."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, ValidationError
from pydantic_settings import (
    BaseSettings,
    PydanticBaseSettingsSource,
    SettingsConfigDict,
    SettingsError,
    TomlConfigSettingsSource,
)

from ..errors import UsageError
from .budget import Limits
from .exchange import Output
from .names import PROVIDERS
from .patience import Patience
from .prices import Price

CONFIG = Path("maniagent.toml")


class ModelSettings(BaseSettings):
    """The table [models] of maniagent.toml; each field also as MANIAGENT_FIELD, nested ones as MANIAGENT_A__B.

    Keys don't belong here: they are read from the environment alone, under the names that the providers use.
    """

    model_config = SettingsConfigDict(
        frozen=True,
        extra="forbid",
        env_prefix="MANIAGENT_",
        env_nested_delimiter="__",
        env_ignore_empty=True,
        toml_file=CONFIG,
        toml_table_header=("models",),
    )

    vlm: str | None = None
    """The model that is shown pictures, "provider:model"."""
    llm: str | None = None
    """The model that reads and writes text only; the vlm where it isn't set."""
    base_url: str | None = None
    """Address of models of one's own (ollama, vllm, llamacpp, openai-compatible) that name none; never of others,
    so that no key for a provider goes there."""
    output: Output = "auto"
    temperature: Annotated[float, Field(ge=0.0, le=2.0)] | None = None
    patience: Patience = Patience()
    budget: Limits = Limits()
    prices: dict[str, Price] = Field(default_factory=dict)

    def base_url_for(self, name: str) -> str | None:
        """`base_url` where it is meant for the model "provider:model", else None."""
        provider = PROVIDERS.get(name.partition(":")[0])
        return self.base_url if provider is not None and provider.own else None

    @classmethod
    def settings_customise_sources(
        cls,
        settings_cls: type[BaseSettings],
        init_settings: PydanticBaseSettingsSource,
        env_settings: PydanticBaseSettingsSource,
        dotenv_settings: PydanticBaseSettingsSource,
        file_secret_settings: PydanticBaseSettingsSource,
    ) -> tuple[PydanticBaseSettingsSource, ...]:
        """Flags before the environment before the file."""
        return init_settings, env_settings, TomlConfigSettingsSource(settings_cls)


def load_settings(**flags: Any) -> ModelSettings:
    """The settings in force in this folder; flags that are None don't count.

    Raises UsageError, naming the field, where one doesn't make sense.
    """
    try:
        return ModelSettings(**{name: value for name, value in flags.items() if value is not None})
    except tomllib.TOMLDecodeError as error:
        raise UsageError(f"{CONFIG} is no TOML file: {error}.") from error
    except ValidationError as error:
        fault = error.errors(include_url=False, include_input=False)[0]
        raise UsageError(f"Settings of models, {'.'.join(map(str, fault['loc']))}: {fault['msg']}.") from error
    except SettingsError as error:
        raise UsageError(f"Settings of models: {error}.") from error
