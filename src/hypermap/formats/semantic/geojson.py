"""Semantic layers as GeoJSON, for GIS programs; the specification is docs/formats/geojson.md.

Coordinates are meters in the layer's frame, which `frame_id` names. GeoJSON means degrees unless
the parties agree otherwise (RFC 7946, section 4), so a `crs` says the same to GDAL, and with it to
QGIS and geopandas: an engineering system with meters, which lies nowhere on the globe.
"""

from __future__ import annotations

import collections
import json
import logging
import re
from collections.abc import Mapping
from typing import Annotated, Any, Literal

import numpy as np
import shapely
from pydantic import Field
from shapely.geometry.base import BaseGeometry

from hypermap.core.arguments import check_kind
from hypermap.core.errors import FormatError
from hypermap.core.objects import MAX_ID
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.core.shapes import check_footprint
from hypermap.formats.checked import Checked, Text, check, found
from hypermap.formats.columns.crs import System, engineering_wkt, frame_of
from hypermap.formats.letters import check_read, check_savable
from hypermap.formats.semantic.records import object_from_record, record_from_object
from hypermap.formats.yaml_text import plain_value
from hypermap.text import counted

logger = logging.getLogger(__name__)

_HALF = re.compile(r"\\u[dD][89a-fA-F]")  # of a character, and often the other half behind it
_AREAS = ("Polygon", "MultiPolygon")
_CONTENT = 'Path(file).read_text(encoding="utf-8")'
_WRONG = (
    ValueError,
    TypeError,
    LookupError,
    AttributeError,
    RecursionError,
    OverflowError,  # of whole numbers beyond those of floats
    shapely.errors.ShapelyError,
)


class _Collection(Checked):
    type: Literal["FeatureCollection"]
    features: list[Any]
    name: Text | None = None
    frame_id: Text | None = None
    crs: dict[str, Any] | None = None


class _Feature(Checked):
    type: Literal["Feature"]
    geometry: dict[str, Any] | None = None
    properties: dict[str, Any] | None = None
    id: Any = None


class _Geometry(Checked):
    type: str
    coordinates: Annotated[list[Any], Field(min_length=1)]


def to_geojson(layer: SemanticLayer) -> str:
    """Return a layer's objects as GeoJSON text; `from_geojson` gives exactly the same again.

    Raises:
        FormatError: If an object has an attribute that JSON cannot hold.
        HypermapError: If a text holds half of a character.
        TypeError: If it is not a semantic layer.
    """
    check_kind(layer, SemanticLayer)
    for text in (layer.name, layer.frame_id):
        check_savable(text, f"layer {layer.name!r}")
    collection = {
        "type": "FeatureCollection",
        "name": layer.name,
        "frame_id": layer.frame_id,
        "crs": {"type": "name", "properties": {"name": engineering_wkt(layer.frame_id)}},
        "features": [feature_of(item) for item in layer.objects()],
    }
    try:
        text = json.dumps(collection, ensure_ascii=False, allow_nan=False, indent=1, default=_plain)
        return text + "\n"
    except (TypeError, ValueError) as error:
        raise FormatError(f"cannot be written as JSON: {error}", key=layer.name) from error


def _plain(value: object) -> object:
    """Return NumPy's numbers and arrays, which attributes may be, as Python's."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise TypeError(f"Object of type {type(value).__name__} is not JSON serializable")


def from_geojson(
    text: str, name: str | None = None, frame_id: str | None = None, path: str | None = None
) -> SemanticLayer:
    """Return the layer in GeoJSON text.

    Args:
        text: a FeatureCollection of polygons and multipolygons in meters.
        name: the layer's name; None takes the collection's own.
        frame_id: the frame of the coordinates; None takes the collection's own. Many GIS
            programs drop it. Coordinates in another `crs` than that of a frame are refused.
        path: how messages name the file.

    Raises:
        FormatError: Naming the feature that is wrong.
        TypeError: If it is no text.
    """
    check_kind(text, str)
    try:
        document = json.loads(text.removeprefix("\ufeff"), parse_constant=_refuse)
    except (ValueError, RecursionError) as error:
        is_name = path is None and "{" not in text
        hint = f"; of a file, give the content: {_CONTENT}" if is_name else ""
        raise FormatError(f"is not valid JSON: {error}{hint}", path=path) from error
    collection = check(_Collection, document, path)
    if _HALF.search(text):
        for i, item in enumerate(collection.features):
            check_read(json.dumps(item, ensure_ascii=False), path, f"features[{i}]")
    if any(_is_way(item) for item in collection.features):
        raise FormatError("is a Nav2 route graph, which has no objects", path=path)
    frame = frame_of(_system(collection), frame_id or collection.frame_id, path, "crs")
    with_heights: list[str] = []
    objects = [_object(item, path, i, with_heights) for i, item in enumerate(collection.features)]
    if with_heights:
        logger.warning(
            "%s: the heights in the coordinates of %s are left out; the heights of an "
            "object are its properties z_min and z_max",
            path or "GeoJSON",
            counted(len(with_heights), "object"),
        )
    ids = collections.Counter(item.id for item in objects if item.id is not None)
    for number, count in ids.most_common(1):
        if count > 1:
            raise FormatError(
                f"the id {number} appears twice; features without ids get new ones",
                path=path,
                key="features",
            )
    return SemanticLayer(name or collection.name or "semantic", frame, objects)


def _is_way(feature: Any) -> bool:
    """Return whether a feature is an edge of a route graph, as `formats/nav2_routes` writes it."""
    properties = feature.get("properties") if isinstance(feature, dict) else None
    return isinstance(properties, dict) and properties.keys() >= {"startid", "endid"}


def _system(collection: _Collection) -> System | None:
    """Return the coordinate reference system that a collection names, as before RFC 7946."""
    if collection.crs is None:
        return None
    properties = collection.crs.get("properties")
    name = properties.get("name") if isinstance(properties, dict) else None
    return System.of_name(name if isinstance(name, str) else "a crs that is not known here")


def feature_of(item: SemanticObject) -> dict[str, Any]:
    """Return an object as a feature of GeoJSON, with its id as the feature's and as a property."""
    return {
        "type": "Feature",
        "id": item.id,
        "geometry": shapely.geometry.mapping(item.footprint),
        "properties": {
            "id": item.id,
            **_with_nulls_apart(plain_value(record_from_object(item), f"object {item.id}")),
        },
    }


def _with_nulls_apart(record: dict[str, Any]) -> dict[str, Any]:
    """Return a record with attributes that are null under the key `attributes`.

    GIS programs give each feature all properties of a file, as null where it has none; so a
    property that is null says nothing.
    """
    nulls = {key: None for key, value in record.items() if value is None}
    if not nulls:
        return record
    own = {key: value for key, value in record.items() if value is not None}
    return {**own, "attributes": {**own.get("attributes", {}), **nulls}}


def _object(raw: Any, path: str | None, position: int, with_heights: list[str]) -> SemanticObject:
    place = f"features[{position}]"
    feature = check(_Feature, raw, path, place)
    footprint, has_heights = _footprint(feature.geometry, path, f"{place}.geometry")
    if has_heights:
        with_heights.append(place)
    properties = {k: value for k, value in (feature.properties or {}).items() if value is not None}
    _check_names(properties, path, f"{place}.properties")
    if "id" not in properties and feature.id is not None:
        is_ours = type(feature.id) is int and 0 <= feature.id <= MAX_ID
        properties.setdefault("id" if is_ours else "feature_id", feature.id)
    try:
        return object_from_record(properties, footprint)
    except ValueError as error:
        raise FormatError(str(error), path=path, key=f"{place}.properties") from None


def _check_names(properties: Mapping[str, Any], path: str | None, place: str) -> None:
    """Say what to do with what other programs write: no name, and ids that are texts."""
    others = ", ".join(str(key) for key in list(properties)[:8])
    if "name" not in properties:
        hint = f"rename the property that has it (found: {others})" if others else "found none"
        why = f"is required, but missing: it is the class of the object; {hint}"
        raise FormatError(why, path=path, key=f"{place}.name")
    if isinstance(properties.get("id"), str):
        why = f"expected a whole number, found {found(properties['id'])}; rename the property"
        raise FormatError(f"{why}, to keep it as an attribute", path=path, key=f"{place}.id")


def _footprint(
    raw: Mapping[str, Any] | None, path: str | None, place: str
) -> tuple[BaseGeometry, bool]:
    """Return a footprint, and whether its coordinates had heights, which are left out."""
    if raw is None:
        raise FormatError("is missing; leave out features without one", path=path, key=place)
    if raw.get("type", _AREAS[0]) not in _AREAS:  # others may have no coordinates
        why = f"expected {' or '.join(_AREAS)}, found {found(raw['type'])}"
        hint = "objects have areas: put a buffer around points and lines"
        raise FormatError(f"{why}; {hint}", path=path, key=f"{place}.type")
    geometry = check(_Geometry, raw, path, place)
    try:
        with np.errstate(invalid="ignore"):  # of infinite coordinates, which are refused below
            shape: BaseGeometry = shapely.geometry.shape(geometry.model_dump())
        footprint = shapely.force_2d(shape)
        check_footprint(footprint)
    except _WRONG as e:
        raise FormatError(f"is not a valid {geometry.type}: {e}", path=path, key=place) from None
    return footprint, bool(shape.has_z)


def _refuse(constant: str) -> None:
    raise ValueError(f"{constant} is not a number")
