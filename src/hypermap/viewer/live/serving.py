"""Runs the server of the page: port, browser, and a shutdown that does not wait."""

from __future__ import annotations

import contextlib
import errno
import ipaddress
import logging
import secrets
import socket
import threading
import webbrowser
from collections.abc import Callable, Iterator
from types import FrameType
from typing import Protocol

import uvicorn
from starlette.applications import Starlette
from starlette.types import ASGIApp

from hypermap.core.errors import HypermapError
from hypermap.viewer.live.connections import Connection
from hypermap.viewer.live.guard import TOKEN_QUERY

FIRST_PORT = 8090
"""Where to listen if nothing else is said, or on the next port that is free."""

_TRIED = 50  # ports
_LONGEST_URL = 512 * 1024  # bytes; a polygon may stand in it
_BACKLOG = 64  # connections that are taken at once, before any of them is looked at
_LONGEST_END = 5.0  # seconds that a server may take to end


class Served(Protocol):
    """What is served.

    Attributes:
        app: what answers.
        token: what its visitors must know.
        is_private: whether they must know it to look, too.
        once: tokens that open the page a single time.
        is_closing: set when the server ends, so that windows that listen for news are let go.
    """

    app: Starlette
    token: str
    is_private: bool
    once: set[str]
    is_closing: bool


def listen(host: str, port: int | None) -> socket.socket:
    """Return a socket that listens.

    Args:
        host: name or number of one of this machine's addresses.
        port: 0 for any; None for 8090, or the next one that is free.

    Raises:
        HypermapError: If the port is in use, or the address is not this machine's.
    """
    if port is not None:
        return _bound(host, port)
    for candidate in range(FIRST_PORT, FIRST_PORT + _TRIED):
        with contextlib.suppress(PortInUse):
            return _bound(host, candidate)
    raise HypermapError(
        f"ports {FIRST_PORT} to {FIRST_PORT + _TRIED - 1} of {host} are all in use; give another "
        "with --port, or --port 0 for any"
    )


class PortInUse(HypermapError):
    """Another program listens there."""


def is_local(host: str) -> bool:
    """Return whether only this machine can reach an address."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def url_of(app: Served, listening: socket.socket, public_url: str | None = None) -> str:
    """Return the address of the page, with the token if visitors must know it.

    Args:
        app: what is served.
        listening: from `listen`.
        public_url: where a web server in front of it is reached.
    """
    return _url(listening, app.token if app.is_private else None, public_url)


def open_browser(app: Served, listening: socket.socket) -> None:
    """Open the page in the browser, by a token that is worth nothing once that is done."""
    token = secrets.token_urlsafe(24)
    app.once.add(token)
    url = _url(listening, token if app.is_private else None)
    threading.Thread(target=webbrowser.open, args=(url,), daemon=True).start()


def _url(listening: socket.socket, token: str | None, public_url: str | None = None) -> str:
    host, port = listening.getsockname()[:2]
    if host in ("0.0.0.0", "::"):  # everywhere; this machine's browser goes the short way
        host = "127.0.0.1" if host == "0.0.0.0" else "::1"
    root = public_url or f"http://{f'[{host}]' if ':' in host else host}:{port}"
    query = "" if token is None else f"?{TOKEN_QUERY}={token}"
    return f"{root.rstrip('/')}/{query}"


def serve(app: Served, listening: socket.socket, on_start: Callable[[], None]) -> None:
    """Serve the page until Ctrl-C, which ends it at once.

    Args:
        app: what is served.
        listening: from `listen`.
        on_start: called when the page can be opened.

    Raises:
        KeyboardInterrupt: When Ctrl-C has ended it.
    """
    _Server(config_of(app.app), app, on_start).run(sockets=[listening])


@contextlib.contextmanager
def serving(app: Served, listening: socket.socket) -> Iterator[None]:
    """Serve the page in a thread of its own while the caller works.

    Args:
        app: what is served.
        listening: from `listen`.

    Raises:
        HypermapError: If the server does not start.
    """
    started = threading.Event()
    server = _Server(config_of(app.app), app, started.set)

    def run() -> None:
        try:
            server.run(sockets=[listening])
        finally:
            started.set()

    thread = threading.Thread(target=run, name="page", daemon=True)
    try:
        thread.start()
        started.wait()
        if not server.started:
            raise HypermapError("the server of the page did not start")
        yield
    finally:
        app.is_closing = True
        server.should_exit = True
        if thread.is_alive():
            thread.join(timeout=_LONGEST_END)


def config_of(app: ASGIApp) -> uvicorn.Config:
    """Return how an application is served: quietly, and without idle connections."""
    return uvicorn.Config(
        app,
        log_config=None,
        log_level="error",
        access_log=False,
        server_header=False,
        proxy_headers=False,
        timeout_graceful_shutdown=1,
        h11_max_incomplete_event_size=_LONGEST_URL,
        http=Connection,
        backlog=_BACKLOG,
        ws="none",
        loop="asyncio",
    )


class _Server(uvicorn.Server):
    """A server that lets go of the windows that listen for news when it ends."""

    def __init__(self, config: uvicorn.Config, app: Served, on_start: Callable[[], None]) -> None:
        super().__init__(config)
        self._app = app
        self._on_start = on_start

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets)
        if self.started:
            self._on_start()

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """End; that requests which come slowly, or not completely, are cancelled is no error."""
        logging.getLogger("uvicorn.error").setLevel(logging.CRITICAL)
        await super().shutdown(sockets)

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        self._app.is_closing = True
        super().handle_exit(sig, frame)


def _bound(host: str, port: int) -> socket.socket:
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        listening = socket.socket(family, kind, protocol)
        try:
            listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            listening.bind(address)
            listening.listen()
        except OSError:
            listening.close()
            raise
    except OSError as error:
        if error.errno == errno.EADDRINUSE:
            raise PortInUse(
                f"port {port} of {host} is in use; give another with --port, or none for the next "
                "one that is free"
            ) from None
        raise HypermapError(f"cannot listen on {host}, port {port}: {error.strerror}") from None
    return listening
