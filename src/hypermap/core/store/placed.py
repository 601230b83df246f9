"""Objects of several layers in one frame, and distances between them."""

from __future__ import annotations

import functools
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import BoolArray, IntArray, ObjectArray, as_objects
from hypermap.core.found import FoundObject
from hypermap.core.frames import Pose2D
from hypermap.core.store.kept_objects import KeptObjects

NO_OBJECT = -1
_ROWS = 2**32  # a key is layer * _ROWS + row


@dataclass(frozen=True, eq=False)
class Placed:
    """Shapes in one frame.

    Attributes:
        shapes: valid geometries, shape (N,).
        centroids: of the shapes [m], shape (N, 2).
        keys: a number for each object, int64, shape (N,); -1 for a geometry of the query.
    """

    shapes: ObjectArray
    centroids: NDArray[np.float64]
    keys: NDArray[np.int64]

    @classmethod
    def geometry(cls, geometry: BaseGeometry) -> Placed:
        """Return a geometry of a query, which is not an object; nothing if it is empty."""
        shapes = as_objects([] if geometry.is_empty else [geometry])
        centroids = shapely.get_coordinates(shapely.centroid(shapes))
        return cls(shapes, centroids, np.full(len(shapes), NO_OBJECT))

    def __len__(self) -> int:
        return len(self.keys)

    def take(self, rows: IntArray | BoolArray | slice) -> Placed:
        """Return some of the shapes."""
        return Placed(self.shapes[rows], self.centroids[rows], self.keys[rows])

    def followed_by(self, other: Placed) -> Placed:
        """Return the shapes of both."""
        return Placed(
            np.concatenate([self.shapes, other.shapes]),
            np.concatenate([self.centroids, other.centroids]),
            np.concatenate([self.keys, other.keys]),
        )

    def distances_to(self, others: Placed, limit: float) -> NDArray[np.float64]:
        """Return the distance from each shape to the nearest of the others that is not itself.

        Returns:
            Meters, shape (N,); infinite where there is none within the limit.
        """
        tree = shapely.STRtree(others.shapes)
        nearest = np.full(len(self), np.inf)
        with np.errstate(all="ignore"):  # GEOS divides by the lengths of edges without length
            if np.isfinite(limit):
                # Copies are not prepared: threads must not share prepared geometries.
                shapes = shapely.force_2d(self.shapes)
                pairs = tree.query(shapes, predicate="dwithin", distance=limit)
                self._measure(nearest, others, *pairs)
                return nearest
            self._measure(nearest, others, *tree.query_nearest(self.shapes))
            # These found only themselves. No other has their shape, so exclude equal shapes.
            alone = np.flatnonzero(np.isinf(nearest))
            here, there = tree.query_nearest(self.shapes[alone], exclusive=True)
            self._measure(nearest, others, alone[here], there)
        return nearest

    def _measure(
        self, nearest: NDArray[np.float64], others: Placed, here: IntArray, there: IntArray
    ) -> None:
        """Reduce distances, (N,), where pairs of a shape and another, (M,), are nearer."""
        other = ~self._same(here, others, there)
        here, there = here[other], there[other]
        np.minimum.at(nearest, here, shapely.distance(self.shapes[here], others.shapes[there]))

    def centroid_distances_to(self, others: Placed) -> NDArray[np.float64]:
        """Return the distance from each centroid to the other shape, shape (N,).

        Zeros if there is not exactly one other; used to break ties.
        """
        if len(others) != 1:
            return np.zeros(len(self))
        return np.asarray(shapely.distance(shapely.points(self.centroids), others.shapes[0]))

    def are_inside(self, others: Placed) -> BoolArray:
        """Return whether each shape's centroid is in one of the others that is not itself."""
        tree = shapely.STRtree(others.shapes)
        here, there = tree.query(shapely.points(self.centroids), predicate="intersects")
        inside = np.zeros(len(self), dtype=bool)
        inside[here[~self._same(here, others, there)]] = True
        return inside

    def _same(self, here: IntArray, others: Placed, there: IntArray) -> BoolArray:
        return np.asarray(self.keys[here] == others.keys[there])


@dataclass(frozen=True, eq=False)
class PlacedLayer:
    """The objects of a semantic layer at one moment, and the layer's pose in the base frame."""

    name: str
    store: KeptObjects
    base_T_layer: Pose2D

    def rows(self, names: Collection[str] | None, area: BaseGeometry | None) -> IntArray:
        """Return the rows of objects with one of some names that meet an area in the base frame.

        Args:
            names: None for any.
            area: None for everywhere.
        """
        asked = None if area is None else self.base_T_layer.inverse().apply_geometry(area)
        if names is not None:
            return self.store.with_names(names, asked)
        return self.store.rows if asked is None else self.store.in_area(asked)

    def column(self, name: str, rows: IntArray) -> NDArray[Any]:
        """Return a column of `ObjectTable`, or `names`, for some rows."""
        return self.store.names(rows) if name == "names" else self.store.column(name, rows)

    def found(self, rows: IntArray, distances: Sequence[float | None]) -> list[FoundObject]:
        """Return some objects, transformed into the base frame."""
        table = self.store.take(rows)
        points = self.base_T_layer.apply(table.centroids)
        table = replace(table, footprints=self.base_T_layer.apply_geometries(table.footprints))
        columns = zip(points, distances, range(len(table)), strict=True)
        return [
            FoundObject(self.name, point, far, object=table.object(row))
            for point, far, row in columns
        ]

    def at(self, point_xy: NDArray[np.float64]) -> list[FoundObject]:
        """Return all objects at a point in the base frame, the smallest first."""
        rows = self.store.all_at(self.base_T_layer.inverse().apply(point_xy)[0])
        return self.found(rows, [None] * len(rows))

    def nearest(
        self, what: str | float, point_xy: NDArray[np.float64], k: int
    ) -> list[FoundObject]:
        """Return the k objects with a name or id that are nearest to a point in the base frame."""
        point = self.base_T_layer.inverse().apply(point_xy)[0]
        rows, distances = self.store.nearest(what, point, k)
        return self.found(rows, distances.tolist())


class PlacedLayers:
    """The objects of several layers in one frame."""

    def __init__(self, layers: Sequence[PlacedLayer]) -> None:
        self._layers = layers

    def named(
        self,
        names: Collection[str] | None,
        layer: str | None = None,
        area: BaseGeometry | None = None,
    ) -> Placed:
        """Return the objects that meet all conditions, in order.

        Args:
            names: one of which they have; None for any.
            layer: the name of their layer; None for all.
            area: an area in the base frame that they meet; None for everywhere.
        """
        placed = [
            _placed(i, place, place.rows(names, area))
            for i, place in enumerate(self._layers)
            if layer in (None, place.name)
        ]
        nothing = Placed(as_objects([]), np.empty((0, 2)), np.empty(0, dtype=np.int64))
        return functools.reduce(Placed.followed_by, placed, nothing)

    def are_of(self, layer: str, keys: NDArray[np.int64]) -> BoolArray:
        """Return whether each of the objects with these keys, shape (N,), is in a layer."""
        numbers = [number for number, place in enumerate(self._layers) if place.name == layer]
        return np.isin(keys // _ROWS, numbers)

    def have_tags(self, keys: NDArray[np.int64], tags: set[str]) -> BoolArray:
        """Return whether each of the objects with these keys, shape (N,), has all the tags."""
        places = zip(*(part.tolist() for part in np.divmod(keys, _ROWS)), strict=True)
        own = (self._layers[number].store.object(row).tags for number, row in places)
        return np.fromiter((tags.issubset(texts) for texts in own), dtype=bool, count=len(keys))

    def column(self, name: str, keys: NDArray[np.int64]) -> NDArray[Any]:
        """Return a column of `ObjectTable`, or `names`, for the objects with these keys, (N,)."""
        numbers, rows = np.divmod(keys, _ROWS)
        parts = [np.flatnonzero(numbers == number) for number in range(len(self._layers))]
        columns = [
            layer.column(name, rows[part]) for layer, part in zip(self._layers, parts, strict=True)
        ]
        if len(columns) == 1:
            return columns[0]
        values = np.empty(len(keys), dtype=np.result_type(*columns) if columns else object)
        for part, column in zip(parts, columns, strict=True):
            values[part] = column
        return values

    def found(
        self, keys: NDArray[np.int64], distances: NDArray[np.float64] | None = None
    ) -> list[FoundObject]:
        """Return the objects with these keys, shape (N,), in this order.

        Args:
            keys: as in `Placed`.
            distances: of each object, shape (N,) [m]; None if the query has no distance.
        """
        far = as_objects([None] * len(keys) if distances is None else distances.tolist())
        numbers, rows = np.divmod(keys, _ROWS)
        found = np.empty(len(keys), dtype=object)
        for number, layer in enumerate(self._layers):
            here = np.flatnonzero(numbers == number)
            found[here] = as_objects(layer.found(rows[here], far[here].tolist()))
        return list(found)


@dataclass(frozen=True, eq=False)
class Matches:
    """The objects in the answer to a query, in order; as columns, which are fast for many.

    Attributes:
        layers: their layers.
        placed: their shapes in the base frame, and a key of each.
        distances: of each [m]; None if the query has no distance.
    """

    layers: PlacedLayers
    placed: Placed
    distances: NDArray[np.float64] | None = None

    @classmethod
    def of_shapes(cls, shapes: ObjectArray) -> Matches:
        """Return shapes of a question in the base frame, which are not objects of a map."""
        centroids = shapely.get_coordinates(shapely.centroid(shapes))
        keys = np.full(len(shapes), NO_OBJECT, dtype=np.int64)
        return cls(PlacedLayers([]), Placed(shapes, centroids, keys))

    def __len__(self) -> int:
        return len(self.placed)

    @property
    def shapes(self) -> ObjectArray:
        """Their shapes in the base frame, shape (N,)."""
        return self.placed.shapes

    @property
    def centroids(self) -> NDArray[np.float64]:
        """Where they are in the base frame [m], shape (N, 2)."""
        return self.placed.centroids

    @property
    def keys(self) -> NDArray[np.int64]:
        """A number that identifies an object of the map, int64, shape (N,); -1 for none."""
        return self.placed.keys

    def take(self, rows: IntArray | BoolArray | slice) -> Matches:
        """Return some of them, in the order of the rows."""
        far = None if self.distances is None else self.distances[rows]
        return Matches(self.layers, self.placed.take(rows), far)

    def with_distances(self, distances: NDArray[np.float64]) -> Matches:
        """Return the same with other distances [m], shape (N,)."""
        return Matches(self.layers, self.placed, distances)

    def distances_to(self, others: Matches, limit: float = np.inf) -> NDArray[np.float64]:
        """Return the distance from each to the nearest of the others that is not itself.

        Returns:
            Meters, shape (N,); infinite where there is none within the limit [m].
        """
        return self.placed.distances_to(others.placed, limit)

    def centroid_distances_to(self, others: Matches) -> NDArray[np.float64]:
        """Return the distance from each centroid to the only other; zeros if there are several."""
        return self.placed.centroid_distances_to(others.placed)

    def column(self, name: str) -> NDArray[Any]:
        """Return a column of `ObjectTable` or `names` for these objects, shape (N,)."""
        return self.layers.column(name, self.keys)

    def are_of(self, layer: str) -> BoolArray:
        """Return which of them are in a layer, shape (N,)."""
        return self.layers.are_of(layer, self.keys)

    def have_tags(self, tags: set[str]) -> BoolArray:
        """Return which of them have all these tags, shape (N,)."""
        return self.layers.have_tags(self.keys, tags)

    def first(self, count: int | None = None) -> list[FoundObject]:
        """Return the first `count` objects; None for all."""
        far = None if self.distances is None else self.distances[:count]
        return self.layers.found(self.keys[:count], far)


def _placed(number: int, layer: PlacedLayer, rows: IntArray) -> Placed:
    return Placed(
        layer.base_T_layer.apply_geometries(layer.store.column("shapes", rows)),
        layer.base_T_layer.apply(layer.store.column("centroids", rows)),
        number * _ROWS + rows,
    )
