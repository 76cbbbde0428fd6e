"""From names and settings to models."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from ..errors import UsageError
from .budget import Budget
from .chat import LiveModel
from .endpoint import Endpoint
from .exchange import OnExchange, Output
from .names import Address, parse_name
from .patience import Patience
from .prices import Cost, Price, cost_of
from .settings import ModelSettings


def open_model(
    name: str,
    base_url: str | None = None,
    *,
    output: Output = "auto",
    patience: Patience | None = None,
    budget: Budget | None = None,
    prices: Mapping[str, Price] = MappingProxyType({}),
    temperature: float | None = None,
    on_exchange: OnExchange | None = None,
) -> LiveModel:
    """The chat model `name`: "provider:model", or "provider:model@http://host:port/v1".

    Parameters
    ----------
    name
        Providers are those of `names.PROVIDERS`; keys come from the environment only.
    base_url
        Where the model is served, if the name doesn't say and it isn't the provider's usual address.
    output
        How the form of answers is enforced; see `Output`.
    patience
        Time-outs, retries, repair rounds.
    budget
        What may be spent; shared by the models that it is given to.
    prices
        US dollars for a million tokens by "provider:model", where the published prices lack a model or don't hold.
    temperature
        Of the sampling; None leaves it to the provider.
    on_exchange
        Is told of every exchange.

    Raises
    ------
    UsageError
        Where the name or a setting doesn't make sense.
    SetupError
        Where the extra `models` or a key is missing.

    """
    address = parse_name(name, base_url)
    cost = _cost(address, prices, budget)
    endpoint = Endpoint(address)
    if output == "schema" and not endpoint.schemas:
        raise UsageError(f"{address.name} doesn't enforce JSON schemas; use output 'auto', 'tool' or 'prompt'.")
    return LiveModel(
        endpoint,
        output=output,
        patience=patience,
        budget=budget,
        cost=cost,
        temperature=temperature,
        on_exchange=on_exchange,
    )


def _cost(address: Address, prices: Mapping[str, Price], budget: Budget | None) -> Cost | None:
    cost = cost_of(address, prices)
    if cost is None and budget is not None and budget.limits.money is not None:
        raise UsageError(
            f"No price is known for {address.name}, so a budget of money can't be kept. Give its price per million "
            f'tokens in maniagent.toml: [models.prices."{address.name}"] with input and output.'
        )
    return cost


@dataclass(frozen=True)
class Models:
    """The models of a run, on one budget."""

    vlm: LiveModel
    """Is shown pictures."""
    llm: LiveModel
    """Reads and writes text; may be the same model."""
    budget: Budget

    def close(self) -> None:
        """Close the connections."""
        self.vlm.close()
        if self.llm is not self.vlm:
            self.llm.close()


def open_models(settings: ModelSettings, on_exchange: OnExchange | None = None) -> Models:
    """The models that the settings name; the one that isn't named is the other.

    Raises UsageError where none is named, and what `open_model` raises.
    """
    vlm, llm = settings.vlm or settings.llm, settings.llm or settings.vlm
    if vlm is None or llm is None:
        raise UsageError("No model is named: give --vlm PROVIDER:MODEL, or set MANIAGENT_VLM (docs/models.md).")
    budget = Budget(settings.budget)

    def opened(name: str) -> LiveModel:
        return open_model(
            name,
            settings.base_url_for(name),
            output=settings.output,
            patience=settings.patience,
            budget=budget,
            prices=settings.prices,
            temperature=settings.temperature,
            on_exchange=on_exchange,
        )

    first = opened(vlm)
    return Models(first, first if llm == vlm else opened(llm), budget)
