"""What an answer costs, where that is known: the user's own prices first, then the published ones.

Published prices are those of the `genai-prices` package as installed; maniagent holds no price of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from pydantic import BaseModel, ConfigDict, NonNegativeFloat

from .names import Address

Cost = Callable[[int, int], float]
"""(tokens in, tokens out) -> US dollars."""

_MILLION = 1_000_000


class Price(BaseModel):
    """US dollars for a million tokens."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    input: NonNegativeFloat
    output: NonNegativeFloat


def cost_of(address: Address, prices: Mapping[str, Price]) -> Cost | None:
    """How answers of the model are priced; None where nobody knows. `prices` go by "provider:model"."""
    if (price := prices.get(address.name)) is not None:
        return lambda tokens_in, tokens_out: (tokens_in * price.input + tokens_out * price.output) / _MILLION
    return None if address.elsewhere else _published(address)


def _published(address: Address) -> Cost | None:
    from genai_prices import Usage, calc_price

    def cost(tokens_in: int, tokens_out: int) -> float:
        usage = Usage(input_tokens=tokens_in, output_tokens=tokens_out)
        return float(calc_price(usage, address.model, provider_id=address.provider_name).total_price)

    try:
        cost(1, 1)
    except LookupError:
        return None
    return cost
