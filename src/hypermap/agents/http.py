"""Serves agents over HTTP, to this machine alone."""

from __future__ import annotations

import contextlib
import logging
import secrets
import socket
import threading
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import uvicorn
from starlette.requests import ClientDisconnect
from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Receive, Scope, Send

from hypermap.core.errors import HypermapError
from hypermap.viewer.live.serving import config_of, listen

if TYPE_CHECKING:  # `mcp_server` says which extra is missing
    from mcp.server import Server

PATH = "/mcp"

_HOST = "127.0.0.1"
_MOST_BODY = 1_000_000  # bytes of a request
_LAST_CALLS = 5.0  # seconds that calls under way have when the server ends
_SHORTEST_TOKEN = 16  # characters


def serve_http(
    server: Server[Any], port: int | None, token: str, on_start: Callable[[str], None]
) -> None:
    """Serve by streamable HTTP until Ctrl-C.

    Args:
        server: from `server_of`.
        port: 0 for any; None for 8090, or the next one that is free.
        token: what requests must know.
        on_start: called with the address when clients can connect.

    Raises:
        HypermapError: If the port is in use, or the token is too short.
        KeyboardInterrupt: When Ctrl-C has ended it.
    """
    listening, config = _prepared(server, port, token)
    with contextlib.closing(listening):
        _Server(config, lambda: on_start(_url(listening))).run(sockets=[listening])


@contextlib.contextmanager
def served_beside(
    server: Server[Any], port: int | None, token: str, on_start: Callable[[str], None]
) -> Iterator[None]:
    """Serve in a thread while the context lasts; takes and raises the same as `serve_http`."""
    listening, config = _prepared(server, port, token)
    beside = _Server(config, lambda: on_start(_url(listening)))
    thread = threading.Thread(
        target=beside.run, kwargs={"sockets": [listening]}, name="mcp", daemon=True
    )
    with contextlib.closing(listening):
        thread.start()
        try:
            yield
        finally:
            beside.should_exit = True
            thread.join(_LAST_CALLS)


def _prepared(
    server: Server[Any], port: int | None, token: str
) -> tuple[socket.socket, uvicorn.Config]:
    """Return a socket that listens, and how it is served."""
    if len(token) < _SHORTEST_TOKEN or not token.isascii() or not token.isprintable():
        raise HypermapError(f"a token has at least {_SHORTEST_TOKEN} ASCII characters, no blanks")
    logging.getLogger("mcp.server.streamable_http").addFilter(_is_worth_a_line)
    config = config_of(http_app(server, token))
    return listen(_HOST, port), config


def _is_worth_a_line(record: logging.LogRecord) -> bool:
    """Return whether the SDK says more than that a client broke off while it sent something."""
    return not (record.exc_info and isinstance(record.exc_info[1], ClientDisconnect))


def _url(listening: socket.socket) -> str:
    return f"http://{_HOST}:{listening.getsockname()[1]}{PATH}"


def http_app(server: Server[Any], token: str) -> ASGIApp:
    """Return the server as an ASGI application under `PATH`.

    Requests need the header "Authorization: Bearer TOKEN", and to name this machine as their host,
    so that no web page reaches the server by DNS rebinding.
    """
    app = server.streamable_http_app(
        streamable_http_path=PATH, host=_HOST, max_request_body_size=_MOST_BODY
    )
    return _Private(app, token)


class _Private:
    """Lets only those requests through that know the token."""

    def __init__(self, app: ASGIApp, token: str) -> None:
        self._app = app
        self._expected = f"Bearer {token}".encode()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "http":
            given = dict(scope["headers"]).get(b"authorization", b"")
            if not secrets.compare_digest(given, self._expected):
                wrong = {"error": "the header 'Authorization: Bearer TOKEN' is missing or wrong"}
                refusal = JSONResponse(wrong, 401, {"WWW-Authenticate": "Bearer"})
                await refusal(scope, receive, send)
                return
        await self._app(scope, receive, send)


class _Server(uvicorn.Server):
    def __init__(self, config: uvicorn.Config, on_start: Callable[[], None]) -> None:
        super().__init__(config)
        self._on_start = on_start

    async def startup(self, sockets: Any = None) -> None:
        await super().startup(sockets)
        if self.started:
            self._on_start()
