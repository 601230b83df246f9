"""Questions to objects as others answer them: boost::geometry in C++, GeoPandas, and rtree.

The libraries of Python are used as who knows them would: all indices, areas, centroids and boxes
are made beforehand, and names are looked at before shapes are.
"""

from __future__ import annotations

import subprocess
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import shapely
from numpy.typing import NDArray

from suite.objects import Change, Floor
from suite.programs import build
from suite.race import Settings, library, run_of

Ids = NDArray[np.int64]
NEAREST = 10


@dataclass(frozen=True)
class Question:
    """What is asked of a layer again and again.

    Attributes:
        what: for the reader, as "an area of 1 m2".
        work: who answers has a function of this name.
        asked: what that is given.
        each: questions in it.
        size: number of the area's size; with `work`, the name of the work in C++.
    """

    what: str
    work: str
    asked: tuple[Any, ...]
    each: int
    size: str = ""


class Peer(Protocol):
    """Who answers the same questions as a layer of ours.

    Attributes:
        version: its name, version and language.
        has_bulk: whether it takes many points at once.
        moves: so many objects are moved.
    """

    version: str
    has_bulk: bool
    moves: int

    def answer(self, question: Question) -> Ids:
        """Return the ids asked for, with -1 after each answer."""
        ...

    def run(self, question: Question) -> Callable[[], float]:
        """Return what measures one run, in mean seconds of the whole question."""
        ...

    def close(self) -> None:
        """End what was begun."""
        ...


class BoostLayer:
    """The program in C++, which answers as long as it is asked."""

    has_bulk = True
    moves = 1000

    def __init__(self, world: Floor, settings: Settings) -> None:
        program = build("boost/layer_queries.cpp", (), settings)
        self._folder: Path = settings.build / f"floor-{len(world.shapes)}"
        world.write(self._folder)
        self._program = subprocess.Popen(
            [program, self._folder], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        self.version = f"boost::geometry {self._line()} (C++)"

    def answer(self, question: Question) -> Ids:
        """Return the ids asked for."""
        name = question.work + question.size
        self._seconds(name)
        return np.fromfile(self._folder / f"{name}.answer", dtype=np.int32).astype(np.int64)

    def run(self, question: Question) -> Callable[[], float]:
        """Return what measures one run."""
        return partial(self._seconds, question.work + question.size)

    def close(self) -> None:
        """End the program."""
        self._program.communicate()

    def _seconds(self, work: str) -> float:
        assert self._program.stdin is not None
        print(work, file=self._program.stdin, flush=True)
        return float(self._line())

    def _line(self) -> str:
        """Return the next line that the program prints.

        Raises:
            subprocess.CalledProcessError: If it has ended instead.
        """
        assert self._program.stdout is not None
        line = self._program.stdout.readline()
        if not line:
            raise subprocess.CalledProcessError(self._program.wait(), self._program.args)
        return line.strip()


class _InPython:
    """What the two in Python share: a function for each work, of the same name."""

    def answer(self, question: Question) -> Ids:
        """Return the ids asked for."""
        return joined(getattr(self, question.work)(*question.asked))

    def run(self, question: Question) -> Callable[[], float]:
        """Return what measures one run."""
        return run_of(partial(getattr(self, question.work), *question.asked))

    def close(self) -> None:
        """Do nothing."""


class GeoPandasLayer(_InPython):
    """A GeoDataFrame, its spatial index, and columns of areas and centroids.

    GeoPandas 1 asks the STRtree of shapely, which is in C++ and cannot change, so that a moved
    object means a new tree.
    """

    has_bulk = True
    moves = 10  # each takes milliseconds

    def __init__(self, world: Floor, _settings: Settings) -> None:
        geopandas = library("geopandas")
        self.version = f"GeoPandas {geopandas.__version__} (Python)"
        self._frame: Any = geopandas.GeoDataFrame({"name": world.names}, geometry=world.shapes)
        self._names = self._frame["name"].to_numpy()
        self._areas = self._frame.area.to_numpy().copy()
        self._centroids = self._frame.centroid
        _ = self._frame.sindex

    def points(self, points: NDArray[np.float64]) -> list[Ids]:
        """Return the smallest object at each of many points."""
        asked, found = self._frame.sindex.query(shapely.points(points), predicate="intersects")
        smallest = np.full(len(points), -1)
        order = np.lexsort((-found, -self._areas[found]))
        smallest[asked[order]] = found[order]
        return [smallest]

    def point(self, points: Sequence[list[float]]) -> list[int]:
        """Return the smallest object at each point, asked one after the other."""
        return [self._at(point) for point in points]

    def _at(self, point: list[float]) -> int:
        found = self._frame.sindex.query(shapely.Point(point), predicate="intersects")
        return int(found[self._areas[found].argmin()]) if len(found) else -1

    def area(self, areas: Sequence[shapely.Polygon]) -> list[Ids]:
        """Return the objects in some areas, with their centroids."""
        answers = []
        for area in areas:
            found = self._frame.sindex.query(area, predicate="intersects")
            self._centroids.iloc[found]
            answers.append(found)
        return answers

    def named(self, areas: Sequence[shapely.Polygon], name: str) -> list[Ids]:
        """Return the objects of a name in some areas, with their centroids."""
        answers = []
        for area in areas:
            found = self._frame.sindex.query(area, predicate="intersects")
            found = found[self._names[found] == name]
            self._centroids.iloc[found]
            answers.append(found)
        return answers

    def name(self, name: str) -> list[Ids]:
        """Return the objects of a name, with their centroids."""
        found = np.flatnonzero(self._names == name)
        self._centroids.iloc[found]
        return [found]

    def nearest(self, starts: Sequence[list[float]], name: str) -> list[Ids]:
        """Return the nearest objects of a name from some points."""
        mine = self._frame[self._names == name]
        answers = [mine.distance(shapely.Point(start)).nsmallest(NEAREST) for start in starts]
        return [found.index.to_numpy() for found in answers]

    def moved(self, changes: Sequence[Change]) -> list[int]:
        """Move one object after the other, and ask for each at its new centroid."""
        found = []
        for number, shape, at in changes:
            self._frame.loc[number, "geometry"] = shape
            self._areas[number] = shape.area
            found.append(self._at(at))
        return found


class RtreeLayer(_InPython):
    """An index of boxes by rtree (libspatialindex in C++), and shapely for the shapes in them."""

    has_bulk = False
    moves = 1000

    def __init__(self, world: Floor, _settings: Settings) -> None:
        index = library("rtree.index")
        self.version = f"rtree {library('rtree').__version__} with shapely (Python)"
        self._shapes = world.shapes.copy()
        self._names = world.names
        self._areas = np.asarray(shapely.area(self._shapes))
        self._centroids = shapely.get_coordinates(shapely.centroid(self._shapes))
        self._boxes = shapely.bounds(self._shapes).tolist()
        self._index: Any = index.Index((i, box, None) for i, box in enumerate(self._boxes))

    def point(self, points: Sequence[list[float]]) -> list[int]:
        """Return the smallest object at each point, asked one after the other."""
        return [self._at(point) for point in points]

    def _at(self, point: list[float]) -> int:
        near = list(self._index.intersection((*point, *point)))
        if not near:
            return -1
        covering = [row for row in near if shapely.intersects_xy(self._shapes[row], *point)]
        return min(covering, key=lambda row: self._areas[row], default=-1)

    def area(self, areas: Sequence[shapely.Polygon]) -> list[Ids]:
        """Return the objects in some areas, with their centroids."""
        return [self._meeting(area, self._near(area)) for area in areas]

    def named(self, areas: Sequence[shapely.Polygon], name: str) -> list[Ids]:
        """Return the objects of a name in some areas, with their centroids."""
        near = map(self._near, areas)
        mine = [rows[self._names[rows] == name] for rows in near]
        return [self._meeting(area, rows) for area, rows in zip(areas, mine, strict=True)]

    def _near(self, area: shapely.Polygon) -> Ids:
        return np.fromiter(self._index.intersection(area.bounds), dtype=np.int64)

    def _meeting(self, area: shapely.Polygon, near: Ids) -> Ids:
        shapely.prepare(area)
        found: Ids = near[shapely.intersects(area, self._shapes[near])]
        self._centroids[found]
        return found

    def name(self, name: str) -> list[Ids]:
        """Return the objects of a name, with their centroids."""
        found = np.flatnonzero(self._names == name)
        self._centroids[found]
        return [found]

    def nearest(self, starts: Sequence[list[float]], name: str) -> list[Ids]:
        """Return the nearest objects of a name from some points; the index knows no names."""
        rows = np.flatnonzero(self._names == name)
        shapes = self._shapes[rows]
        distances = [shapely.distance(shapes, shapely.Point(start)) for start in starts]
        return [rows[np.argsort(far, kind="stable")[:NEAREST]] for far in distances]

    def moved(self, changes: Sequence[Change]) -> list[int]:
        """Move one object after the other, and ask for each at its new centroid."""
        found = []
        for number, shape, at in changes:
            box = shape.bounds
            self._index.delete(number, self._boxes[number])
            self._index.insert(number, box)
            self._shapes[number], self._areas[number] = shape, shape.area
            self._boxes[number], self._centroids[number] = box, at
            found.append(self._at(at))
        return found


def joined(answers: Sequence[Any]) -> Ids:
    """Return several answers as one, with -1 after each."""
    parts = [part for answer in answers for part in (np.atleast_1d(answer), np.array([-1]))]
    return np.concatenate(parts).astype(np.int64)
