"""The OpenAPI description of the service."""

from __future__ import annotations

from typing import Any

from hypermap import __version__
from hypermap.fleet.store.service.parameters import LIMIT, MOST

CONFORMANCE = [
    "http://www.opengis.net/spec/ogcapi-features-1/1.0/conf/core",
    "http://www.opengis.net/spec/ogcapi-features-1/1.0/conf/oas30",
    "http://www.opengis.net/spec/ogcapi-features-1/1.0/conf/geojson",
]
GEOJSON = "application/geo+json"
OPENAPI = "application/vnd.oai.openapi+json;version=3.0"

_ERROR = {"$ref": "#/components/responses/Error"}
_COLLECTION = {"$ref": "#/components/parameters/collectionId"}
_FEATURE = {"$ref": "#/components/parameters/featureId"}
_VERSION = {"$ref": "#/components/parameters/If-Match"}


def describe(url: str, allows_edits: bool) -> dict[str, Any]:
    """Return the OpenAPI 3.0 document of the service.

    Args:
        url: where it is.
        allows_edits: whether clients may change objects.
    """
    items = "/collections/{collectionId}/items"
    one = f"{items}/{{featureId}}"
    paths: dict[str, Any] = {
        "/": {"get": _operation("landingPage", "What there is.")},
        "/conformance": {"get": _operation("conformance", "Which standards are kept.")},
        "/api": {"get": _operation("api", "This document.")},
        "/collections": {"get": _operation("collections", "All layers of objects of all sites.")},
        "/collections/{collectionId}": {
            "get": _operation("collection", "A layer of a site.", _COLLECTION)
        },
        items: {"get": _operation("features", "Objects.", _COLLECTION, *_items(), media=GEOJSON)},
        one: {"get": _operation("feature", "An object.", _COLLECTION, _FEATURE, media=GEOJSON)},
    }
    if allows_edits:
        paths[items]["post"] = _edit("addFeature", "Add an object.", "201", _COLLECTION)
        paths[one]["put"] = _edit(
            "replaceFeature", "Replace an object.", "204", _COLLECTION, _FEATURE, _VERSION
        )
        paths[one]["delete"] = _operation(
            "removeFeature", "Remove an object.", _COLLECTION, _FEATURE, _VERSION, code="204"
        )
    return {
        "openapi": "3.0.3",
        "info": {"title": "Hypermap: the maps of many sites", "version": __version__},
        "servers": [{"url": url}],
        "security": [{"token": []}],
        "paths": paths,
        "components": _components(),
    }


def _operation(
    name: str, text: str, *parameters: Any, media: str = "application/json", code: str = "200"
) -> dict[str, Any]:
    content = {} if code == "204" else {"content": {media: {"schema": {"type": "object"}}}}
    return {
        "operationId": name,
        "summary": text,
        "parameters": list(parameters),
        "responses": {code: {"description": text, **content}, "default": _ERROR},
    }


def _edit(name: str, text: str, code: str, *parameters: Any) -> dict[str, Any]:
    body = {"required": True, "content": {GEOJSON: {"schema": {"type": "object"}}}}
    return {**_operation(name, text, *parameters, code=code), "requestBody": body}


def _items() -> list[dict[str, Any]]:
    number = {"type": "number"}
    box = {"type": "array", "items": number, "minItems": 4, "maxItems": 6}
    limit = {"type": "integer", "minimum": 1, "maximum": MOST, "default": LIMIT}
    text = {"type": "string"}
    return [
        _query("bbox", "Meets this box: x0,y0,x1,y1 [m].", box, style="form", explode=False),
        _query("datetime", "Was seen at a time or in an interval: BEGIN/END.", text),
        _query("limit", "How many at most.", limit),
        _query("offset", "How many to leave out.", {"type": "integer", "minimum": 0}),
        _query("name", "Has this name.", text),
        _query("tag", "Has this tag.", text),
    ]


def _query(name: str, text: str, schema: dict[str, Any], **others: Any) -> dict[str, Any]:
    return {"name": name, "in": "query", "description": text, "schema": schema, **others}


def _components() -> dict[str, Any]:
    error = {"type": "object", "properties": {"description": {"type": "string"}}}
    return {
        "securitySchemes": {"token": {"type": "http", "scheme": "bearer"}},
        "parameters": {
            name: {"name": name, "in": where, "required": True, "schema": {"type": "string"}}
            for name, where in (
                ("collectionId", "path"),
                ("featureId", "path"),
                ("If-Match", "header"),
            )
        },
        "responses": {
            "Error": {
                "description": "What is wrong.",
                "content": {"application/json": {"schema": error}},
            }
        },
    }
