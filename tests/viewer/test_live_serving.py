"""The port and the thread of the page's server."""

from __future__ import annotations

import asyncio
import contextlib
import signal
import socket
import threading
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager
from urllib.request import urlopen

import pytest
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import PlainTextResponse
from starlette.routing import Route

from hypermap.viewer.live import connections
from hypermap.viewer.live import serving as module
from hypermap.viewer.live.serving import listen, serving

PATIENCE = 240.0  # s; the machine may be busy


def test_without_a_port_the_next_that_is_free_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    with listen("127.0.0.1", 0) as taken:
        first = taken.getsockname()[1]
        monkeypatch.setattr(module, "FIRST_PORT", first)
        with listen("127.0.0.1", None) as found:
            assert first < found.getsockname()[1] < first + 50


class Quick:
    """A server that answers every request at once."""

    token, is_private, is_closing = "", False, False

    def __init__(self) -> None:
        self.once: set[str] = set()
        self.app = Starlette(
            routes=[
                Route("/", lambda _: PlainTextResponse("here")),
                Route("/body", self._read, methods=["POST"]),
                Route("/wait", self._wait),
            ]
        )

    async def _read(self, request: Request) -> PlainTextResponse:
        return PlainTextResponse(await request.body())

    async def _wait(self, request: Request) -> PlainTextResponse:
        while not self.is_closing and not await request.is_disconnected():  # which reads on
            await asyncio.sleep(0)
        return PlainTextResponse("")


@contextlib.contextmanager
def half_open(
    address: tuple[str, int], count: int, said: bytes = b"GET / HTTP/1.1\r\nHost: "
) -> Iterator[list[socket.socket]]:
    """Yield connections that begin to say something, and go no further."""
    with contextlib.ExitStack() as opened:
        found = []
        for _ in range(count):
            one = opened.enter_context(socket.create_connection(address, timeout=PATIENCE))
            one.sendall(said)
            found.append(one)
        yield found


def begun(connection: socket.socket) -> socket.socket:
    """Begin a request, unless the connection has ended by now."""
    with contextlib.suppress(ConnectionError):
        connection.sendall(b"GET / HTTP/1.1\r\n")
    return connection


def has_ended(connection: socket.socket) -> bool:
    try:
        return connection.recv(1) == b""
    except ConnectionResetError:
        return True


HALF_A_BODY = b"POST /body HTTP/1.1\r\nHost: here\r\nContent-Length: 4\r\n\r\nhe"


@pytest.mark.parametrize("said", [b"GET / HTTP/1.1\r\nHost: ", HALF_A_BODY], ids=["head", "body"])
def test_connections_that_go_no_further_keep_nobody_out(
    said: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connections, "MOST_CONNECTIONS", 16)
    with listen("127.0.0.1", 0) as listening, serving(Quick(), listening):
        address = listening.getsockname()
        with half_open(address, 48, said) as idle:
            assert all(has_ended(one) for one in idle[:16])
            with urlopen(f"http://127.0.0.1:{address[1]}/", timeout=PATIENCE) as answer:
                assert answer.read() == b"here"


def test_a_request_must_say_in_time_what_it_asks_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connections, "HEADER_TIME", 0.1)
    with (
        listen("127.0.0.1", 0) as listening,
        serving(Quick(), listening),
        socket.create_connection(listening.getsockname(), timeout=PATIENCE) as one,
    ):
        assert has_ended(begun(one))


def test_so_must_the_next_request_of_a_connection(monkeypatch: pytest.MonkeyPatch) -> None:
    def here(_: Request) -> PlainTextResponse:
        monkeypatch.setattr(connections, "HEADER_TIME", 0.1)  # from now on
        return PlainTextResponse("here")

    monkeypatch.setattr(connections, "HEADER_TIME", PATIENCE)
    quick = Quick()
    quick.app = Starlette(routes=[Route("/", here)])
    with (
        listen("127.0.0.1", 0) as listening,
        serving(quick, listening),
        socket.create_connection(listening.getsockname(), timeout=PATIENCE) as one,
    ):
        one.sendall(b"GET / HTTP/1.1\r\nHost: here\r\n\r\n")
        answer = b""
        while not answer.endswith(b"here"):
            answer += one.recv(1000)
        assert has_ended(begun(one))


def test_the_rest_of_a_body_must_come_in_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connections, "BODY_TIME", 0.1)
    with listen("127.0.0.1", 0) as listening, serving(Quick(), listening):
        with half_open(listening.getsockname(), 1, HALF_A_BODY) as (one,):
            assert has_ended(one)
        monkeypatch.setattr(connections, "BODY_TIME", PATIENCE)
        with half_open(listening.getsockname(), 1, HALF_A_BODY) as (one,):
            one.sendall(b"re")
            answer = b""
            while not answer.endswith(b"here"):
                answer += one.recv(1000)


def test_what_is_no_request_any_more_once_it_is_answered_ends_the_connection(
    caplog: pytest.LogCaptureFixture,
) -> None:
    head = b"POST / HTTP/1.1\r\nHost: here\r\nTransfer-Encoding: chunked\r\n\r\n"
    with (
        listen("127.0.0.1", 0) as listening,
        serving(Quick(), listening),
        half_open(listening.getsockname(), 1, head) as (one,),
    ):
        assert one.recv(1000).startswith(b"HTTP/1.1 405 ")
        one.sendall(b"no chunk\r\n")
        while not has_ended(one):
            pass
    assert not caplog.records  # nor a traceback


def test_requests_that_come_before_answers_are_not_kept_without_end(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(connections, "MOST_AHEAD", 100_000)
    ask = b"GET /wait HTTP/1.1\r\nHost: here\r\n\r\n"
    with (
        listen("127.0.0.1", 0) as listening,
        serving(Quick(), listening),
        half_open(listening.getsockname(), 1, ask) as (one,),
        pytest.raises(ConnectionError),
    ):
        one.sendall(1_000_000 * ask)


class Interrupted:
    """A server during whose start Ctrl-C is pressed; the start lasts until that is heard."""

    token, is_private, is_closing = "", False, False

    def __init__(self) -> None:
        self.once: set[str] = set()
        self.app = Starlette(lifespan=self._lifespan)

    @asynccontextmanager
    async def _lifespan(self, _: Starlette) -> AsyncIterator[None]:
        main = threading.main_thread().ident
        assert main is not None
        signal.pthread_kill(main, signal.SIGINT)
        while not self.is_closing:
            await asyncio.sleep(0.01)
        yield


def test_a_server_that_is_interrupted_while_it_starts_ends(
    ctrl_c: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "_LONGEST_END", PATIENCE)
    with (
        pytest.raises(KeyboardInterrupt),
        listen("127.0.0.1", 0) as listening,
        serving(Interrupted(), listening),
    ):
        raise AssertionError("it has started")
    assert "page" not in {thread.name for thread in threading.enumerate()}
