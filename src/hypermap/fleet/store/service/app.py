"""The service as a web application.

Source of the resources: OGC API - Features, part 1, 17-069r4, conformance classes Core, OpenAPI 3.0
and GeoJSON.
"""

from __future__ import annotations

import dataclasses
import json
import logging
import re
import secrets
from collections.abc import Callable
from datetime import datetime, timezone
from typing import Any
from urllib.parse import quote, urlencode

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect, Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from hypermap.core.errors import FormatError, HypermapError
from hypermap.core.objects import SemanticObject
from hypermap.fleet.store.address import Address, StoreAway
from hypermap.fleet.store.database import Database
from hypermap.fleet.store.pushing import Conflict
from hypermap.fleet.store.service import parameters
from hypermap.fleet.store.service.collections import (
    Collection,
    Connections,
    collections,
    feature,
    features,
)
from hypermap.fleet.store.service.description import CONFORMANCE, GEOJSON, OPENAPI, describe
from hypermap.fleet.store.service.parameters import BadRequest
from hypermap.fleet.store.updates import Update, apply
from hypermap.formats.semantic.geojson import from_geojson

_log = logging.getLogger(__name__)
_MOST_BODY = 1_000_000  # bytes
_NUL = re.compile(rb"(?<!\\)(?:\\\\)*\\u0000")  # after whole pairs of backslashes


class StoreService:
    """Serves a store; clients read, and change objects if that is allowed.

    Args:
        address: of the store.
        token: what requests must bring.
        allows_edits: whether clients may change objects.
        url: where clients reach the service, with which all links begin; None for the address that
            a request names, which is wrong behind a web server with TLS or under a path.

    Attributes:
        app: what answers.
        token: what requests must bring.
        is_private: True, as also readers must know the token.
        once: unused; no browser is opened.
        is_closing: set when the server ends.
    """

    def __init__(
        self, address: Address, token: str, *, allows_edits: bool = False, url: str | None = None
    ) -> None:
        self.token = token
        self.is_private = True
        self.once: set[str] = set()
        self.is_closing = False
        self.connections = Connections(address)
        self._allows_edits = allows_edits
        # A path, as the name of a site may have a slash; so what ends otherwise comes first.
        one = "/collections/{collection:path}"
        item = f"{one}/items/{{feature}}"
        routes = [
            self._route("/", self._landing),
            self._route("/conformance", self._conformance),
            self._route("/api", self._api),
            self._route("/collections", self._collections),
            self._route(item, self._item),
            self._route(f"{one}/items", self._items),
            self._route(one, self._collection),
        ]
        if allows_edits:
            routes += [
                Route(f"{one}/items", self._add, methods=["POST"]),
                Route(item, self._replace, methods=["PUT"]),
                Route(item, self._remove, methods=["DELETE"]),
            ]
        self.app = Starlette(
            routes=routes,
            exception_handlers={
                HypermapError: _refused,
                HTTPException: _not_found,
                ClientDisconnect: _let_go,
            },
        )
        self.app.state.store = address.shown
        self.app.state.url = None if url is None else url.rstrip("/") + "/"

    def _route(self, path: str, answer: Callable[[Request, Database], tuple[Any, str]]) -> Route:
        """Return a route that answers in a thread, by one connection."""

        def endpoint(request: Request) -> Response:
            self._check_token(request)
            known = parameters.ITEMS if answer == self._items else ("f",)
            parameters.check_known(request.query_params, known)
            with self.connections.one() as database:
                content, media = answer(request, database)
            return JSONResponse(content, media_type=media)

        return Route(path, endpoint, methods=["GET"])

    def _check_token(self, request: Request) -> None:
        given = request.headers.get("authorization", "").encode()
        if not secrets.compare_digest(given, f"Bearer {self.token}".encode()):
            raise HTTPException(
                401,
                "the header 'Authorization: Bearer TOKEN' is missing or wrong",
                {"WWW-Authenticate": "Bearer"},
            )

    # Reading

    def _landing(self, request: Request, _database: Database) -> tuple[Any, str]:
        url = _root(request)
        links = [
            _link(url, "self", "application/json", "this page"),
            _link(f"{url}api", "service-desc", OPENAPI, "the API"),
            _link(f"{url}conformance", "conformance", "application/json", "the standards"),
            _link(f"{url}collections", "data", "application/json", "the layers of all sites"),
        ]
        return {"title": "Hypermap", "links": links}, "application/json"

    def _conformance(self, _request: Request, _database: Database) -> tuple[Any, str]:
        return {"conformsTo": CONFORMANCE}, "application/json"

    def _api(self, request: Request, _database: Database) -> tuple[Any, str]:
        return describe(_root(request), self._allows_edits), OPENAPI

    def _collections(self, request: Request, database: Database) -> tuple[Any, str]:
        url = _root(request)
        found = [_described(each, url) for each in collections(database)]
        links = [_link(f"{url}collections", "self", "application/json", "this document")]
        return {"links": links, "collections": found}, "application/json"

    def _collection(self, request: Request, database: Database) -> tuple[Any, str]:
        return _described(_asked(request, database), _root(request)), "application/json"

    def _items(self, request: Request, database: Database) -> tuple[Any, str]:
        given = request.query_params
        wanted = parameters.filter_of(given)
        limit = parameters.whole(given, "limit", parameters.LIMIT, 1, parameters.MOST)
        offset = parameters.whole(given, "offset", 0, 0, 2**31)
        collection = _asked(request, database)
        found, count = features(database, collection, wanted, limit, offset)
        url = f"{_items_url(request, collection)}?"
        links = [_link(url + urlencode(given), "self", GEOJSON, "this page")]
        if offset + len(found) < count:
            after = {**given, "limit": str(limit), "offset": str(offset + limit)}
            links.append(_link(url + urlencode(after), "next", GEOJSON, "the next page"))
        page = {
            "type": "FeatureCollection",
            "timeStamp": datetime.now(timezone.utc).isoformat().replace("+00:00", "Z"),
            "numberMatched": count,
            "numberReturned": len(found),
            "links": links,
            "features": found,
        }
        return page, GEOJSON

    def _item(self, request: Request, database: Database) -> tuple[Any, str]:
        collection = _asked(request, database)
        found, version = _feature(request, database, collection)
        url = f"{_items_url(request, collection)}/{found['id']}"
        above = f"{_root(request)}collections/{quote(collection.id, safe='')}"
        links = [
            _link(url, "self", GEOJSON, "this object"),
            _link(above, "collection", "application/json", "its layer"),
        ]
        return {**found, "links": links, "version": version}, GEOJSON

    # Changing

    async def _add(self, request: Request) -> Response:
        item = _object(await self._body(request))

        def add() -> Response:
            with self.connections.one() as database:
                collection = _asked(request, database)
                update = Update(collection.site, collection.layer, [_without_id(item)])
                (number,) = apply(database, update).ids
            where = f"{_items_url(request, collection)}/{number}"
            return JSONResponse({"id": number}, 201, {"Location": where})

        return await run_in_threadpool(add)

    async def _replace(self, request: Request) -> Response:
        item = _object(await self._body(request))
        return await run_in_threadpool(self._change, request, item)

    def _remove(self, request: Request) -> Response:
        self._check_token(request)
        return self._change(request, None)

    def _change(self, request: Request, item: SemanticObject | None) -> Response:
        """Replace an object, or remove it, if it still has the version that the client names."""
        version = request.headers.get("if-match", "").strip('"')
        if not (version.isascii() and version.isdigit() and len(version) < 10):
            raise BadRequest("the header If-Match must contain the object's `version`")
        with self.connections.one() as database:
            collection = _asked(request, database)
            found, _ = _feature(request, database, collection)
            number = int(found["id"])
            kept = () if item is None else (_without_id(item).with_id(number),)
            removed = (number,) if item is None else ()
            seen = {number: int(version)}
            apply(database, Update(collection.site, collection.layer, kept, removed, seen))
        return Response(status_code=204)

    async def _body(self, request: Request) -> bytes:
        self._check_token(request)
        content = b""
        async for part in request.stream():
            content += part
            if len(content) > _MOST_BODY:
                raise BadRequest(f"the body is larger than {_MOST_BODY} bytes")
        return content


def _object(content: bytes) -> SemanticObject:
    """Return the object in a GeoJSON feature."""
    if _NUL.search(content):
        raise BadRequest("the body contains a NUL character, which the database does not allow")
    try:
        raw = json.loads(content)
        collection = json.dumps({"type": "FeatureCollection", "features": [raw]})
        (item,) = from_geojson(collection, frame_id="map").objects()
    except (FormatError, ValueError, RecursionError) as error:
        raise BadRequest(f"the body is not a GeoJSON feature: {error}") from None
    return item


def _without_id(item: SemanticObject) -> SemanticObject:
    return dataclasses.replace(item, id=None)


def _asked(request: Request, database: Database) -> Collection:
    wanted = request.path_params["collection"]
    found = [] if "\0" in wanted else collections(database, wanted)
    if not found:
        raise HTTPException(404, f"there is no collection {wanted!r}")
    return found[0]


def _feature(
    request: Request, database: Database, collection: Collection
) -> tuple[dict[str, Any], int]:
    text = request.path_params["feature"]
    number = parameters.object_id(text)
    found = None if number is None else feature(database, collection, number)
    if found is None:
        raise HTTPException(404, f"collection {collection.id!r} has no feature {text!r}")
    return found


def _described(collection: Collection, url: str) -> dict[str, Any]:
    above = f"{url}collections/{quote(collection.id, safe='')}"
    title = f"{collection.layer} of {collection.site}"
    extent = {} if collection.box is None else {"extent": {"spatial": {"bbox": [collection.box]}}}
    return {
        "id": collection.id,
        "title": title,
        "description": f"Objects in meters in the frame {collection.frame_id!r} of this site; "
        f"version {collection.version}.",
        "itemType": "feature",
        **extent,
        "links": [
            _link(above, "self", "application/json", title),
            _link(f"{above}/items", "items", GEOJSON, f"the objects of {title}"),
        ],
    }


def _items_url(request: Request, collection: Collection) -> str:
    return f"{_root(request)}collections/{quote(collection.id, safe='')}/items"


def _root(request: Request) -> str:
    return request.app.state.url or str(request.base_url)


def _link(href: str, rel: str, media: str, title: str) -> dict[str, str]:
    return {"href": href, "rel": rel, "type": media, "title": title}


def _refused(request: Request, error: Exception) -> Response:
    """Return what went wrong; a refusal says no more than it must.

    Clients do not know the database: for them, the store is at the address of this service.
    """
    root = _root(request).rstrip("/")
    text = str(error).replace(request.app.state.store, root)
    code = 400
    if isinstance(error, Conflict):
        code = 412
    elif isinstance(error, StoreAway):
        code = 503
        _log.warning("%s", error)  # which names the server of the database, and its port
        text = f"{root}: the store does not answer; try again later"
    elif not isinstance(error, BadRequest):
        code = 403
    return JSONResponse({"code": str(code), "description": text}, code)


def _let_go(_request: Request, _error: Exception) -> Response:
    """Return what a client that broke off while it sent something does not hear."""
    return Response(status_code=400)


def _not_found(_request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)  # what Starlette calls this for
    content = {"code": str(error.status_code), "description": error.detail}
    return JSONResponse(content, error.status_code, error.headers)
