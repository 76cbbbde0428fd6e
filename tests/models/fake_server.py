"""A model server for tests: speaks real HTTP, answers as it is told, and keeps what it was asked."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

Body = dict[str, Any]


@dataclass
class Asked:
    """One request."""

    path: str
    headers: dict[str, str]
    body: Body

    @property
    def text(self) -> str:
        return json.dumps(self.body)


@dataclass(frozen=True)
class Raw:
    """An answer of any kind; `body` may be a function that writes to the socket itself."""

    status: int = 200
    body: str = ""
    headers: dict[str, str] = field(default_factory=dict)
    write: Callable[[Any], None] | None = None


Script = Callable[[Asked], Raw]


@dataclass
class FakeServer:
    """Answers request number n with script n; the last one goes on for ever."""

    scripts: list[Script]
    asked: list[Asked] = field(default_factory=list)
    url: str = ""

    def respond(self, asked: Asked) -> Raw:
        self.asked.append(asked)
        return self.scripts[min(len(self.asked), len(self.scripts)) - 1](asked)


@contextmanager
def serving(*scripts: Script) -> Iterator[FakeServer]:
    fake = FakeServer(list(scripts))

    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def do_POST(self) -> None:
            length = int(self.headers.get("Content-Length", 0))
            body = json.loads(self.rfile.read(length) or b"{}")
            raw = fake.respond(Asked(self.path, {k.lower(): v for k, v in self.headers.items()}, body))
            try:
                self._answer(raw)
            except (BrokenPipeError, ConnectionResetError):
                self.close_connection = True  # the client gave up, as it was meant to

        def _answer(self, raw: Raw) -> None:
            self.send_response(raw.status)
            data = raw.body.encode()
            headers = {"Content-Type": "application/json"} | raw.headers
            if raw.write is None:
                headers["Content-Length"] = str(len(data))
            for name, value in headers.items():
                self.send_header(name, value)
            self.end_headers()
            if raw.write is None:
                self.wfile.write(data)
            else:
                self.close_connection = True
                raw.write(self.wfile)

        def log_message(self, *_: Any) -> None:
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    server.daemon_threads = True
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02}, daemon=True)
    thread.start()
    fake.url = f"http://127.0.0.1:{server.server_port}"
    try:
        yield fake
    finally:
        server.shutdown()
        server.server_close()


# What a server may say -------------------------------------------------------------------------------------------


def says(text: str | None, finish: str = "stop", tokens: tuple[int, int] | None = (100, 20)) -> Script:
    """An OpenAI chat completion whose message is `text`."""
    body: Body = {
        "id": "c1",
        "object": "chat.completion",
        "created": 1,
        "model": "fake",
        "choices": [{"index": 0, "finish_reason": finish, "message": {"role": "assistant", "content": text}}],
    }
    if tokens is not None:
        body["usage"] = {"prompt_tokens": tokens[0], "completion_tokens": tokens[1], "total_tokens": sum(tokens)}
    return lambda _: Raw(body=json.dumps(body))


def calls_tool(arguments: str) -> Script:
    """An OpenAI chat completion that calls the first tool it was offered."""

    def script(asked: Asked) -> Raw:
        function = {"name": asked.body["tools"][0]["function"]["name"], "arguments": arguments}
        message = {
            "role": "assistant",
            "content": None,
            "tool_calls": [{"id": "t1", "type": "function", "function": function}],
        }
        raw = says(None)(asked)
        body = json.loads(raw.body)
        body["choices"][0] |= {"message": message, "finish_reason": "tool_calls"}
        return Raw(body=json.dumps(body))

    return script


def fails(status: int, message: str = "no", **headers: str) -> Script:
    """An HTTP error."""
    named = {name.replace("_", "-"): value for name, value in headers.items()}
    return lambda _: Raw(status, json.dumps({"error": {"message": message, "type": "x", "code": None}}), named)


def stalls(seconds: float) -> Script:
    """Takes the request and says nothing."""

    def script(_: Asked) -> Raw:
        time.sleep(seconds)
        return Raw(body="{}")

    return script


def trickles(seconds: float) -> Script:
    """Text that goes on and on, a little at a time, so that no single read ever waits for long."""

    def write(socket: Any) -> None:
        end = time.monotonic() + seconds
        socket.write(b'{"choices": [{"message": {"content": "')
        while time.monotonic() < end:
            socket.write(b"and ")
            socket.flush()
            time.sleep(0.01)

    return lambda _: Raw(write=write)


def floods(mebibytes: int) -> Script:
    """Text without an end, as fast as it is taken."""

    def write(socket: Any) -> None:
        for _ in range(mebibytes):
            socket.write(b" " * 2**20)

    return lambda _: Raw(write=write)


def anthropic_says(text: str) -> Script:
    """A message of the Anthropic protocol."""
    body: Body = {
        "id": "m",
        "type": "message",
        "role": "assistant",
        "model": "fake",
        "stop_reason": "end_turn",
        "content": [{"type": "text", "text": text}],
        "usage": {"input_tokens": 100, "output_tokens": 20},
    }
    return lambda _: Raw(body=json.dumps(body))


def anthropic_calls_tool(arguments: Body) -> Script:
    """A message of the Anthropic protocol that calls the tool `answer`."""
    body = json.loads(anthropic_says("")(Asked("", {}, {})).body)
    body["content"] = [{"type": "tool_use", "id": "t1", "name": "answer", "input": arguments}]
    return lambda _: Raw(body=json.dumps(body | {"stop_reason": "tool_use"}))


def google_says(text: str) -> Script:
    """A Gemini answer."""
    candidate = {"content": {"role": "model", "parts": [{"text": text}]}, "finishReason": "STOP", "index": 0}
    usage = {"promptTokenCount": 100, "candidatesTokenCount": 20, "totalTokenCount": 120}
    body = {"candidates": [candidate], "usageMetadata": usage, "modelVersion": "fake"}
    return lambda _: Raw(body=json.dumps(body))
