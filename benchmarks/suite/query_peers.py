"""Questions to objects as a user of Python would write them, with GeoPandas and with rtree."""

from __future__ import annotations

from functools import partial
from typing import Any, Protocol

import numpy as np
import shapely
from numpy.typing import NDArray

from suite.objects import Floor
from suite.race import library

Ids = NDArray[np.int64]
NEAREST = 10


class Peer(Protocol):
    """The same questions as to a layer of ours, by functions of the same names."""

    version: str
    has_bulk: bool

    def value_at(self, points: NDArray[np.float64]) -> Ids:
        """Return the smallest object at each of many points; -1 where there is none."""
        ...


class GeoPandasLayer:
    """A GeoDataFrame, its spatial index, and columns of areas and centroids.

    GeoPandas 1 asks the STRtree of shapely, which is in C++ and cannot change, so that a moved
    object means a new tree.
    """

    has_bulk = True

    def __init__(self, world: Floor) -> None:
        geopandas = library("geopandas")
        self.version = f"GeoPandas {geopandas.__version__} (Python)"
        self._frame: Any = geopandas.GeoDataFrame({"name": world.names}, geometry=world.shapes)
        self._areas = self._frame.area.to_numpy().copy()
        self._centroids = self._frame.centroid
        _ = self._frame.sindex

    def value_at(self, points: NDArray[np.float64]) -> Ids:
        """Return the smallest object at each of many points."""
        asked, found = self._frame.sindex.query(shapely.points(points), predicate="intersects")
        smallest = np.full(len(points), -1)
        order = np.lexsort((-found, -self._areas[found]))
        smallest[asked[order]] = found[order]
        return smallest

    def one_by_one(self, points: NDArray[np.float64]) -> Ids:
        """Return the smallest object at each point, asked one after the other."""
        return np.array([self._at(point) for point in points], dtype=np.int64)

    def _at(self, point: NDArray[np.float64]) -> int:
        found = self._frame.sindex.query(shapely.Point(point), predicate="intersects")
        return int(found[self._areas[found].argmin()]) if len(found) else -1

    def in_areas(self, areas: NDArray[np.object_]) -> Ids:
        """Return the objects in some areas, with their centroids."""
        return joined([self._in(area) for area in areas])

    def _in(self, area: shapely.Polygon) -> Ids:
        found: Ids = self._frame.sindex.query(area, predicate="intersects")
        self._centroids.iloc[found]
        return found

    def named_in_areas(self, areas: NDArray[np.object_], name: str) -> Ids:
        """Return the objects of a name in some areas."""
        names = self._frame["name"].to_numpy()
        answers = [self._in(area) for area in areas]
        return joined([found[names[found] == name] for found in answers])

    def named(self, name: str) -> Ids:
        """Return the objects of a name, with their centroids."""
        found = self._centroids[self._frame["name"] == name]
        return np.asarray(found.index, dtype=np.int64)

    def nearest(self, starts: NDArray[np.float64], name: str) -> Ids:
        """Return the nearest objects of a name from some points."""
        mine = self._frame[self._frame["name"] == name]
        answers = [mine.distance(shapely.Point(start)).nsmallest(NEAREST) for start in starts]
        return joined([np.asarray(found.index, dtype=np.int64) for found in answers])

    def move_and_ask(self, moves: NDArray[np.float64]) -> Ids:
        """Move one object after the other, and ask for each at its new centroid."""
        found = []
        for number, move in enumerate(moves):
            moved = shapely.transform(self._frame.geometry.iloc[number], partial(np.add, move))
            self._frame.loc[number, "geometry"] = moved
            self._areas[number] = moved.area
            found.append(self._at(shapely.get_coordinates(moved.centroid)[0]))
        return np.array(found, dtype=np.int64)


class RtreeLayer:
    """An index of boxes by rtree (libspatialindex in C++), and shapely for the shapes in them."""

    has_bulk = False

    def __init__(self, world: Floor) -> None:
        index = library("rtree.index")
        self.version = f"rtree {library('rtree').__version__} with shapely (Python)"
        self._shapes = world.shapes.copy()
        self._areas = np.asarray(shapely.area(self._shapes))
        self._centroids = shapely.get_coordinates(shapely.centroid(self._shapes))
        self._names = world.names
        boxes = shapely.bounds(self._shapes).tolist()
        self._index: Any = index.Index((i, box, None) for i, box in enumerate(boxes))

    def value_at(self, points: NDArray[np.float64]) -> Ids:
        """Return the smallest object at each of many points."""
        return self.one_by_one(points)

    def one_by_one(self, points: NDArray[np.float64]) -> Ids:
        """Return the smallest object at each point, asked one after the other."""
        return np.array([self._at(point) for point in points.tolist()], dtype=np.int64)

    def _at(self, point: list[float]) -> int:
        near = list(self._index.intersection((*point, *point)))
        if not near:
            return -1
        covering = [row for row in near if shapely.intersects_xy(self._shapes[row], *point)]
        return min(covering, key=lambda row: self._areas[row], default=-1)

    def in_areas(self, areas: NDArray[np.object_]) -> Ids:
        """Return the objects in some areas, with their centroids."""
        return joined([self._in(area) for area in areas])

    def _in(self, area: shapely.Polygon) -> Ids:
        near = np.fromiter(self._index.intersection(area.bounds), dtype=np.int64)
        shapely.prepare(area)
        found: Ids = near[shapely.intersects(area, self._shapes[near])]
        self._centroids[found]
        return found

    def named_in_areas(self, areas: NDArray[np.object_], name: str) -> Ids:
        """Return the objects of a name in some areas."""
        answers = [self._in(area) for area in areas]
        return joined([found[self._names[found] == name] for found in answers])

    def named(self, name: str) -> Ids:
        """Return the objects of a name, with their centroids."""
        found = np.flatnonzero(self._names == name)
        self._centroids[found]
        return found

    def nearest(self, starts: NDArray[np.float64], name: str) -> Ids:
        """Return the nearest objects of a name from some points; the index knows no names."""
        rows = np.flatnonzero(self._names == name)
        shapes = self._shapes[rows]
        distances = [shapely.distance(shapes, shapely.Point(start)) for start in starts]
        return joined([rows[np.argsort(far, kind="stable")[:NEAREST]] for far in distances])

    def move_and_ask(self, moves: NDArray[np.float64]) -> Ids:
        """Move one object after the other, and ask for each at its new centroid."""
        found = []
        for number, move in enumerate(moves):
            moved = shapely.transform(self._shapes[number], partial(np.add, move))
            self._index.delete(number, self._shapes[number].bounds)
            self._index.insert(number, moved.bounds)
            self._shapes[number], self._areas[number] = moved, moved.area
            found.append(self._at(shapely.get_coordinates(moved.centroid)[0].tolist()))
        return np.array(found, dtype=np.int64)


def joined(answers: list[Any]) -> Ids:
    """Return several answers as one, with -1 after each."""
    parts = [part for answer in answers for part in (answer, np.array([-1]))]
    return np.concatenate(parts).astype(np.int64)
