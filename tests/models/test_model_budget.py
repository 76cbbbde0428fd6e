"""What a run may spend is kept before each request: by calls, tokens, seconds and money."""

import threading
import time

import pytest
from asking import GOOD, KEY, QUICK, opened, question
from fake_server import fails, says, serving, stalls
from hypothesis import given
from hypothesis import strategies as st

from maniagent.errors import ModelFailure, UsageError
from maniagent.models.budget import Budget, Limits, Spent
from maniagent.models.names import parse_name
from maniagent.models.opening import open_model
from maniagent.models.prices import Price, cost_of

pytest.importorskip("pydantic_ai")

LOCAL = "openai-compatible:fake"


def test_a_repair_round_needs_a_call_that_is_left() -> None:
    budget = Budget(Limits(calls=1))
    with (
        serving(says("no")) as server,
        opened(f"{LOCAL}@{server.url}/v1", budget=budget) as (model, exchanges),
        pytest.raises(ModelFailure, match="budget of 1 calls for models is used up"),
    ):
        model.ask(question())
    assert len(server.asked) == 1
    assert exchanges[0].answers == ("no",), "what was answered before is told"


def test_retries_count_as_calls() -> None:
    budget = Budget(Limits(calls=2))
    with (
        serving(fails(500)) as server,
        opened(f"{LOCAL}@{server.url}/v1", budget=budget) as (model, _),
        pytest.raises(ModelFailure, match="budget"),
    ):
        model.ask(question())
    assert len(server.asked) == 2


def test_models_share_a_budget() -> None:
    budget = Budget(Limits(calls=3))
    with (
        serving(says(GOOD)) as server,
        opened(f"{LOCAL}@{server.url}/v1", budget=budget) as (vlm, _),
        opened(f"llamacpp:other@{server.url}/v1", budget=budget) as (llm, _),
    ):
        for model in (vlm, llm, vlm):
            model.ask(question())
        with pytest.raises(ModelFailure, match="budget of 3 calls"):
            llm.ask(question())
    assert budget.spent.calls == 3
    assert budget.spent.tokens == 360


def test_an_answer_gets_the_tokens_that_are_left() -> None:
    budget = Budget(Limits(tokens=1000))
    with (
        serving(says(GOOD, tokens=(300, 600))) as server,
        opened(f"{LOCAL}@{server.url}/v1", budget=budget) as (model, _),
    ):
        model.ask(question())
        assert server.asked[0].body["max_tokens"] < 1000 < QUICK.max_tokens
        with pytest.raises(ModelFailure, match="budget of 1000 tokens"):
            model.ask(question())
    assert len(server.asked) == 1


def test_a_server_that_counts_no_tokens_is_charged_the_most_it_could_have_used() -> None:
    budget = Budget(Limits(tokens=20_000))
    with serving(says(GOOD, tokens=None)) as server, opened(f"{LOCAL}@{server.url}/v1", budget=budget) as (model, _):
        model.ask(question())
    assert budget.spent.tokens > QUICK.max_tokens


def test_waiting_ends_with_the_seconds_of_the_run() -> None:
    budget = Budget(Limits(seconds=0.4))
    started = time.monotonic()
    with serving(stalls(2.0)) as server, opened(f"{LOCAL}@{server.url}/v1", budget=budget) as (model, _):
        for _ in range(2):
            with pytest.raises(ModelFailure):
                model.ask(question())
    assert time.monotonic() - started < 1.5
    assert len(server.asked) == 1


def test_no_wait_between_attempts_is_longer_than_the_seconds_that_are_left() -> None:
    started = time.monotonic()
    with (
        serving(fails(429, retry_after="2")) as server,
        opened(f"{LOCAL}@{server.url}/v1", budget=Budget(Limits(seconds=1.5))) as (model, _),
        pytest.raises(ModelFailure, match=r"budget of 1\.5 seconds"),
    ):
        model.ask(question())
    assert time.monotonic() - started < 1.5


def test_money_is_counted_with_the_users_prices() -> None:
    budget = Budget(Limits(money=0.001))
    prices = {LOCAL: Price(input=1.0, output=10.0)}
    with (
        serving(says(GOOD, tokens=(100, 50))) as server,
        opened(f"{LOCAL}@{server.url}/v1", budget=budget, prices=prices) as (model, exchanges),
    ):
        model.ask(question())
        assert exchanges[0].money == pytest.approx(0.0006)
        assert server.asked[0].body["max_tokens"] <= 100
        with pytest.raises(ModelFailure, match=r"budget of 0.001 US dollars"):
            model.ask(question())
    assert budget.spent.money == pytest.approx(0.0006)


def test_money_without_a_price_is_refused_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENAI_API_KEY", KEY)
    with pytest.raises(UsageError, match="No price is known for openai:nobodys-model"):
        open_model("openai:nobodys-model", budget=Budget(Limits(money=1.0)))


def test_published_prices_hold_for_the_provider_and_nobody_else() -> None:
    assert cost_of(parse_name("openai:gpt-4o"), {}) is not None
    assert cost_of(parse_name("openai:gpt-4o", "http://127.0.0.1:1/v1"), {}) is None
    assert cost_of(parse_name("vllm:gpt-4o"), {}) is None


def test_a_call_that_was_refused_costs_no_tokens() -> None:
    budget = Budget()
    with (
        serving(fails(401)) as server,
        opened(f"{LOCAL}@{server.url}/v1", budget=budget) as (model, _),
        pytest.raises(ModelFailure),
    ):
        model.ask(question())
    assert (budget.spent.calls, budget.spent.tokens) == (1, 0)


@given(
    limit=st.integers(0, 5000),
    requests=st.lists(st.tuples(st.integers(0, 800), st.integers(1, 2000), st.floats(0, 1)), max_size=20),
)
def test_no_sequence_of_requests_gets_over_the_limit(limit: int, requests: list[tuple[int, int, float]]) -> None:
    budget = Budget(Limits(tokens=limit))
    for tokens_in, max_tokens, used in requests:
        try:
            allowance = budget.reserve(tokens_in, max_tokens, 1.0, None)
        except ModelFailure:
            continue
        assert 1 <= allowance.max_tokens <= max_tokens
        budget.settle(allowance, Spent(1, tokens_in + int(used * allowance.max_tokens)))
        assert budget.spent.tokens <= limit


def test_threads_do_not_spend_the_same_call_twice() -> None:
    budget = Budget(Limits(calls=50))
    granted: list[int] = []

    def take() -> None:
        for _ in range(20):
            try:
                budget.reserve(1, 1, 1.0, None)
            except ModelFailure:
                return
            granted.append(1)

    threads = [threading.Thread(target=take) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(granted) == 50
