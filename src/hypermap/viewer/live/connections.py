"""Connections to the page's server: idle ones do not block others."""

from __future__ import annotations

import asyncio
from collections.abc import Iterable
from typing import Any

from uvicorn.protocols.http.h11_impl import H11Protocol

MOST_CONNECTIONS = 128
"""A browser opens six for all its windows; a program may have some hundred files open."""
HEADER_TIME = 10.0
"""Seconds in which a request must have said what it asks for."""


class Connection(H11Protocol):
    """A connection that ends where no request comes in time.

    Where there are too many, the one that has waited longest without a request makes room.

    Attributes:
        waiting: ends the connection in time, while there is no request.
    """

    waiting: asyncio.TimerHandle | None = None

    def connection_made(self, transport: Any) -> None:
        """Wait for a request."""
        super().connection_made(transport)
        self._wait()
        if len(self.connections) > MOST_CONNECTIONS:
            _end_idlest(one for one in self.connections if isinstance(one, Connection))

    def data_received(self, data: bytes) -> None:
        """Stop waiting when a request is there."""
        super().data_received(data)
        if self.cycle is not None and not self.cycle.response_complete:
            self.stop_waiting()

    def on_response_complete(self) -> None:
        """Wait for the next request."""
        self._wait()
        super().on_response_complete()
        if self.cycle is not None and not self.cycle.response_complete:  # it was there already
            self.stop_waiting()

    def connection_lost(self, exc: Exception | None) -> None:
        """Stop waiting."""
        self.stop_waiting()
        super().connection_lost(exc)

    def _wait(self) -> None:
        self.stop_waiting()
        self.waiting = self.loop.call_later(HEADER_TIME, self.transport.abort)

    def stop_waiting(self) -> None:
        """Stop waiting for a request."""
        if self.waiting is not None:
            self.waiting.cancel()
            self.waiting = None


def _end_idlest(connections: Iterable[Connection]) -> None:
    """End the connection that has waited longest without a request."""
    ends = [(one.waiting.when(), one) for one in connections if one.waiting is not None]
    if ends:
        _, idlest = min(ends, key=lambda end: end[0])
        idlest.stop_waiting()  # nor is it chosen again before it has ended
        idlest.transport.abort()
