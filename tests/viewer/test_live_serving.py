"""The port and the thread of the page's server."""

from __future__ import annotations

import asyncio
import signal
import threading
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest
from starlette.applications import Starlette

from hypermap.viewer.live import serving as module
from hypermap.viewer.live.serving import listen, serving


def test_without_a_port_the_next_that_is_free_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    with listen("127.0.0.1", 0) as taken:
        first = taken.getsockname()[1]
        monkeypatch.setattr(module, "FIRST_PORT", first)
        with listen("127.0.0.1", None) as found:
            assert first < found.getsockname()[1] < first + 50


class Interrupted:
    """A server during whose start Ctrl-C is pressed; the start lasts until that is heard."""

    is_closing = False

    def __init__(self) -> None:
        self.app = Starlette(lifespan=self._lifespan)

    @asynccontextmanager
    async def _lifespan(self, _: Starlette) -> AsyncIterator[None]:
        main = threading.main_thread().ident
        assert main is not None
        signal.pthread_kill(main, signal.SIGINT)
        while not self.is_closing:
            await asyncio.sleep(0.01)
        yield


def test_a_server_that_is_interrupted_while_it_starts_ends(ctrl_c: None) -> None:
    with (
        pytest.raises(KeyboardInterrupt),
        listen("127.0.0.1", 0) as listening,
        serving(Interrupted(), listening),
    ):
        raise AssertionError("it has started")
    assert "page" not in {thread.name for thread in threading.enumerate()}
