"""A layer's shapes as the page draws them: what the view needs, and no more."""

from __future__ import annotations

import functools
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import BoolArray, IntArray, ObjectArray
from hypermap.core.frames import Pose2D
from hypermap.core.layer import Layer, ShapesPicture
from hypermap.core.semantic import SemanticLayer
from hypermap.core.shapes import valid_copies

MOST = 5000
"""How many shapes are sent at once."""

_SMALLEST = 2  # pixels; what is smaller is sent as a point
_SHARPEST = 1e-4  # metres; no coordinate is told more exactly

Polygons = list[list[list[list[float]]]]


@dataclass(frozen=True, eq=False)
class LayerShapes:
    """The shapes of a layer in its own frame, as columns.

    Attributes:
        ids: shape (N,); in layers without ids, they are counted.
        names: shape (N,).
        shapes: valid geometries, shape (N,).
        areas: of the shapes [m^2], shape (N,).
        centroids: of the shapes [m], shape (N, 2).
    """

    ids: NDArray[np.int64]
    names: ObjectArray
    shapes: ObjectArray
    areas: NDArray[np.float64]
    centroids: NDArray[np.float64]

    @classmethod
    def of(cls, layer: Layer) -> LayerShapes | None:
        """Return the shapes of a layer that is drawn as shapes; None for others."""
        if isinstance(layer, SemanticLayer):
            table = layer.table
            return cls(table.ids, table.names, table.shapes, table.areas, table.centroids)
        picture = layer.picture()
        if not isinstance(picture, ShapesPicture):
            return None
        shapes = valid_copies(picture.shapes)
        centroids = shapely.get_coordinates(shapely.centroid(shapes))
        ids = np.arange(len(shapes))
        return cls(ids, picture.names, shapes, np.asarray(shapely.area(shapes)), centroids)

    @functools.cached_property
    def bounds(self) -> tuple[float, float, float, float]:
        """The box around all shapes [m]; NaN if there are none."""
        xmin, ymin, xmax, ymax = shapely.total_bounds(self.shapes)
        return float(xmin), float(ymin), float(xmax), float(ymax)

    @functools.cached_property
    def _tree(self) -> shapely.STRtree:
        return shapely.STRtree(self.shapes)

    def rows_in(self, area: BaseGeometry) -> IntArray:
        """Return the rows of the shapes that meet an area in the layer's frame; touching counts."""
        if len(self.ids) and area.covers(shapely.box(*self.bounds)):
            return np.arange(len(self.ids))
        return np.sort(self._tree.query(area, predicate="intersects"))

    def named(self, names: Collection[str]) -> BoolArray:
        """Return which shapes have one of some names, shape (N,)."""
        wanted = set(names)
        return np.fromiter((name in wanted for name in self.names), bool, len(self.names))

    def view(
        self,
        bbox: Sequence[float],
        resolution: float,
        base_T_layer: Pose2D,
        names: Collection[str] | None = None,
        most: int = MOST,
    ) -> dict[str, Any]:
        """Return what the page shows of a part of the map, the largest shapes first.

        Args:
            bbox: xmin, ymin, xmax, ymax in the base frame [m].
            resolution: side of a pixel of the screen [m]. Outlines are simplified by half of it,
                without crossing themselves; shapes smaller than two pixels become points.
            base_T_layer: pose of the layer's frame.
            names: which shapes; None for all.
            most: how many shapes at most.
        """
        xmin, ymin, xmax, ymax = bbox
        box = base_T_layer.inverse().apply_geometry(shapely.box(xmin, ymin, xmax, ymax))
        rows = self.rows_in(box)
        if names is not None:
            rows = rows[self.named(names)[rows]]
        total = len(rows)
        if total > most:
            rows = rows[np.argpartition(-self.areas[rows], most)[:most]]
        rows = rows[np.argsort(-self.areas[rows], kind="stable")]
        return {
            "total": total,
            "shown": len(rows),
            "features": self._features(rows, resolution, base_T_layer),
        }

    def polygons(self, row: int, base_T_layer: Pose2D) -> Polygons:
        """Return one shape exactly as it is, in the base frame: polygons of rings of points."""
        return _polygons(self.shapes[[row]], base_T_layer, decimals=None)[0]

    def label_points(self, rows: IntArray, base_T_layer: Pose2D) -> NDArray[np.float64]:
        """Return where names belong, in the base frame: the centroid if it lies inside, (N, 2)."""
        points = self.centroids[rows]
        outside = ~shapely.intersects_xy(self.shapes[rows], points[:, 0], points[:, 1])
        if outside.any():
            inner = shapely.point_on_surface(self.shapes[rows[outside]])
            points[outside] = shapely.get_coordinates(inner)
        return base_T_layer.apply(points)

    def _features(
        self, rows: IntArray, resolution: float, base_T_layer: Pose2D
    ) -> list[dict[str, Any]]:
        shapes = self.shapes[rows]
        boxes = shapely.bounds(shapes).reshape(-1, 4)
        sides = (boxes[:, 2:] - boxes[:, :2]).max(axis=1, initial=0)
        is_small = sides < _SMALLEST * resolution
        step = max(resolution / 4, _SHARPEST)
        decimals = max(0, int(np.ceil(-np.log10(step))))
        drawn = np.flatnonzero(~is_small)
        outlines = shapely.simplify(shapes[drawn], resolution / 2, preserve_topology=True)
        polygons = dict(
            zip(drawn.tolist(), _polygons(outlines, base_T_layer, decimals), strict=True)
        )
        points = np.round(self.label_points(rows, base_T_layer), decimals).tolist()
        features = []
        for i, (number, name, area, at) in enumerate(
            zip(
                self.ids[rows].tolist(),
                self.names[rows],
                np.round(self.areas[rows], 4).tolist(),
                points,
                strict=True,
            )
        ):
            outline = polygons.get(i)
            shape = {"polygons": outline} if outline else {"point": at}
            features.append({"id": number, "name": str(name), "at": at, "area": area, **shape})
        return features


def _polygons(shapes: ObjectArray, base_T_layer: Pose2D, decimals: int | None) -> list[Polygons]:
    """Return for each shape its polygons, each with its outline first, in the base frame."""
    found: list[Polygons] = [[] for _ in shapes]
    parts, owners = _parts(shapes)
    rings, parts_of_rings = shapely.get_rings(parts, return_index=True)
    coordinates = base_T_layer.apply(shapely.get_coordinates(rings))
    if decimals is not None:
        coordinates = np.round(coordinates, decimals)
    ends = np.cumsum(shapely.get_num_coordinates(rings)).tolist()
    points = coordinates.tolist()
    start, before = 0, -1
    for part, end in zip(parts_of_rings.tolist(), ends, strict=True):
        polygons = found[owners[part]]
        if part != before:
            polygons.append([])
        polygons[-1].append(points[start:end])
        start, before = end, part
    return found


def _parts(shapes: ObjectArray) -> tuple[ObjectArray, IntArray]:
    """Return the polygons that shapes consist of, and the position of each one's shape."""
    parts, owners = shapely.get_parts(shapes, return_index=True)
    again, positions = shapely.get_parts(parts, return_index=True)  # of a collection's parts
    is_polygon = shapely.get_type_id(again) == shapely.GeometryType.POLYGON
    return again[is_polygon], owners[positions[is_polygon]]
