"""The server of the page that shows a run: its routes, each a query to the run."""

from __future__ import annotations

import asyncio
import secrets
from collections.abc import AsyncIterator, Callable

from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from hypermap.core.errors import HypermapError
from hypermap.viewer.live.guard import Guard
from hypermap.viewer.live.json_text import json_bytes
from hypermap.viewer.live.page import page_file
from hypermap.viewer.live.replies import (
    event_reply,
    fail,
    json_reply,
    json_reply_of,
    refuse,
    refuse_http,
)
from hypermap.viewer.live.request_errors import Refused
from hypermap.viewer.live.requests import whole_number_in
from hypermap.viewer.watch.history import NoSuchStep
from hypermap.viewer.watch.run import ClientState, WatchedRun
from hypermap.web.hosts import known_hosts

_FOREVER = "private, max-age=31536000, immutable"
_POLL, _KEEP_ALIVE = 0.1, 15.0  # seconds


class RunApp:
    """The web application for one run.

    Attributes:
        run: the run.
        token: the access token.
        is_private: whether reading needs the token.
        once: tokens that open the page a single time.
        is_closing: set when the server stops, so that event streams end.
        app: the ASGI application.
    """

    def __init__(self, run: WatchedRun) -> None:
        self.run = run
        self.token = secrets.token_urlsafe(24)
        self.is_private = True
        self.once: set[str] = set()
        self.is_closing = False
        self._id = secrets.token_urlsafe(8)
        self.app = Starlette(
            routes=[
                Route("/", self._page),
                Route("/page/{name}", self._page),
                Route("/api/run", self._run),
                Route("/api/steps/{number}", self._step),
                Route("/api/pictures/{number}.jpg", self._picture),
                Route("/api/grids/{number}.png", self._grid),
                Route("/api/events", self._events),
            ],
            middleware=[
                Middleware(Guard, hosts=known_hosts("127.0.0.1"), token=self.token, once=self.once)
            ],
            exception_handlers={
                HypermapError: refuse,
                HTTPException: refuse_http,
                Exception: fail,
            },
        )

    def _page(self, request: Request) -> Response:
        name = request.path_params.get("name", "run.html")
        content, media_type = page_file(name)
        return Response(content, media_type=media_type, headers={"Cache-Control": "no-cache"})

    def _run(self, _: Request) -> Response:
        run = self.run
        return json_reply({"id": self._id, "recording": run.recording, "output": run.output})

    def _step(self, request: Request) -> Response:
        values = request.query_params
        since = whole_number_in(values, "since") if "since" in values else None
        try:
            content = self.run.step(whole_number_in(request.path_params, "number"), since)
        except NoSuchStep as error:
            raise Refused(str(error), 404) from None
        return json_reply_of(content)

    def _picture(self, request: Request) -> Response:
        return self._file(request, self.run.picture, "image/jpeg")

    def _grid(self, request: Request) -> Response:
        return self._file(request, self.run.grid, "image/png")

    def _file(self, request: Request, read: Callable[[int], bytes], media_type: str) -> Response:
        try:
            content = read(whole_number_in(request.path_params, "number"))
        except NoSuchStep as error:
            raise Refused(str(error), 404) from None
        # The page names the run, so that what the browser keeps is not shown for another one.
        headers = {"Cache-Control": _FOREVER if "run" in request.query_params else "no-store"}
        return Response(content, media_type=media_type, headers=headers)

    async def _events(self, _: Request) -> Response:
        return event_reply(self._event_stream())

    async def _event_stream(self) -> AsyncIterator[bytes]:
        """Yield the state of the run, now and after every event."""
        loop = asyncio.get_running_loop()
        client, last_sent = ClientState(), loop.time()
        while True:
            is_last = self.is_closing
            if client.event_count != self.run.event_count:
                update, client = self.run.update_for(client)
                last_sent = loop.time()
                yield b"data: %b\n\n" % json_bytes({"run": self._id, **update})
            elif loop.time() - last_sent > _KEEP_ALIVE:
                last_sent = loop.time()
                yield b": keep-alive\n\n"
            if is_last:
                return
            await asyncio.sleep(_POLL)
