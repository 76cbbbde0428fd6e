"""Ray: the machines of a cluster (extra `ray`)."""

from __future__ import annotations

from types import TracebackType
from typing import Any, Self

from .errors import ManiAgentError, SetupError


class Cluster:
    """A connection to a Ray cluster; a context manager."""

    def __init__(self, address: str) -> None:
        """Connect; `address` is as Ray's: "auto", "ray://host:port", "host:port", or "local" for a cluster of its own.

        Raises SetupError where Ray isn't installed or doesn't answer.
        """
        try:
            import ray
        except ImportError:
            raise SetupError("Working on a cluster takes Ray: pip install 'maniagent[ray]'") from None
        self.ray: Any = ray
        self._connected = not ray.is_initialized()  # else the caller's connection is used, and left alone
        try:
            ray.init(address=address, log_to_driver=False, logging_level="error", ignore_reinit_error=True)
        except (ConnectionError, ValueError, RuntimeError) as error:
            raise SetupError(f"No Ray cluster answers at {address!r}: {error}") from error

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """End the connection, if it is ours."""
        if self._connected:
            self.ray.shutdown()

    def cause(self, error: Exception) -> ManiAgentError:
        """What to raise for a RayTaskError: what our code raised on purpose, else SetupError."""
        inner = getattr(error, "cause", None)
        if isinstance(inner, ManiAgentError):
            return inner
        return SetupError(f"A node can't do its work (is the same maniagent installed there?): {error}")
