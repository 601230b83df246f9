"""The gate of the WebSocket server: it admits programs and known apps, but no other website.

Any page in the user's browser may open a WebSocket to the user's machine. The browser names the
page's site in the header Origin, which Foxglove's SDK does not check. So the SDK's server listens
at an undisclosed address, and this gate is in front of it.
"""

from __future__ import annotations

import asyncio
import contextlib
import random
import shlex
import socket
import sys
import threading
from collections.abc import Callable, Iterable
from functools import partial
from urllib.parse import urlsplit

from hypermap.web.hosts import is_known, known_hosts

APPS = ("https://app.foxglove.dev", "file://")
"""The origins of Foxglove on the web and of desktop apps; a page on the web cannot be a file."""

_LONGEST_HEADER = 16_384  # bytes
_HEADER_TIME = 10.0  # s
_MOST_CLIENTS = 64
_PIECE = 1 << 18  # bytes
_TLS = b"\x16"  # the first byte of a handshake


def hidden_address() -> str:
    """Return an address of this machine that is hard to guess, where it has many."""
    if not sys.platform.startswith("linux"):
        return "127.0.0.1"
    choose = random.SystemRandom()
    return f"127.{choose.randrange(1, 255)}.{choose.randrange(256)}.{choose.randrange(1, 255)}"


class Gate:
    """Hands connections on to another server, if they come from where they may.

    Attributes:
        port: on which it listens.
    """

    def __init__(
        self,
        host: str,
        port: int,
        behind: tuple[str, int],
        origins: Iterable[str] = (),
        refused: Callable[[str], None] = lambda _: None,
    ) -> None:
        """Begin to listen.

        Args:
            host: address to listen on.
            port: 0 for any that is free.
            behind: address and port of the server.
            origins: of websites to admit in addition to `APPS` and those of this machine.
            refused: called with the reason when a connection is refused.

        Raises:
            OSError: If it cannot listen there.
        """
        self._hosts = known_hosts(host)
        self._behind, self._refused = behind, refused
        self._origins = {*APPS, *(origin.lower().rstrip("/") for origin in origins)}
        self._clients: set[asyncio.Task[None]] = set()
        self._silent: dict[asyncio.Task[None], asyncio.StreamWriter] = {}  # the oldest first
        family, _, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        self._listening = socket.socket(family)
        try:
            self._listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            self._listening.bind(address)
            self._listening.listen()
        except OSError:
            self._listening.close()
            raise
        self.port: int = self._listening.getsockname()[1]
        self._loop, self._end = asyncio.new_event_loop(), asyncio.Event()
        self._thread = threading.Thread(target=self._run, name="gate", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End all connections."""
        with contextlib.suppress(RuntimeError):  # it is closed already
            self._loop.call_soon_threadsafe(self._end.set)
        self._thread.join()

    def _run(self) -> None:
        try:
            self._loop.run_until_complete(self._work())
        finally:
            self._loop.close()

    async def _work(self) -> None:
        server = await asyncio.start_server(
            self._serve, sock=self._listening, limit=_LONGEST_HEADER, backlog=_MOST_CLIENTS
        )
        await self._end.wait()
        server.close()
        tasks = asyncio.all_tasks() - {asyncio.current_task()}
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None
        if len(self._clients) >= _MOST_CLIENTS and not self._has_room():
            await _refuse(writer, "503 Service Unavailable", f"{_MOST_CLIENTS} clients are here")
            return
        self._clients.add(task)
        self._silent[task] = writer
        try:
            header = await asyncio.wait_for(_header(reader), _HEADER_TIME)
            await self._let_in(header, reader, writer, partial(self._silent.pop, task, None))
        except (
            OSError,
            asyncio.TimeoutError,  # no OSError before Python 3.11
            asyncio.IncompleteReadError,
            asyncio.LimitOverrunError,
            asyncio.CancelledError,  # asyncio of Python 3.11 would print it with its traceback
        ):
            pass  # a client that is gone, says nothing, or too much; or the gate closes
        finally:
            self._clients.discard(task)
            self._silent.pop(task, None)
            writer.close()

    def _has_room(self) -> bool:
        """End the client that has said nothing for longest; return whether there was one."""
        if not self._silent:
            return False
        # Not by canceling its task: before Python 3.12, `wait_for` takes no notice of that if the
        # header has just come.
        self._silent.pop(next(iter(self._silent))).transport.abort()
        return True

    async def _let_in(
        self,
        header: bytes,
        reader: asyncio.StreamReader,
        writer: asyncio.StreamWriter,
        heard: Callable[[], object],
    ) -> None:
        """Hand a connection on; `heard` is called whenever the client says something."""
        if problem := self._problem(header):
            self._refused(problem)
            await _refuse(writer, "403 Forbidden", problem)
            return
        there, back = await asyncio.open_connection(*self._behind, limit=_PIECE)
        try:
            back.write(header)
            ways = [
                asyncio.ensure_future(_carry(reader, back, heard)),
                asyncio.ensure_future(_carry(there, writer)),
            ]
            try:
                await asyncio.wait(ways, return_when=asyncio.FIRST_COMPLETED)
            finally:
                for way in ways:
                    way.cancel()
                await asyncio.gather(*ways, return_exceptions=True)
        finally:
            back.close()

    def _problem(self, header: bytes) -> str:
        """Return why a request is refused; nothing if it is not."""
        if header == _TLS:
            return "a client wants TLS (wss://); this server has none: connect with ws://"
        asked, *lines = header.decode("latin-1").split("\r\n")
        parts = (line.partition(":") for line in lines)
        fields = {name.strip().lower(): value.strip() for name, _, value in parts}
        is_request = asked.startswith("GET ") and asked.endswith(" HTTP/1.1")
        if not is_request or fields.get("upgrade", "").lower() != "websocket":
            return "this is a WebSocket server; connect with Foxglove or Lichtblick"
        host, origin = fields.get("host", ""), fields.get("origin")
        if not is_known(host, self._hosts):
            return f"this server is not {host[:200]!r}; connect to the address that it has named"
        if origin is None or origin.lower() in self._origins or self._is_here(origin):
            return ""
        site = origin[:200]
        return (
            f"the website {site!r} is not let in; start the server with "
            f"--allow-origin {shlex.quote(site)} if it should be"
        )

    def _is_here(self, origin: str) -> bool:
        """Return whether a site is served by this machine, as Lichtblick in a container is."""
        try:
            return is_known(urlsplit(origin).netloc, self._hosts)
        except ValueError:
            return False


async def _header(reader: asyncio.StreamReader) -> bytes:
    """Return the header of a request; of a client that wants TLS, the first byte."""
    first = await reader.readexactly(1)
    return first if first == _TLS else first + await reader.readuntil(b"\r\n\r\n")


async def _refuse(writer: asyncio.StreamWriter, status: str, reason: str) -> None:
    text = f"{reason}\n".encode()
    head = f"HTTP/1.1 {status}\r\nContent-Length: {len(text)}\r\n"
    with contextlib.suppress(OSError):
        writer.write(head.encode() + b"Connection: close\r\n\r\n" + text)
        await writer.drain()
        writer.close()


async def _carry(
    reader: asyncio.StreamReader,
    writer: asyncio.StreamWriter,
    heard: Callable[[], object] = lambda: None,
) -> None:
    while piece := await reader.read(_PIECE):
        heard()
        writer.write(piece)
        await writer.drain()
