"""What can go wrong with a request, sorted by what to do about it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

from .transport import AnswerRefused

if TYPE_CHECKING:
    from pydantic_ai.exceptions import AgentRunError

FaultKind = Literal["passing", "refused", "key", "timeout", "final"]
"""passing: worth another try. refused: the server doesn't want this request; put another way it may.
key: the key is wrong. timeout: the time is up. final: nothing helps."""

_LONGEST_REASON = 300


class Fault(Exception):
    """A request that failed; the message says why."""

    def __init__(self, kind: FaultKind, reason: str, retry_after: float | None = None, *, sent: bool = False) -> None:
        super().__init__(reason)
        self.kind = kind
        self.retry_after = retry_after
        """Seconds the server asks to wait."""
        self.sent = sent
        """The model may have worked, and be paid for, although no answer came."""


def to_fault(error: AgentRunError | AnswerRefused, timeout: float) -> Fault:
    """The fault behind an error of the client library."""
    from pydantic_ai import exceptions as known

    reason = _reason(error)
    match error:
        case _ if refused := _caused_by(error, AnswerRefused):
            return Fault("final", str(refused), sent=True)
        case known.ModelRequestTimeout() | known.ModelTimeoutError(phase="read" | "write"):
            return Fault("timeout", f"no whole answer within {timeout:.3g} s", sent=True)
        case known.ModelAuthenticationError():
            return Fault("key", reason)
        case known.ModelQuotaExceededError() | known.ModelNotFoundError() | known.ModelContextWindowExceededError():
            return Fault("final", reason)
        case known.ModelRequestRejectedError():
            return Fault("refused", reason)
        case known.ModelAPIError():
            return Fault("passing", reason, error.retry_after)
        case known.ContentFilterError():
            return Fault("final", "the provider's content filter withheld the answer", sent=True)
        case known.UnexpectedModelBehavior():  # an HTTP answer that isn't the protocol's
            return Fault("passing", reason, sent=True)
        case _:
            return Fault("final", reason)


def _reason(error: AgentRunError | AnswerRefused) -> str:
    """The HTTP status where there is one, and the server's own words."""
    status = getattr(error, "status_code", None)
    words = _words(getattr(error, "body", None)) or ("" if status else _with_cause(error))
    return ": ".join(filter(None, (status and f"HTTP {status}", words)))


def one_line(words: str) -> str:
    """Words of others, short and without control characters."""
    told = " ".join("".join(c if c.isprintable() else " " for c in words).split())
    return told if len(told) <= _LONGEST_REASON else f"{told[: _LONGEST_REASON - 4]} ..."


def _with_cause(error: BaseException) -> str:
    """The error, and what the operating system said at the bottom of it."""
    below: list[BaseException] = [error]
    while (cause := below[-1].__cause__ or below[-1].__context__) is not None:
        below.append(cause)
    said = str(getattr(error, "message", error)).rstrip(".")
    return f"{said} ({below[-1]})" if isinstance(below[-1], OSError) else said


def _words(body: Any) -> str:
    """The message in the body of an error, wherever the protocol puts it."""
    match body:
        case {"error": dict() | str() as inner}:
            return _words(inner)
        case {"message": str(message)} | {"detail": str(message)}:
            return message
        case str():
            return body
        case _:
            return ""


def _caused_by(error: BaseException, kind: type[Exception]) -> Exception | None:
    cause: BaseException | None = error
    while cause is not None:
        if isinstance(cause, kind):
            return cause
        cause = cause.__cause__ or cause.__context__
    return None
