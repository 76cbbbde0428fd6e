"""The HTTP client under all providers: it reads answers of a bounded length only."""

from __future__ import annotations

from collections.abc import AsyncIterator
from typing import TYPE_CHECKING

from ..errors import SetupError

if TYPE_CHECKING:
    import httpx2

MOST_BYTES = 8 * 2**20
"""Of one answer; text that goes on without an end must not fill the memory until the time is up."""
_PLAIN = "identity"
"""The one content encoding that is asked for and read: what is packed may unpack to a thousand times its length."""
_CONNECT = 10.0
"""Seconds in which a server must take the connection."""


class AnswerRefused(Exception):
    """A server's answer that isn't read to its end: it has more than MOST_BYTES, or it is compressed."""


def missing_extra() -> SetupError:
    """What is missing where the client libraries are."""
    return SetupError("Language models need the extra `models`: pip install 'maniagent[models]'")


def open_client() -> httpx2.AsyncClient:
    """A client that raises AnswerRefused where an answer doesn't end, or is compressed.

    A request's own time-outs are set by who sends it. Raises SetupError where the extra is missing.
    """
    try:
        import httpx2
    except ImportError as error:
        raise missing_extra() from error

    class Bounded(httpx2.AsyncByteStream):
        """A stream of bytes that ends with AnswerRefused."""

        def __init__(self, stream: httpx2.AsyncByteStream) -> None:
            self._stream = stream

        async def __aiter__(self) -> AsyncIterator[bytes]:
            length = 0
            async for chunk in self._stream:
                length += len(chunk)
                if length > MOST_BYTES:
                    raise AnswerRefused(f"the answer has more than {MOST_BYTES // 2**20} MiB")
                yield chunk

        async def aclose(self) -> None:
            await self._stream.aclose()

    async def bound(response: httpx2.Response) -> None:
        encoding = response.headers.get("content-encoding", _PLAIN)
        if encoding.lower() != _PLAIN:
            raise AnswerRefused(f"the answer is compressed ({encoding[:20]}), which was not asked for")
        if isinstance(response.stream, httpx2.AsyncByteStream):
            response.stream = Bounded(response.stream)

    timeout = httpx2.Timeout(None, connect=_CONNECT)
    headers = {"Accept-Encoding": _PLAIN}
    return httpx2.AsyncClient(headers=headers, timeout=timeout, event_hooks={"response": [bound]})
