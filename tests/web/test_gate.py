"""The door before a server: who is let in, and that those who say nothing keep nobody out."""

from __future__ import annotations

import contextlib
import socket
import ssl
import threading
import time
from collections.abc import Iterator

import pytest

from hypermap.web import gate as module
from hypermap.web.gate import Gate

ASK = b"GET / HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\n\r\n"


@pytest.fixture
def gate() -> Iterator[Gate]:
    """A door before a server that sends back what it is sent."""
    with socket.create_server(("127.0.0.1", 0)) as listening:

        def serve(client: socket.socket) -> None:
            with client, contextlib.suppress(OSError):
                while piece := client.recv(1 << 16):
                    client.sendall(piece)

        def accept() -> None:
            with contextlib.suppress(OSError):
                while True:
                    client, _ = listening.accept()
                    threading.Thread(target=serve, args=(client,), daemon=True).start()

        threading.Thread(target=accept, daemon=True).start()
        gate = Gate("127.0.0.1", 0, listening.getsockname()[:2])
        try:
            yield gate
        finally:
            gate.close()


def connected(gate: Gate) -> socket.socket:
    return socket.create_connection(("127.0.0.1", gate.port), timeout=120)


def received(client: socket.socket, size: int) -> bytes:
    found = b""
    while len(found) < size and (piece := client.recv(1 << 20)):
        found += piece
    return found


def test_what_is_sent_goes_both_ways_however_much_it_is(gate: Gate) -> None:
    with connected(gate) as client:
        client.sendall(ASK)
        assert received(client, len(ASK)) == ASK
        many = bytes(range(256)) * 40_000
        sending = threading.Thread(target=client.sendall, args=(many,))
        sending.start()
        assert received(client, len(many)) == many
        sending.join()


def test_closing_with_clients_connected_is_silent(
    gate: Gate, caplog: pytest.LogCaptureFixture
) -> None:
    with connected(gate) as talking, connected(gate) as silent:
        talking.sendall(ASK)
        assert received(talking, len(ASK)) == ASK
        silent.sendall(b"GET / HT")
        gate.close()
        assert received(talking, 1) == received(silent, 1) == b""
    assert not caplog.records


@pytest.mark.parametrize("said", [b"GET / HT", ASK], ids=["head", "whole"])
def test_those_who_say_nothing_keep_nobody_out(
    gate: Gate, said: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "_MOST_CLIENTS", 16)
    with contextlib.ExitStack() as opened, connected(gate) as known:
        for _ in range(2):  # who has gone on after the first request
            known.sendall(ASK)
            assert received(known, len(ASK)) == ASK
        for _ in range(3 * module._MOST_CLIENTS):
            opened.enter_context(connected(gate)).sendall(said)
        for client in (opened.enter_context(connected(gate)), known):
            client.sendall(ASK)
            assert received(client, len(ASK)) == ASK


def test_those_who_talk_are_so_many_and_others_are_told(
    gate: Gate, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "_MOST_CLIENTS", 5)
    with contextlib.ExitStack() as opened:
        for _ in range(5):
            client = opened.enter_context(connected(gate))
            for _ in range(2):
                client.sendall(ASK)
                assert received(client, len(ASK)) == ASK
        for _ in range(20):
            late = opened.enter_context(connected(gate))
            with contextlib.suppress(ConnectionError):
                late.sendall(ASK)
            assert late.recv(1000).startswith(b"HTTP/1.1 503 Service Unavailable")
    end, answer = time.monotonic() + 120, b""
    while answer != ASK:  # until the gate has seen that they are gone
        assert time.monotonic() < end
        with connected(gate) as later:
            later.sendall(ASK)
            answer = received(later, len(ASK))


@pytest.mark.parametrize("said", [b"GET / HT", b"x" * 100_000])
def test_who_says_nothing_in_time_or_too_much_is_left(
    gate: Gate, said: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "_HEADER_TIME", 0.2)
    with connected(gate) as client, contextlib.suppress(ConnectionError):
        client.sendall(said)
        assert client.recv(1) == b""


@pytest.mark.parametrize(
    "said",
    [
        b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n",
        b"Origin: https://evil.example\r\nGET / HTTP/1.1\r\n" + ASK.partition(b"\r\n")[2],
    ],
    ids=["no upgrade", "no request"],
)
def test_what_is_no_websocket_is_told_so_and_not_handed_on(gate: Gate, said: bytes) -> None:
    with connected(gate) as client:
        client.sendall(said)
        answer = received(client, 1 << 20)
    assert answer.startswith(b"HTTP/1.1 403 Forbidden\r\n")
    assert b"connect with Foxglove" in answer


def test_a_refused_site_is_reported_why(gate: Gate) -> None:
    with connected(gate) as client:
        client.sendall(ASK[:-2] + b"Origin: https://evil.example\r\n\r\n")
        answer = received(client, 1 << 20)
    assert answer.startswith(b"HTTP/1.1 403 Forbidden\r\n")
    assert b"--allow-origin https://evil.example" in answer


def test_a_client_that_wants_tls_is_told_at_once(gate: Gate) -> None:
    heard: list[str] = []
    gate._refused = heard.append
    with connected(gate) as client, pytest.raises(ssl.SSLError):
        ssl._create_unverified_context().wrap_socket(client)
    assert heard == ["a client wants TLS (wss://); this server has none: connect with ws://"]
