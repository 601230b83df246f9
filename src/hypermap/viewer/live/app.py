"""The server of the page: its routes, each a query or a change of the open map."""

from __future__ import annotations

import asyncio
import secrets
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from functools import cached_property
from typing import TYPE_CHECKING, Any

import shapely
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.requests import ClientDisconnect, Request
from starlette.responses import Response
from starlette.routing import BaseRoute, Route

from hypermap.core.errors import HypermapError, LayerNotFound, ObjectNotFound
from hypermap.core.hypermap import Hypermap
from hypermap.core.value_layer import ValueLayer
from hypermap.questions.frames import pose_of_frame
from hypermap.viewer.live.area_mapping import AreaMapping, describe_coverage
from hypermap.viewer.live.attached import (
    Uploads,
    attached_file,
    describe_notes,
    file_reply,
)
from hypermap.viewer.live.cache import ByteCache
from hypermap.viewer.live.changes import Change
from hypermap.viewer.live.description import describe_map
from hypermap.viewer.live.document import MapDocument
from hypermap.viewer.live.downloads import rows_as_csv, rows_as_geojson
from hypermap.viewer.live.editing import apply_operation, operations_in
from hypermap.viewer.live.english import answer_in_words
from hypermap.viewer.live.event_stream import event_stream
from hypermap.viewer.live.guard import Guard
from hypermap.viewer.live.layers import LayerView, LayerViews
from hypermap.viewer.live.measured_values import describe_values
from hypermap.viewer.live.object_evidence import describe_evidence
from hypermap.viewer.live.page import page_file
from hypermap.viewer.live.past import Past, changes_of, has_past, timeline
from hypermap.viewer.live.questions import Questions
from hypermap.viewer.live.replies import (
    event_reply,
    fail,
    json_reply,
    json_reply_of,
    let_go,
    refuse,
    refuse_http,
)
from hypermap.viewer.live.request_errors import Refused
from hypermap.viewer.live.requests import (
    box_in,
    corners_in,
    number_in,
    read_body,
    text_in,
    whole_number_in,
)
from hypermap.viewer.live.shown_map import MapVersion, ShownMap
from hypermap.viewer.live.snippets import AskedMap, snippets_for_evidence
from hypermap.viewer.live.tiles import Tile, draw_tile
from hypermap.web.hosts import known_hosts

if TYPE_CHECKING:
    from hypermap.viewer.live.paths import Paths

_CACHE = 64_000_000  # bytes of tiles
_FOREVER = "private, max-age=31536000, immutable"
_MOST_DIGITS = 20  # of a version
_LOOK = 0.5  # seconds between two looks at what others have changed


class MapApp:
    """The web application for one open map.

    Attributes:
        document: the map.
        areas: lets a camera cover areas, if a node can do so.
        token: the access token.
        is_private: whether reading needs the token, too.
        once: tokens that open the page a single time.
        is_closing: set when the server stops, so that event streams end.
        app: the ASGI application.
    """

    def __init__(
        self,
        document: ShownMap,
        host: str = "127.0.0.1",
        is_private: bool = True,
        areas: AreaMapping | None = None,
        public_url: str | None = None,
    ) -> None:
        self.document = document
        self.areas = areas
        self.token = secrets.token_urlsafe(24)
        self.is_private = is_private
        self.once: set[str] = set()
        self.is_closing = False
        self._views = LayerViews()
        self._tiles = ByteCache(_CACHE)
        self._past = Past()
        self._uploads = Uploads()
        self.app = Starlette(
            routes=self._routes(),
            middleware=[
                Middleware(
                    Guard,
                    hosts=known_hosts(host, public_url),
                    token=self.token,
                    is_private=is_private,
                )
            ],
            exception_handlers={
                HypermapError: refuse,
                HTTPException: refuse_http,
                ClientDisconnect: let_go,
                Exception: fail,
            },
            lifespan=self._lifespan,
        )

    @cached_property
    def _paths(self) -> Paths:
        from hypermap.viewer.live.paths import Paths  # whose compiled loops take long to import

        return Paths()

    def _routes(self) -> list[BaseRoute]:
        return [
            Route("/", self._page),
            Route("/page/{name}", self._page),
            Route("/api/map", self._map),
            Route("/api/tiles/{layer:path}/{zoom}/{column}/{row}.png", self._tile),
            Route("/api/shapes/{layer:path}", self._shapes),
            Route("/api/values/{layer:path}", self._values),
            Route("/api/at", self._at),
            Route("/api/area", self._area, methods=["POST"]),
            Route("/api/area.{kind}", self._download),
            Route("/api/find", self._find),
            Route("/api/ask", self._ask),
            Route("/api/path", self._path),
            Route("/api/coverage", self._coverage),
            Route("/api/coverage", self._cover, methods=["POST"]),
            Route("/api/objects/{layer:path}/{id}/evidence", self._evidence),
            Route("/api/objects/{layer:path}/{id}", self._object),
            Route("/api/timeline", self._timeline),
            Route("/api/timeline/{version}", self._changes),
            Route("/api/notes", self._notes),
            Route("/api/notes/{layer:path}/{id}/{sha256}", self._attached),
            Route("/api/files", self._upload, methods=["POST"]),
            Route("/api/edit", self._edit, methods=["POST"]),
            Route("/api/undo", self._undo, methods=["POST"]),
            Route("/api/redo", self._redo, methods=["POST"]),
            Route("/api/save", self._save, methods=["POST"]),
            Route("/api/reload", self._reload, methods=["POST"]),
            Route("/api/events", self._events),
        ]

    @asynccontextmanager
    async def _lifespan(self, _: Starlette) -> AsyncIterator[None]:
        watching = asyncio.create_task(self._watch())
        try:
            yield
        finally:
            self.is_closing = True
            watching.cancel()

    async def _watch(self) -> None:
        while True:
            await asyncio.sleep(_LOOK)
            await run_in_threadpool(self.document.look)

    # The page, and what it draws

    def _page(self, request: Request) -> Response:
        name = request.path_params.get("name", "index.html")
        content, media_type = page_file(name)
        return Response(content, media_type=media_type, headers={"Cache-Control": "no-cache"})

    def _map(self, request: Request) -> Response:
        document = self.document
        status, current = document.status(), document.current
        shown, asked = self._asked(request, current)
        is_past = asked.version is not None
        described = describe_map(shown, self._views, document.is_editable and not is_past)
        for layer in described["layers"]:
            is_as_it_was = is_past and has_past(shown[layer["name"]], layer["kind"])
            changed_in = current.changed_in[layer["name"]]
            layer["version"] = asked.version if is_as_it_was else changed_in
            layer["as_it_was"] = is_as_it_was
        answer = {"name": document.name, "path": document.address, "token": self.token, **status}
        offered = {"can_cover": self.areas is not None}
        return json_reply({**answer, **described, **offered, "version": current.version})

    def _tile(self, request: Request) -> Response:
        current = self.document.current
        hypermap, asked = self._asked(request, current)
        view = self._view(hypermap, request)
        values = {key: request.path_params[key] for key in ("zoom", "column", "row")}
        numbers = {key: whole_number_in(values, key) for key in values}
        tile = Tile(**numbers)
        pyramid = view.pyramid
        if pyramid is None:
            raise Refused(f"layer {request.path_params['layer']!r} is no grid", 404)
        version = current.changed_in[request.path_params["layer"]]
        etag = f'"{version}"' if asked.version is None else f'"{version}.{asked.version}"'
        is_final = "v" in request.query_params and asked.version is None
        headers = {"ETag": etag, "Cache-Control": _FOREVER if is_final else ""}
        headers = {key: value for key, value in headers.items() if value}
        if request.headers.get("if-none-match") == etag:
            return Response(status_code=304, headers=headers)
        key = (request.path_params["layer"], etag, tile)
        content = self._tiles.get(key, lambda: draw_tile(pyramid, tile, view.base_T_layer))
        return Response(content, media_type="image/png", headers=headers)

    def _shapes(self, request: Request) -> Response:
        view = self._view(self._asked(request)[0], request)
        if view.shapes is None:
            raise Refused(f"layer {request.path_params['layer']!r} has no shapes", 404)
        values = request.query_params
        resolution = number_in(values, "resolution")
        if resolution <= 0:
            raise Refused(f"resolution: must be above 0 m, got {resolution:g}")
        names = values.getlist("name") if "name" in values else None
        box = box_in(values, "bbox")
        return json_reply_of(view.shapes.view(box, resolution, view.base_T_layer, names))

    def _values(self, request: Request) -> Response:
        hypermap, _ = self._asked(request)
        view, layer = self._view(hypermap, request), hypermap[request.path_params["layer"]]
        sent = None
        if isinstance(layer, ValueLayer):
            sent = describe_values(layer, view.base_T_layer)
        if sent is None:
            raise Refused(f"layer {layer.name!r} has no measured values", 404)
        return json_reply(sent)

    # Questions

    def _at(self, request: Request) -> Response:
        values = request.query_params
        point = (number_in(values, "x"), number_in(values, "y"))
        return json_reply(self._questions(request).at(point, text_in(values, "frame")))

    async def _area(self, request: Request) -> Response:
        body = await read_body(request)
        corners, frame = corners_in(body, "polygon"), text_in(body, "frame")
        questions = await run_in_threadpool(self._questions, request)
        return json_reply(await run_in_threadpool(questions.area, corners, frame))

    def _download(self, request: Request) -> Response:
        values, questions = request.query_params, self._questions(request)
        kind = request.path_params["kind"]
        if kind not in ("csv", "geojson"):
            raise Refused(f"there is no area.{kind}, only area.csv and area.geojson", 404)
        rows = questions.rows_in(corners_in(values, "polygon"), text_in(values, "frame"))
        is_csv = kind == "csv"
        content = rows_as_csv(rows) if is_csv else rows_as_geojson(questions.hypermap, rows)
        headers = {"Content-Disposition": f'attachment; filename="area.{kind}"'}
        media_type = "text/csv; charset=utf-8" if is_csv else "application/geo+json"
        return Response(content, media_type=media_type, headers=headers)

    def _find(self, request: Request) -> Response:
        return json_reply(self._questions(request).find(request.query_params))

    def _ask(self, request: Request) -> Response:
        return json_reply(answer_in_words(*self._asked(request), request.query_params))

    def _path(self, request: Request) -> Response:
        path, hypermap = self.document.address, self.document.current.hypermap
        return json_reply(self._paths.answer(hypermap, path, request.query_params))

    def _object(self, request: Request) -> Response:
        number = whole_number_in(request.path_params, "id")
        try:
            return json_reply(
                self._questions(request).details(request.path_params["layer"], number)
            )
        except (LayerNotFound, ObjectNotFound):
            if "if_there" in request.query_params:
                return json_reply(None)
            raise

    def _evidence(self, request: Request) -> Response:
        layer, number = request.path_params["layer"], whole_number_in(request.path_params, "id")
        hypermap, asked = self._asked(request)
        answer = describe_evidence(hypermap, layer, number)
        return json_reply({**answer, **snippets_for_evidence(asked, layer, number)})

    def _timeline(self, _: Request) -> Response:
        return json_reply(timeline(self.document.current.hypermap))

    def _changes(self, request: Request) -> Response:
        version = whole_number_in(request.path_params, "version")
        return json_reply(changes_of(self.document.current.hypermap, version))

    def _notes(self, _: Request) -> Response:
        return json_reply(describe_notes(self.document.current.hypermap))

    def _attached(self, request: Request) -> Response:
        layer, sha256 = request.path_params["layer"], request.path_params["sha256"]
        number = whole_number_in(request.path_params, "id")
        hypermap = self.document.current.hypermap
        return file_reply(attached_file(hypermap, layer, number, sha256))

    # Areas that a camera is to cover

    def _coverage(self, _: Request) -> Response:
        return json_reply(describe_coverage(self._areas().coverage()))

    async def _cover(self, request: Request) -> Response:
        body, areas = await read_body(request), self._areas()
        polygon = shapely.Polygon(corners_in(body, "polygon"))
        hypermap = self.document.current.hypermap
        area = pose_of_frame(hypermap, text_in(body, "frame")).apply_geometry(polygon)
        await run_in_threadpool(areas.begin, area)
        return json_reply(describe_coverage(areas.coverage()))

    def _areas(self) -> AreaMapping:
        if self.areas is None:
            raise Refused("this map is not that of a node that automaps", 404)
        return self.areas

    # Changes

    async def _upload(self, request: Request) -> Response:
        if not self.document.is_editable:
            raise Refused("the map is read-only", 403)
        name = text_in(request.query_params, "name") or "file"
        path = self._file().file.path
        found = await self._uploads.receive(request.stream(), name, path)
        return json_reply({"sha256": found.sha256, "name": found.name, "kind": found.kind})

    async def _edit(self, request: Request) -> Response:
        body = await read_body(request)
        version, operations = whole_number_in(body, "version"), operations_in(body)
        ids: list[int] = []

        def change(draft: Any) -> None:
            files = self._uploads.files
            made = [apply_operation(draft, operation, files) for operation in operations]
            ids.extend(number for number in made if number is not None)

        draft = await run_in_threadpool(self._file().edit, version, change)
        return self._changed({change.layer for change in draft.changes}, ids=ids)

    async def _undo(self, request: Request) -> Response:
        return await self._go(request, self._file().undo)

    async def _redo(self, request: Request) -> Response:
        return await self._go(request, self._file().redo)

    async def _go(self, request: Request, go: Callable[[int], Any]) -> Response:
        version = whole_number_in(await read_body(request), "version")
        changes = await run_in_threadpool(go, version)
        ids = list(dict.fromkeys(one.id for one in changes if isinstance(one, Change)))
        return self._changed({change.layer for change in changes}, ids=ids)

    async def _save(self, request: Request) -> Response:
        body = await read_body(request)
        overwrite = body.get("overwrite") is True
        await run_in_threadpool(self._file().save, text_in(body, "path"), overwrite)
        return self._changed(set(), saved=True, name=self.document.name)

    async def _reload(self, request: Request) -> Response:
        await read_body(request)
        await run_in_threadpool(self._file().reload)
        return self._changed({layer.name for layer in self.document.current.hypermap})

    def _changed(self, layers: set[str], **others: Any) -> Response:
        return json_reply({**self.document.status(), "layers": sorted(layers), **others})

    async def _events(self, request: Request) -> Response:
        seen = request.headers.get("last-event-id") or request.query_params.get("v") or ""
        is_version = seen.isdecimal() and len(seen) <= _MOST_DIGITS
        version = int(seen) if is_version else self.document.current.version
        return event_reply(event_stream(self.document, version, lambda: self.is_closing))

    # Parts of the above

    def _file(self) -> MapDocument:
        """Return the map as a file that can be edited, saved and loaded again."""
        if not isinstance(self.document, MapDocument):
            raise Refused("the map is read-only", 403)
        return self.document

    def _asked(
        self, request: Request, current: MapVersion | None = None
    ) -> tuple[Hypermap, AskedMap]:
        """Return the map that a request asks: as it is, or as it was in the version `as_of`."""
        current = current or self.document.current
        path, values = self.document.address, request.query_params
        if "as_of" not in values:
            return current.hypermap, AskedMap(path)
        version = whole_number_in(values, "as_of")
        return self._past.map_at(current.hypermap, version), AskedMap(path, version)

    def _questions(self, request: Request) -> Questions:
        hypermap, asked = self._asked(request)
        return Questions(hypermap, self._views, asked)

    def _view(self, hypermap: Hypermap, request: Request) -> LayerView:
        view = self._views.of(hypermap, hypermap[request.path_params["layer"]])
        if view.problem:
            raise Refused(view.problem)
        return view
