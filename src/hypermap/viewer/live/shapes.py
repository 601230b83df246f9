"""A layer's shapes as the page draws them, at the level of detail of the viewport."""

from __future__ import annotations

import functools
import math
import threading
from collections import OrderedDict
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import BoolArray, IntArray, ObjectArray
from hypermap.core.frames import Pose2D
from hypermap.core.layer import Layer, ShapesPicture
from hypermap.core.semantic import SemanticLayer
from hypermap.core.shapes import have_points, valid_copies
from hypermap.viewer.live.json_text import json_bytes
from hypermap.viewer.live.tiles import FINEST

MOST = 5000
"""The maximum number of shapes in one response."""

_SMALLEST = 2  # pixels; what is smaller is sent as a point
_ZOOMS_KEPT = 6  # of what was sent
_SHARPEST = 1e-4  # meters; the finest precision of a coordinate

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

    _kept: OrderedDict[tuple[int, Pose2D], dict[int, bytes]] = field(default_factory=OrderedDict)
    _keeping: threading.Lock = field(default_factory=threading.Lock)

    @functools.cached_property
    def bounds(self) -> tuple[float, float, float, float]:
        """The box around all shapes [m]; NaN if there are none."""
        xmin, ymin, xmax, ymax = shapely.total_bounds(self.shapes)
        return float(xmin), float(ymin), float(xmax), float(ymax)

    @functools.cached_property
    def _sizes(self) -> NDArray[np.float64]:
        """The areas; of equal ones, which a detector's boxes often are, any row may be the largest.

        Else those that are left out would lie in one corner of the map, which looked empty.
        """
        scattered = np.arange(len(self.ids)) * 2654435761 % 2**32 / 2**32
        return self.areas.astype(np.float32) * (1 + 1e-8 * scattered)

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
    ) -> bytes:
        """Return what the page shows of a part of the map as JSON, the largest shapes first.

        Outlines are simplified by half a pixel, without crossing themselves, and shapes smaller
        than two become points. That pixel is the screen's, or that of the next finer zoom: what
        was made for a zoom is kept, so that moving the view costs little.

        Args:
            bbox: xmin, ymin, xmax, ymax in the base frame [m].
            resolution: side of a pixel of the screen [m].
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
            rows = rows[np.argpartition(-self._sizes[rows], most)[:most]]
        rows = rows[np.argsort(-self.areas[rows], kind="stable")]
        zoom = math.floor(math.log2(resolution / FINEST) + 1e-9)
        features = b",".join(self._features(rows, zoom, base_T_layer))
        return b'{"total":%d,"shown":%d,"features":[%b]}' % (total, len(rows), features)

    def polygons(self, row: int, base_T_layer: Pose2D) -> Polygons:
        """Return one shape exactly as it is, in the base frame: polygons of rings of points."""
        return polygons_in_base(self.shapes[[row]], base_T_layer, decimals=None)[0]

    def label_points(self, rows: IntArray, base_T_layer: Pose2D) -> NDArray[np.float64]:
        """Return where names belong, in the base frame: the centroid if it is inside, (N, 2)."""
        points = self.centroids[rows]
        outside = ~have_points(self.shapes[rows], points)
        if outside.any():
            inner = shapely.point_on_surface(self.shapes[rows[outside]])
            points[outside] = shapely.get_coordinates(inner)
        return base_T_layer.apply(points)

    def _features(self, rows: IntArray, zoom: int, base_T_layer: Pose2D) -> list[bytes]:
        """Return rows as the page reads them at a zoom, from what is kept or made now."""
        with self._keeping:
            key = (zoom, base_T_layer)
            texts = self._kept.setdefault(key, {})
            self._kept.move_to_end(key)
            if len(self._kept) > _ZOOMS_KEPT:
                self._kept.popitem(last=False)
        wanted = rows.tolist()
        missing = [row for row in wanted if row not in texts]
        made = self._made(np.array(missing, dtype=np.int64), math.ldexp(FINEST, zoom), base_T_layer)
        texts.update(zip(missing, made, strict=True))
        return [texts[row] for row in wanted]

    def _made(self, rows: IntArray, pixel: float, base_T_layer: Pose2D) -> Iterator[bytes]:
        """Yield rows as JSON, for a pixel of some side [m]."""
        shapes = self.shapes[rows]
        boxes = shapely.bounds(shapes).reshape(-1, 4)
        sides = (boxes[:, 2:] - boxes[:, :2]).max(axis=1, initial=0)
        drawn = np.flatnonzero(sides >= _SMALLEST * pixel)
        decimals = max(0, math.ceil(-math.log10(max(pixel / 4, _SHARPEST))))
        outlines = shapely.simplify(shapes[drawn], pixel / 2, preserve_topology=True)
        polygons: list[Polygons] = [[] for _ in shapes]
        found = polygons_in_base(outlines, base_T_layer, decimals)
        for i, outline in zip(drawn.tolist(), found, strict=True):
            polygons[i] = outline
        columns = zip(
            self.ids[rows].tolist(),
            self.names[rows],
            np.round(self.areas[rows], 4).tolist(),
            np.round(self.label_points(rows, base_T_layer), decimals).tolist(),
            polygons,
            strict=True,
        )
        for number, name, area, at, outline in columns:
            shape = {"polygons": outline} if outline else {"point": at}
            yield json_bytes({"id": number, "name": str(name), "at": at, "area": area, **shape})


def polygons_in_base(
    shapes: ObjectArray, base_T_layer: Pose2D, decimals: int | None
) -> list[Polygons]:
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
