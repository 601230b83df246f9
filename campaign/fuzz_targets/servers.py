"""Servers of the network: the page's, and the door before Foxglove's."""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import random
import shutil
import socket
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlencode

from campaign.fuzz_targets.target import Target, a_map
from campaign.mutation import mutate_any, mutate_text
from hypermap import save_map
from hypermap.viewer.live.app import MapApp
from hypermap.viewer.live.document import MapDocument
from hypermap.web.gate import Gate

_SQUARE = [[0, 0], [4, 0], [4, 4]]
_HOST = "host: 127.0.0.1"
_QUERIES: dict[str, dict[str, str]] = {
    "/": {},
    "/api/map": {},
    "/api/tiles/occupancy/2/1/1.png": {"v": "1"},
    "/api/shapes/semantic": {"bbox": "0,0,9,9", "resolution": "0.01", "name": "cup"},
    "/api/at": {"x": "1", "y": "2", "frame": "map"},
    "/api/area.csv": {"polygon": "0,0,4,0,4,4"},
    "/api/area.geojson": {"polygon": "0,0,4,0,4,4"},
    "/api/find": {"name": "cup", "near": "chair", "within": "2", "limit": "3"},
    "/api/path": {"from": "1,1", "to": "2,2", "radius": "0.2"},
    "/api/objects/semantic/1/evidence": {},
    "/api/objects/semantic/1": {"if_there": "1"},
    "/api/ask": {"text": "which chairs are near the table?"},
    "/api/notes": {},
    f"/api/notes/notes/1/{'0' * 64}": {},
}
_BODIES: dict[str, dict[str, Any]] = {
    "/api/area": {"polygon": _SQUARE, "frame": "map"},
    "/api/undo": {"version": 0},
    "/api/redo": {"version": 0},
    "/api/save": {"path": "other", "overwrite": True},
    "/api/reload": {},
}
_TWO = [[_SQUARE], [[[7, 7], [8, 7], [8, 8]]]]
_EDITS: list[dict[str, Any]] = [
    {"op": "add_layer", "layer": "rooms"},
    {"op": "add", "layer": "semantic", "name": "new", "polygon": _SQUARE},
    {"op": "add", "layer": "semantic", "like": 1, "polygon": _SQUARE},
    {"op": "add", "layer": "semantic", "name": "two", "polygons": _TWO},
    {"op": "update", "layer": "semantic", "id": 1, "name": "x", "tags": ["a"]},
    {"op": "update", "layer": "semantic", "id": 1, "polygon": _SQUARE},
    {"op": "remove", "layer": "semantic", "id": 1},
    {"op": "merge", "layer": "semantic", "id": 1, "others": [2]},
]


def http(folder: Path) -> Target:
    """Requests to the page's server, of a visitor who knows the token."""
    path = folder / "map.hmap"
    save_map(a_map(), path)
    saved = path.read_bytes()

    def new_app() -> MapApp:
        path.write_bytes(saved)
        for other in folder.iterdir():
            if other != path:
                shutil.rmtree(other) if other.is_dir() else other.unlink()
        return MapApp(MapDocument(path, True))

    app = new_app()

    def ask(data: bytes) -> None:
        nonlocal app
        scope, body = parsed_request(data)
        status = asyncio.run(answered(app.app, scope, body))
        if status != 403:
            raise AssertionError(f"answered {status} to nobody")
        scope["headers"].append((b"x-hypermap-token", app.token.encode()))
        status = asyncio.run(answered(app.app, scope, body))
        if status >= 500:
            raise AssertionError(f"answered {status}")
        if scope["method"] == "POST":
            app = new_app()

    return Target(ask, list(_requests()), mutate_request)


def _requests() -> Iterator[bytes]:
    """Yield requests: the first line, headers, an empty line, and a body."""
    for way, values in _QUERIES.items():
        yield f"GET {way}?{urlencode(values)}\n{_HOST}\n\n".encode()
    edits = (("/api/edit", {"version": 0, "operations": [edit]}) for edit in _EDITS)
    for way, body in (*_BODIES.items(), *edits):
        head = f"POST {way}\n{_HOST}\ncontent-type: application/json\n\n"
        yield f"{head}{json.dumps(body)}".encode()
    head = f"{_HOST}\norigin: http://127.0.0.1\nsec-fetch-site: none\n\n"
    yield f"GET /\n{head}".encode()
    yield f"POST /api/save\ncookie: hypermap-80=x\n{head}{{}}".encode()
    yield f"GET /api/events?v=1\nlast-event-id: 123\n{_HOST}\n\n".encode()


def parsed_request(data: bytes) -> tuple[dict[str, Any], bytes]:
    """Return a request as ASGI has it: what is asked, with its headers, and the body."""
    head, _, body = data.partition(b"\n\n")
    first, *lines = head.split(b"\n")
    method, _, target = first.partition(b" ")
    target = bytes(letter for letter in target if 0x21 <= letter <= 0x7E)  # as h11 has it
    way, _, query = target.partition(b"?")
    headers = []
    for line in lines:
        name, _, value = line.partition(b":")
        headers.append((name.strip().lower(), value.strip()))
    scope = {
        "type": "http",
        "asgi": {"version": "3.0"},
        "http_version": "1.1",
        "method": method.decode("latin-1"),
        "scheme": "http",
        "path": way.decode(errors="replace"),
        "raw_path": way,
        "query_string": query,
        "headers": headers,
        "client": ("127.0.0.1", 1),
        "server": ("127.0.0.1", 80),
        "root_path": "",
    }
    return scope, body


def mutate_request(data: bytes, draw: random.Random) -> bytes:
    """Spoil the body of a request as the text that it is, or its head."""
    head, mark, body = data.partition(b"\n\n")
    if body and draw.random() < 0.7:
        return head + mark + mutate_any(body, draw)
    if draw.random() < 0.7:
        return mutate_text(head, draw) + mark + body
    return mutate_text(data, draw)


async def answered(app: Any, scope: dict[str, Any], body: bytes) -> int:
    """Return the status of an answer; raises what the application raises."""
    statuses: list[int] = []
    messages = [{"type": "http.request", "body": body, "more_body": False}]

    async def receive() -> dict[str, Any]:
        return messages.pop(0) if messages else {"type": "http.disconnect"}

    async def send(message: Any) -> None:
        if message["type"] == "http.response.start":
            statuses.append(int(message["status"]))

    await app(scope, receive, send)
    return statuses[0]


def websocket(_: Path) -> Target:
    """What a client says to the door before Foxglove's server: any bytes, over a socket."""
    behind = socket.create_server(("127.0.0.1", 0))
    threading.Thread(target=_switch_protocols, args=(behind,), daemon=True).start()
    gate = Gate("127.0.0.1", 0, behind.getsockname())
    heard = _Heard()
    logging.getLogger("asyncio").addHandler(heard)
    port = str(gate.port).encode()
    head = b"GET / HTTP/1.1\r\nHost: 127.0.0.1:" + port + b"\r\nUpgrade: websocket\r\n"
    head += b"Connection: Upgrade\r\nSec-WebSocket-Protocol: foxglove.sdk.v1\r\n"
    corpus = [
        head + b"Origin: " + origin + b"\r\n\r\n"
        for origin in (b"https://app.foxglove.dev", b"http://127.0.0.1:8080", b"http://evil.org")
    ]

    def ask(data: bytes) -> None:
        reply = b""
        with socket.create_connection(("127.0.0.1", gate.port), timeout=5) as client:
            client.settimeout(5)
            with contextlib.suppress(ConnectionError):
                client.sendall(data)
                client.shutdown(socket.SHUT_WR)
                reply = client.recv(1 << 16)
                while client.recv(1 << 16):
                    pass
        lines = data.partition(b"\r\n\r\n")[0].lower().split(b"\r\n")
        origins = [line for line in lines if line.startswith(b"origin:")]
        if reply.startswith(b"HTTP/1.1 101") and origins and b"//evil.org" in origins[-1]:
            raise AssertionError("another website is let in")
        if heard.records:
            record = heard.records.pop()
            raise AssertionError(record.getMessage()) from (
                record.exc_info[1] if record.exc_info else None
            )

    return Target(ask, corpus, mutate_text)


class _Heard(logging.Handler):
    """Keeps what a logger is told of errors."""

    def __init__(self) -> None:
        super().__init__(logging.ERROR)
        self.records: list[logging.LogRecord] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.records.append(record)


def _switch_protocols(server: socket.socket) -> None:
    """Answer everybody as a server of WebSockets does, for ever."""
    while True:
        connection, _ = server.accept()
        with contextlib.suppress(OSError), connection:
            connection.settimeout(5)
            connection.recv(1 << 16)
            connection.sendall(b"HTTP/1.1 101 Switching Protocols\r\n\r\n")
