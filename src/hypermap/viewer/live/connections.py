"""Connections to the page's server: idle ones do not block others."""

from __future__ import annotations

import asyncio
from collections.abc import Iterable
from typing import Any

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol

MOST_CONNECTIONS = 128
"""A browser opens six for all its windows; a program may have some hundred files open."""
HEADER_TIME = 10.0
"""Seconds in which a request must have said what it asks for."""
BODY_TIME = 30.0
"""Seconds in which the next piece of a request's body must come."""
MOST_AHEAD = 1_000_000
"""Bytes of further requests that a client may send while one of its requests is not answered."""


class Connection(H11Protocol):
    """A connection that ends where no request comes in time, or not the rest of one.

    Where there are too many, one that waits for its client makes room.

    Attributes:
        waiting: ends the connection in time, while the client has to say something.
        silent_since: when it said something last, by the clock of the loop [s].
    """

    waiting: asyncio.TimerHandle | None = None
    silent_since = 0.0
    _ahead = 0  # bytes

    def connection_made(self, transport: Any) -> None:
        """Wait for a request."""
        super().connection_made(transport)
        self._wait()
        if len(self.connections) > MOST_CONNECTIONS:
            _end_idlest(one for one in self.connections if isinstance(one, Connection))

    def data_received(self, data: bytes) -> None:
        """Stop waiting when a request is there; wait for the rest of its body."""
        is_open = self.cycle is not None and not self.cycle.response_complete
        self._ahead = self._ahead + len(data) if is_open and not self.cycle.more_body else 0
        if self._ahead > MOST_AHEAD:  # uvicorn would keep all of it
            self.transport.abort()
            return
        super().data_received(data)
        self._wait_for_the_rest()

    def send_400_response(self, msg: str) -> None:
        """Say that a request is wrong, unless it has been answered before its end came."""
        if self.conn.our_state in (h11.IDLE, h11.SEND_RESPONSE):
            super().send_400_response(msg)
        else:
            self.transport.abort()

    def on_response_complete(self) -> None:
        """Wait for the next request."""
        self._wait()
        super().on_response_complete()
        self._wait_for_the_rest()  # of one that was there already

    def connection_lost(self, exc: Exception | None) -> None:
        """Stop waiting."""
        self.stop_waiting()
        super().connection_lost(exc)

    def _wait_for_the_rest(self) -> None:
        """Wait for the rest of a request that is there; for none if it is whole."""
        if self.cycle is None or self.cycle.response_complete:
            return
        if self.cycle.more_body:
            self._wait(BODY_TIME)
        else:
            self.stop_waiting()

    def _wait(self, seconds: float | None = None) -> None:
        self.stop_waiting()
        seconds = HEADER_TIME if seconds is None else seconds
        self.silent_since = self.loop.time()
        self.waiting = self.loop.call_later(seconds, self._end, seconds)

    def _end(self, seconds: float) -> None:
        """End it, unless it is we who do not read what the client sends."""
        if self.flow.read_paused:
            self._wait(seconds)
        else:
            self.transport.abort()

    def stop_waiting(self) -> None:
        """Stop waiting for a request."""
        if self.waiting is not None:
            self.waiting.cancel()
            self.waiting = None


def _end_idlest(connections: Iterable[Connection]) -> None:
    """End the connection whose client has had something to say for longest, and has not."""
    silent = [one for one in connections if one.waiting and not one.flow.read_paused]
    if silent:
        idlest = min(silent, key=lambda one: one.silent_since)
        idlest.stop_waiting()  # nor is it chosen again before it has ended
        idlest.transport.abort()
