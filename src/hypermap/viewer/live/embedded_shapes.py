"""The shapes of a layer with all that is known of them, for a page that has no server."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import shapely

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
    centroids = shapely.get_coordinates(shapely.centroid(placed))
    inside = np.asarray(shapely.covers(placed, shapely.centroid(placed)))
    at = np.where(
        inside[:, np.newaxis],
        centroids,
        shapely.get_coordinates(shapely.point_on_surface(placed)),
    )
    return [
        {
            "id": ids[row],
            "name": str(names[row]),
            "polygons": _polygons(placed[row]),
            "at": at[row].tolist(),
            "centroid": centroids[row].tolist(),
            "area": float(shapely.area(placed[row])),
            "attributes": attributes[row],
        }
        for row in range(len(names))
    ]


def _polygons(shape: Any) -> list[list[list[list[float]]]]:
    if shapely.area(shape) == 0:
        shape = shape.buffer(_BLOT)
    return [
        [shapely.get_coordinates(ring).tolist() for ring in shapely.get_rings(part)]
        for part in shapely.get_parts(shape)
        if isinstance(part, shapely.Polygon)
    ]


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
    return {**{str(key): value for key, value in table.attributes[row].items()}, **known}
