"""A model behind a real HTTP server that says what servers say on their bad days."""

import gzip
import json
import signal
import threading
import time
from collections.abc import Iterator
from typing import Any

import pytest
from asking import CUP, GOOD, KEY, QUICK, Spot, no_check, opened, question, refuse_cups
from fake_server import (
    Raw,
    Script,
    calls_tool,
    fails,
    floods,
    says,
    serving,
    stalls,
    trickles,
)

from maniagent.errors import FormatFailure, ModelFailure
from maniagent.models.question import Question

pytest.importorskip("pydantic_ai")


def local(url: str) -> str:
    return f"openai-compatible:fake@{url}/v1"


def ask(*scripts: Script, check: Any = no_check, **options: Any) -> tuple[Any, list[Any], Any]:
    """The answer or the failure, the requests, and the exchange."""
    with serving(*scripts) as server, opened(local(server.url), **options) as (model, exchanges):
        try:
            answer: Any = model.ask(question(check=check))
        except (ModelFailure, FormatFailure) as failure:
            answer = failure
    assert len(exchanges) == 1, "every question is one exchange"
    return answer, server.asked, exchanges[0]


# What is asked ---------------------------------------------------------------------------------------------------


def test_a_question_goes_out_with_its_picture_and_its_form() -> None:
    answer, asked, exchange = ask(says(GOOD))
    assert answer == CUP
    body = asked[0].body
    assert body["messages"][0]["content"].startswith("You look.")
    text, shown = body["messages"][1]["content"]
    assert text["text"] == "Where is it?"
    assert shown["image_url"]["url"].startswith("data:image/png;base64,")
    assert body["response_format"]["json_schema"]["schema"]["properties"]["name"]["maxLength"] == 40
    assert body["max_tokens"] == QUICK.max_tokens
    assert (exchange.answer, exchange.tokens_in, exchange.tokens_out) == (CUP.model_dump(), 100, 20)
    assert (exchange.attempts, exchange.repairs, exchange.failure, exchange.mode) == (1, 0, None, "schema")


def test_a_form_can_be_asked_for_by_a_tool_call() -> None:
    answer, asked, _ = ask(calls_tool('{"x": 9}'), calls_tool(GOOD), output="tool")
    assert answer == CUP
    assert asked[0].body["tool_choice"] == "required"
    assert asked[1].body["messages"][-1]["role"] == "tool"
    assert "less than or equal to 2" in asked[1].body["messages"][-1]["content"]


def test_a_form_can_be_asked_for_in_words() -> None:
    answer, asked, _ = ask(says(f"Sure!\n```json\n{GOOD}\n```"), output="prompt")
    assert answer == CUP
    assert "response_format" not in asked[0].body
    assert "tools" not in asked[0].body
    assert '"maxLength": 40' in asked[0].body["messages"][0]["content"]


def test_where_a_server_refuses_schemas_it_is_asked_in_words_from_then_on() -> None:
    with (
        serving(fails(400, "response_format is not supported"), says(GOOD)) as server,
        opened(local(server.url)) as (model, exchanges),
    ):
        assert model.ask(question()) == model.ask(question()) == CUP
    assert ["response_format" in asked.body for asked in server.asked] == [True, False, False]
    assert [exchange.attempts for exchange in exchanges] == [2, 1]


def test_a_refusal_that_has_another_reason_is_told_and_not_remembered() -> None:
    scripts = [fails(400, "no pictures, please"), fails(400, "not like that either"), says(GOOD)]
    with serving(*scripts) as server, opened(local(server.url)) as (model, _):
        with pytest.raises(ModelFailure, match="no pictures, please"):
            model.ask(question())
        assert model.ask(question()) == CUP
    assert "response_format" in server.asked[2].body


# Answers that don't fit ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "bad", ["Hello!", "[]", "", '{"name": 1}', GOOD.replace("0.25", "NaN"), GOOD.replace("0.25", "1e9")]
)
def test_an_answer_that_does_not_fit_goes_back_with_the_reason(bad: str) -> None:
    answer, asked, exchange = ask(says(bad), says(GOOD))
    assert answer == CUP
    first, said, complaint = asked[1].body["messages"][1:]
    assert first == asked[0].body["messages"][1]
    assert said == {"role": "assistant", "content": bad or "(nothing)"}
    assert exchange.complaints[0] in complaint["content"]
    assert (exchange.answers, exchange.repairs, exchange.tokens_in) == ((bad, GOOD), 1, 200)


def test_what_the_check_says_goes_back_too() -> None:
    bowl = GOOD.replace("cup", "bowl")
    answer, asked, _ = ask(says(GOOD), says(bowl), check=refuse_cups)
    assert answer == Spot(name="bowl", x=0.25)
    assert asked[1].body["messages"][-1]["content"].startswith("There is no cup.")


def test_repair_rounds_have_an_end() -> None:
    answer, asked, exchange = ask(says("no"))
    assert isinstance(answer, FormatFailure)
    assert "in 2 rounds: The answer holds no JSON object." in str(answer)
    assert len(asked) == 2
    assert (exchange.failure, exchange.error, exchange.answer) == ("format", str(answer), None)


def test_an_answer_that_was_cut_off_is_asked_for_in_brief() -> None:
    _, asked, _ = ask(says(GOOD[:12], finish="length"), says(GOOD))
    assert "cut off after 20 tokens: be brief" in asked[1].body["messages"][-1]["content"]


# Transport -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("status", [500, 502, 503, 529, 429, 408])
def test_what_passes_is_tried_again(status: int) -> None:
    answer, asked, exchange = ask(fails(status), fails(status), says(GOOD))
    assert answer == CUP
    assert len(asked) == exchange.attempts == 3


@pytest.mark.parametrize(
    "garbage",
    [
        Raw(body="<html>bad gateway</html>"),
        Raw(body="[]"),
        Raw(body='{"choices": []}'),
        Raw(body='{"choices": null}'),
        Raw(body='"hm"', headers={"Content-Type": "text/plain"}),
        Raw(status=204),
        Raw(body="[" * 100_000),
    ],
    ids=["html", "list", "no choices", "null", "text", "empty", "deep"],
)
def test_a_body_that_is_not_the_protocols_is_tried_again_and_told(garbage: Raw) -> None:
    assert ask(lambda _: garbage, says(GOOD))[0] == CUP
    answer, asked, _ = ask(lambda _: garbage)
    assert isinstance(answer, ModelFailure)
    assert len(asked) == 1 + QUICK.retries


def test_retry_after_is_obeyed() -> None:
    started = time.monotonic()
    answer, _, _ = ask(fails(429, retry_after="1"), says(GOOD))
    assert answer == CUP
    assert 1.0 <= time.monotonic() - started < 4.0


@pytest.mark.parametrize("asked_for", ["3600", "31"])
def test_a_server_that_asks_for_a_long_wait_is_given_up_at_once(asked_for: str) -> None:
    started = time.monotonic()
    answer, asked, _ = ask(fails(429, "slow down", retry_after=asked_for))
    assert isinstance(answer, ModelFailure)
    assert f"HTTP 429: slow down (it asks to wait {asked_for} s)" in str(answer)
    assert (len(asked), time.monotonic() - started < 2.0) == (1, True)


@pytest.mark.parametrize("script", [stalls(3.0), trickles(3.0)], ids=["stalled", "endless"])
def test_no_answer_takes_longer_than_it_may(script: Script) -> None:
    started = time.monotonic()
    answer, asked, _ = ask(script, patience=QUICK.model_copy(update={"timeout": 0.5}))
    assert isinstance(answer, ModelFailure)
    assert "no whole answer within" in str(answer)
    assert (len(asked), time.monotonic() - started < 2.0) == (1, True)


def test_retries_end_with_the_time_for_the_answer() -> None:
    patience = QUICK.model_copy(update={"timeout": 0.5, "first_wait": 0.2, "retries": 50})
    started = time.monotonic()
    answer, _, _ = ask(fails(500), patience=patience)
    assert isinstance(answer, ModelFailure)
    assert time.monotonic() - started < 2.0


def test_an_answer_without_an_end_does_not_fill_the_memory() -> None:
    answer, asked, _ = ask(floods(40))
    assert isinstance(answer, ModelFailure)
    assert "more than 8 MiB" in str(answer)
    assert len(asked) == 1


def test_what_a_server_compressed_is_not_unpacked() -> None:
    bomb = gzip.compress(b" " * 2**24)  # a hundredth of what unpacks to more than there is memory
    answer, asked, _ = ask(lambda _: Raw(headers={"Content-Encoding": "gzip"}, write=lambda to: to.write(bomb)))
    assert isinstance(answer, ModelFailure)
    assert "the answer is compressed (gzip), which was not asked for" in str(answer)
    assert [one.headers["accept-encoding"] for one in asked] == ["identity"]


def test_a_redirect_is_not_followed() -> None:
    with serving(says(GOOD)) as elsewhere:
        answer, _, _ = ask(fails(307, location=f"{elsewhere.url}/v1/chat/completions"))
    assert isinstance(answer, ModelFailure)
    assert "307" in str(answer)
    assert not elsewhere.asked


def test_a_refused_connection_is_told_with_the_address() -> None:
    with (
        opened("openai-compatible:fake@http://127.0.0.1:9/v1") as (model, exchanges),
        pytest.raises(ModelFailure, match=r"at http://127.0.0.1:9/v1 gives no answer: .*Connect call failed"),
    ):
        model.ask(question())
    assert exchanges[0].attempts == 1 + QUICK.retries


def test_a_content_filter_is_told() -> None:
    assert "content filter" in str(ask(says("", finish="content_filter"))[0])


# Keys ------------------------------------------------------------------------------------------------------------


def test_a_wrong_key_is_not_tried_twice_and_never_shown(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level("DEBUG")
    monkeypatch.setenv("MANIAGENT_API_KEY", KEY)
    with serving(fails(401, f"{KEY} is not a key")) as server, opened(local(server.url)) as (model, exchanges):
        with pytest.raises(ModelFailure, match=r"refuses the key in MANIAGENT_API_KEY: HTTP 401: \[key\]") as told:
            model.ask(question())
        shown = f"{model!r} {model} {told.value!r} {exchanges!r} {caplog.text}"
    assert [asked.headers["authorization"] for asked in server.asked] == [f"Bearer {KEY}"]
    assert KEY not in shown
    assert not told.value.__cause__
    assert not told.value.__context__


def test_a_key_that_a_server_says_is_not_recorded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MANIAGENT_API_KEY", KEY)
    answer, _, exchange = ask(says(GOOD.replace("cup", KEY)))
    assert answer.name == "[key]"
    assert KEY not in repr(exchange)


def test_no_part_of_a_key_is_left_where_a_long_message_is_cut(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MANIAGENT_API_KEY", KEY)
    for length in range(280, 300):
        answer, _, _ = ask(fails(401, "x" * length + KEY))
        assert KEY[:3] not in str(answer)


def test_no_other_key_goes_to_a_server_of_ones_own(monkeypatch: pytest.MonkeyPatch) -> None:
    for variable in ("OPENAI_API_KEY", "ANTHROPIC_API_KEY", "XAI_API_KEY"):
        monkeypatch.setenv(variable, KEY)
    _, asked, _ = ask(says(GOOD))
    assert KEY not in json.dumps(asked[0].headers)


# Around ----------------------------------------------------------------------------------------------------------


def test_checks_run_on_the_thread_that_asks() -> None:
    threads = []
    ask(says(GOOD), check=lambda _: threads.append(threading.current_thread()))
    assert threads == [threading.current_thread()]


@pytest.fixture
def interruptible() -> Iterator[None]:
    """What a shell puts into the background ignores Ctrl-C, tests too."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("interruptible")
def test_ctrl_c_ends_the_wait_for_an_answer_and_is_told() -> None:
    main = threading.main_thread().ident
    assert main is not None
    started = time.monotonic()
    press = threading.Timer(0.3, signal.pthread_kill, (main, signal.SIGINT))
    with serving(stalls(3.0)) as server, opened(local(server.url)) as (model, exchanges):
        press.start()
        with pytest.raises(KeyboardInterrupt):
            model.ask(question())
    assert time.monotonic() - started < 2.0
    assert (exchanges[0].failure, exchanges[0].attempts) == ("interrupted", 1)


def test_one_model_may_be_asked_from_several_threads() -> None:
    answers: list[Spot] = []
    with serving(says(GOOD)) as server, opened(local(server.url)) as (model, exchanges):
        threads = [threading.Thread(target=lambda: answers.append(model.ask(question()))) for _ in range(6)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    assert answers == [CUP] * 6
    assert len(exchanges) == 6


def test_a_question_without_pictures_needs_none() -> None:
    with serving(says(GOOD)) as server, opened(local(server.url)) as (model, _):
        assert model.ask(Question("reasoning", "Think.", ("Where?",), Spot)) == CUP
