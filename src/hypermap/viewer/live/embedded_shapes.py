"""The shapes of a layer with all that is known of them, for a page that has no server."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import shapely

from hypermap.core.arrays import ObjectArray
from hypermap.core.frames import Pose2D
from hypermap.core.layer import Layer, ShapesPicture
from hypermap.core.objects import ObjectTable
from hypermap.core.semantic import SemanticLayer
from hypermap.core.shapes import valid_copies

_BLOT = 0.05  # m; what has no area is shown as a small blot, as in pictures


def embed_shapes(layer: Layer, base_T_layer: Pose2D) -> list[dict[str, Any]] | None:
    """Return the shapes of a layer in the base frame; None if it has none.

    Each has `id`, `name`, `polygons` (lists of rings, the outline first), `at` (a point inside,
    for its name), `centroid`, `area` and `attributes`. The shapes are those by which questions
    are answered: repaired, where an outline crosses itself.

    Args:
        layer: any layer.
        base_T_layer: pose of its frame in the base frame.
    """
    if isinstance(layer, SemanticLayer):
        table = layer.table
        attributes = [_attributes(table, row) for row in range(len(table))]
        ids, names, shapes = table.ids.tolist(), table.names, table.shapes
    else:
        picture = layer.picture()
        if not isinstance(picture, ShapesPicture):
            return None
        names, shapes = picture.names, valid_copies(picture.shapes)
        ids, attributes = list(range(len(names))), [{} for _ in names]
    placed = base_T_layer.apply_geometries(shapes)
    middles = shapely.centroid(placed)
    centroids = shapely.get_coordinates(middles)
    inside = np.asarray(shapely.covered_by(middles, placed))[:, np.newaxis]
    at = np.where(inside, centroids, shapely.get_coordinates(shapely.point_on_surface(placed)))
    columns = zip(
        ids,
        names.tolist(),
        _polygons(placed),
        at.tolist(),
        centroids.tolist(),
        shapely.area(placed).tolist(),
        attributes,
        strict=True,
    )
    keys = ("id", "name", "polygons", "at", "centroid", "area", "attributes")
    return [dict(zip(keys, values, strict=True)) for values in columns]


def _polygons(shapes: ObjectArray) -> list[list[list[Any]]]:
    """Return each shape's polygons, those as lists of rings, and those as lists of points."""
    without_area = shapely.area(shapes) == 0
    shapes = np.where(without_area, shapely.buffer(shapes, _BLOT * without_area), shapes)
    parts, shape_of = shapely.get_parts(shapes, return_index=True)
    rings, part_of = shapely.get_rings(parts, return_index=True)
    points, ring_of = shapely.get_coordinates(rings, return_index=True)
    starts = np.searchsorted(ring_of, np.arange(len(rings) + 1)).tolist()
    xy = points.tolist()
    by_part: list[list[Any]] = [[] for _ in parts]
    for ring, part in enumerate(part_of.tolist()):
        by_part[part].append(xy[starts[ring] : starts[ring + 1]])
    by_shape: list[list[list[Any]]] = [[] for _ in shapes]
    for part, shape in enumerate(shape_of.tolist()):
        if by_part[part]:  # what repairing left of a shape may hold lines too
            by_shape[shape].append(by_part[part])
    return by_shape


def _attributes(table: ObjectTable, row: int) -> dict[str, Any]:
    known: dict[str, Any] = {
        "existence": float(table.existence[row]),
        "first_seen": float(table.first_seen[row]),
        "last_seen": float(table.last_seen[row]),
        "tags": list(table.tags[row]),
        "confidence": list(table.confidence[row]),
    }
    known = {
        key: value
        for key, value in known.items()
        if (bool(value) if isinstance(value, list) else math.isfinite(value))
    }
    return {**as_json(table.attributes[row]), **known}


def as_json(value: Any) -> Any:
    """Return a value as JSON can hold it; what it cannot becomes text.

    >>> as_json({1: (float("nan"), None)})
    {'1': ['nan', None]}
    """
    if isinstance(value, Mapping):
        return {str(key): as_json(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [as_json(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    if value is None or isinstance(value, str | int | float | bool):
        return value
    return str(value)
