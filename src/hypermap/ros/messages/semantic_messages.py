"""Objects as messages: those of the first program, and new ones with all their data."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from hypermap.core.found import Found
from hypermap.core.objects import ObjectTable, SemanticObject
from hypermap.core.semantic import SemanticLayer
from hypermap.core.shapes import repaired
from hypermap.ros.messages.geometry_messages import (
    Message,
    Types,
    header,
    numbers,
    open_ring,
    outline,
    outlines,
    point,
    polygons_of,
    ring,
)
from hypermap.ros.ros1.arrays import WrittenList, takes_arrays, writing_arrays
from hypermap.ros.ros1.objects import written_objects


def semantic_map(layer: SemanticLayer, types: Types, stamp: int) -> Message:
    """Return a layer as `hypermap_msgs/SemanticMap`, in the layer's frame.

    An object's shape is the outer ring of its largest part; `object_state_array` carries all parts.
    """
    map_class = writing_arrays(types.message("hypermap_msgs/SemanticMap"))
    return map_class(
        header=header(layer.frame_id, types, stamp), objects=_objects(layer.table, types)
    )


def object_state_array(layer: SemanticLayer, types: Types, stamp: int) -> Message:
    """Return all that is known of a layer's objects as `hypermap_msgs/ObjectStateArray`."""
    table = layer.table
    objects = (table.object(row) for row in range(len(table)))
    return types.message("hypermap_msgs/ObjectStateArray")(
        header=header(layer.frame_id, types, stamp),
        objects=[
            _state(layer.name, item, centroid, types)
            for item, centroid in zip(objects, table.centroids.tolist(), strict=True)
        ],
    )


def object_states(found: Iterable[Found], types: Types) -> list[Message]:
    """Return what a question has found as `hypermap_msgs/ObjectState`; hits without object not."""
    return [
        _state(hit.layer, hit.object, hit.point_xy.tolist(), types)
        for hit in found
        if hit.object is not None
    ]


def semantic_objects(found: Iterable[Found], types: Types) -> Sequence[Message] | WrittenList:
    """Return what a question has found as `hypermap_msgs/SemanticObject`; like `object_states`.

    They are for a field of a message whose class `writing_arrays` has made.
    """
    objects = [hit.object for hit in found if hit.object is not None]
    return _objects(ObjectTable.of(objects), types)


def _objects(table: ObjectTable, types: Types) -> Sequence[Message] | WrittenList:
    """Return the rows of a table as `hypermap_msgs/SemanticObject`: on ROS 1, already written."""
    if takes_arrays(types.message("hypermap_msgs/SemanticObject")):
        return written_objects(table)
    points_xy, starts = outlines(table.footprints)
    columns = zip(
        table.ids.tolist(),
        np.split(points_xy, starts[1:-1]) if len(table) else [],
        table.centroids.tolist(),
        table.names,
        table.tags,
        table.confidence,
        strict=True,
    )
    return [
        _message(number, shape, position, name, tags, confidence, types)
        for number, shape, position, name, tags, confidence in columns
    ]


def _object(item: SemanticObject, position: Sequence[float], types: Types) -> Message:
    number = -1 if item.id is None else int(item.id)
    shape = outline(item.footprint)
    return _message(number, shape, position, item.name, item.tags, item.confidence, types)


def _message(
    number: int,
    shape: NDArray[np.float64],
    position: Sequence[float],
    name: str,
    tags: Sequence[str],
    confidence: Sequence[float],
    types: Types,
) -> Message:
    object_class = types.message("hypermap_msgs/SemanticObject")
    return object_class(
        id=number,
        shape=ring(shape, types),
        position=point(position[0], position[1], types),
        name=name,
        tags=[str(tag) for tag in tags],
        confidence=numbers(object_class, np.array(confidence, dtype=np.float64)),
    )


def _state(layer: str, item: SemanticObject, position: Sequence[float], types: Types) -> Message:
    shape = item.footprint if item.footprint.is_valid else repaired(item.footprint)
    return types.message("hypermap_msgs/ObjectState")(
        layer=layer,
        object=_object(item, position, types),
        parts=[polygon_with_holes(part, types) for part in polygons_of(item.footprint)],
        area=float(shape.area),
        existence=_or_nan(item.existence),
        first_seen=_or_nan(item.first_seen),
        last_seen=_or_nan(item.last_seen),
        attributes=json.dumps(_plain(item.attributes), ensure_ascii=False),
    )


def polygon_with_holes(polygon: shapely.Polygon, types: Types) -> Message:
    """Return a polygon as `hypermap_msgs/PolygonWithHoles`."""
    return types.message("hypermap_msgs/PolygonWithHoles")(
        exterior=ring(open_ring(polygon.exterior), types),
        holes=[ring(open_ring(hole), types) for hole in polygon.interiors],
    )


def _or_nan(number: float | None) -> float:
    return math.nan if number is None else float(number)


def _plain(value: Any) -> Any:
    """Return a value from YAML for JSON: types that JSON does not have become text."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple | set | frozenset):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value if isinstance(value, str | int | float | None) else str(value)
