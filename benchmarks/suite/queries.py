"""Questions to a semantic layer, against boost::geometry in C++, GeoPandas and rtree.

Each side has its index built beforehand, and keeps areas and centroids as columns, so that what is
measured is the question alone. All are asked the same, in turns, again and again for some 20 ms
each time, so that all have met the question before and find it in the processor's caches; each
keeps its answers until all of a call are there. Ours are asked as a user asks: points as [x, y],
areas as shapely polygons, by the functions of a layer. These return arrays, as those of the
libraries in Python do; in C++, the answers are numbers in a vector. A moved object's new shape is
made beforehand, and belongs to no side.
"""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from hypermap.core.layer import Hits
from hypermap.core.semantic import SemanticLayer, SemanticObject
from suite.objects import Change, Floor, floor
from suite.query_peers import (
    NEAREST,
    BoostLayer,
    GeoPandasLayer,
    Ids,
    Peer,
    Question,
    RtreeLayer,
    joined,
)
from suite.race import (
    Disagreement,
    Figure,
    Group,
    Growth,
    Race,
    Row,
    Settings,
    each_of,
    in_turns,
    run_of,
    seconds_of,
)

BULK, ONE_BY_ONE = 100_000, 1000
AREAS = ("1 m2", "100 m2", "a sixteenth of the map", "the whole map")
ONE_OF_MANY = 0.5  # the largest exponent for one object's question: without index, it is 1
LIKE_CPP, NEAR_CPP, FASTER = 1.0, 0.2, 3.0  # the ratios asked: bulk, single, Python libraries


def rows(settings: Settings) -> Iterator[Row]:
    """Yield the rows of questions to layers of some sizes."""
    parts: dict[str, Group] = {}
    for count in (1000,) if settings.quick else (1000, 100_000):
        world = floor(count, BULK, moves=100 if settings.quick else 1000)
        size = f"{count:,} objects"
        parts[f"{size}, boost::geometry"] = partial(_against, BoostLayer, world)
        parts[f"{size}, GeoPandas"] = partial(_against, GeoPandasLayer, world)
        parts[f"{size}, rtree"] = partial(_against, RtreeLayer, world)
    million = 10_000 if settings.quick else 1_000_000
    parts[f"{million:,} objects"] = partial(_figures, million)
    parts["growth with objects"] = _growth
    yield from each_of(settings, parts)


# Against others


def _against(
    peer: Callable[[Floor, Settings], Peer], world: Floor, settings: Settings
) -> Iterator[Race]:
    theirs = peer(world, settings)
    try:
        ours = Ours(world)
        for mine, other in zip(_questions(world, theirs), _questions(world, theirs), strict=True):
            agree = mostly_same_ids if mine.work == "moved" else same_ids
            agreement = agree(ours.answer(mine), theirs.answer(other))
            times = in_turns(ours.run(mine), theirs.run(other), settings)
            one, another = (tuple(passed / mine.each for passed in side) for side in times)
            work = f"{mine.what} among {len(world.shapes):,} objects"
            asked = _asked(mine.work) if peer is BoostLayer else FASTER
            yield Race(work, theirs.version, one, another, agreement, asked)
    finally:
        theirs.close()


def _asked(work: str) -> float | None:
    """Return the ratio to C++ that is asked."""
    return {"points": LIKE_CPP, "moved": None}.get(work, NEAR_CPP)


def _questions(world: Floor, peer: Peer) -> Iterator[Question]:
    """Yield what is asked; each time with shapes of its own, which shapely may prepare."""
    name = str(world.names[0])
    if peer.has_bulk:
        yield Question(f"{len(world.points):,} points", "points", (world.points,), 1)
    few = world.points[:ONE_BY_ONE].tolist()
    yield Question("one point", "point", (few,), len(few))
    for size, (boxes, what) in enumerate(zip(world.areas, AREAS, strict=True)):
        areas = list(np.asarray(shapely.box(*boxes.T)))
        yield Question(f"an area of {what}", "area", (areas,), len(areas), str(size))
        yield Question(f"a name in {what}", "named", (areas, name), len(areas), str(size))
    yield Question("all of a name", "name", (name,), 1)
    starts = world.starts.tolist()
    yield Question(f"the {NEAREST} nearest of a name", "nearest", (starts, name), len(starts))
    changes = world.changes(peer.moves)
    yield Question("move one and ask a point", "moved", (changes,), len(changes))


class Ours:
    """A layer of ours, asked by functions of the same names as the peers'."""

    def __init__(self, world: Floor) -> None:
        self._layer = world.layer()
        self._names = world.names.tolist()
        places = shapely.get_coordinates(shapely.centroid(world.shapes)).tolist()
        self._at = {(x, y): number for number, (x, y) in enumerate(places)}

    def answer(self, question: Question) -> Ids:
        """Return the ids asked for, with -1 after each answer."""
        return joined([self._ids(x) for x in getattr(self, question.work)(*question.asked)])

    def run(self, question: Question) -> Callable[[], float]:
        """Return what measures one run, in mean seconds of the whole question."""
        return run_of(partial(getattr(self, question.work), *question.asked))

    def _ids(self, answer: Any) -> Ids:
        """Return the ids that an answer holds, or those of the objects with its centroids."""
        if isinstance(answer, Hits):
            answer = answer.values
        elif isinstance(answer, tuple):
            answer = answer[0]
        if answer.ndim == 2:
            answer = np.array([self._at[x, y] for x, y in answer.tolist()], dtype=np.int64)
        return np.asarray(answer)

    def points(self, points: NDArray[np.float64]) -> list[Ids]:
        """Return the smallest object at each of many points."""
        return [self._layer.value_at(points)]

    def point(self, points: Sequence[list[float]]) -> list[Ids]:
        """Return the smallest object at each point, asked one after the other."""
        return [self._layer.value_at(point) for point in points]

    def area(self, areas: Sequence[shapely.Polygon]) -> list[Hits]:
        """Return the objects in some areas, with their centroids."""
        return [self._layer.values_in(area) for area in areas]

    def named(self, areas: Sequence[shapely.Polygon], name: str) -> list[NDArray[np.float64]]:
        """Return the objects of a name in some areas."""
        return [self._layer.find(name, area) for area in areas]

    def name(self, name: str) -> list[NDArray[np.float64]]:
        """Return the objects of a name."""
        return [self._layer.find(name)]

    def nearest(self, starts: Sequence[list[float]], name: str) -> list[Any]:
        """Return the nearest objects of a name from some points."""
        return [self._layer.nearest(name, start, NEAREST) for start in starts]

    def moved(self, changes: Sequence[Change]) -> list[Ids]:
        """Move one object after the other, and ask for each at its new centroid."""
        found = []
        for number, shape, at in changes:
            self._layer.update(number, SemanticObject(self._names[number], shape))
            found.append(self._layer.value_at(at))
        return found


def same_ids(ours: Ids, theirs: Ids) -> str:
    """Return that the ids are the same, in whatever order within one answer.

    Raises:
        Disagreement: If they are not.
    """
    if len(ours) != len(theirs) or not (_sorted(ours) == _sorted(theirs)).all():
        raise Disagreement(f"{len(ours):,} and {len(theirs):,} ids, which are not the same")
    return f"the same {np.count_nonzero(ours >= 0):,} ids"


def mostly_same_ids(ours: Ids, theirs: Ids) -> str:
    """Return how many of the answers, one id each, are the same.

    In C++ a centroid is rounded otherwise.

    Raises:
        Disagreement: If more than one in a hundred differs.
    """
    same = float((ours == theirs)[::2].mean()) if len(ours) == len(theirs) else 0.0
    if same < 0.99:
        raise Disagreement(f"only {same:.1%} of the ids are the same")
    return f"{same:.1%} of {len(ours) // 2:,} ids the same"


def _sorted(ids: Ids) -> Ids:
    """Return ids in ascending order within each answer; -1 ends an answer."""
    answers: Ids = np.cumsum(ids < 0) - (ids < 0)
    return ids[np.lexsort((ids, ids < 0, answers))]


# Without a peer


def _figures(count: int, settings: Settings) -> Iterator[Figure]:
    world, size = floor(count, BULK), f"among {count:,} objects"
    layer = world.layer()
    first, _ = seconds_of(partial(layer.value_at, world.points))
    yield Figure(f"the first question {size}, which builds the index", (first,), "s")

    def microseconds(work: str, runs: Sequence[float], calls: int, asked: float) -> Figure:
        values = tuple(1e6 * seconds / calls for seconds in runs)
        return Figure(f"{work} {size}", values, "us", asked, less_is_better=True)

    def times(work: Callable[[], object]) -> list[float]:
        run = run_of(work)
        return [run() for _ in range(settings.repeat)]

    runs = times(partial(layer.value_at, world.points))
    yield microseconds("a point among many", runs, BULK, 5.0)
    few = world.points[:ONE_BY_ONE].tolist()
    runs = times(partial(_one_by_one, layer, few))
    yield microseconds("one point", runs, ONE_BY_ONE, 30.0)
    others = world.points[ONE_BY_ONE:].reshape(-1, ONE_BY_ONE, 2)
    places = [others[run % len(others)].tolist() for run in range(settings.repeat)]
    runs = [seconds_of(partial(_one_by_one, layer, new))[0] for new in places]
    yield microseconds("one point, in places not asked about before,", runs, ONE_BY_ONE, 30.0)
    # So many that the log of changes is full once, and all objects are copied.
    rounds = count // 30
    change = partial(_add_move_remove, layer, world, _boxes(world), rounds)
    seconds, _ = seconds_of(change)
    figure = microseconds("a change of one object", [seconds], 3 * rounds, 50.0)
    note = f"{rounds:,} added, moved and removed, one by one, and {rounds:,} points asked between"
    yield replace(figure, note=note)


def _one_by_one(layer: SemanticLayer, points: Sequence[list[float]]) -> None:
    for point in points:
        layer.value_at(point)


def _boxes(world: Floor) -> list[SemanticObject]:
    boxes = np.asarray(shapely.box(*world.points[:1000].T, *(world.points[:1000] + 0.5).T))
    return [SemanticObject("class 1", box) for box in boxes]


def _add_move_remove(
    layer: SemanticLayer, world: Floor, things: list[SemanticObject], rounds: int
) -> None:
    for number in range(rounds):
        (added,) = layer.add([things[number % len(things)]])
        layer.update(number, things[(number + 1) % len(things)])
        layer.remove([added])
        layer.value_at(world.points[number % len(world.points)])


# How it grows


def _growth(settings: Settings) -> Iterator[Growth]:
    """Yield the time of single questions and changes, and of one with many answers."""
    sizes = tuple(10**power for power in range(2, 5 if settings.quick else 7))
    points: list[float] = []
    changes: list[float] = []
    names: list[float] = []
    for count in sizes:
        world, rounds = floor(count, ONE_BY_ONE), max(count // 30, 30)
        layer, name = world.layer(), str(world.names[0])
        layer.value_at(world.points)  # the index is built
        few = world.points.tolist()
        points.append(_median(partial(_one_by_one, layer, few), settings) / ONE_BY_ONE)
        names.append(_median(partial(layer.find, name), settings))
        change = partial(_add_move_remove, layer, world, _boxes(world), rounds)
        changes.append(_median(change, settings) / (3 * rounds))
    yield Growth("one point", "objects", sizes, tuple(points), limit=ONE_OF_MANY)
    yield Growth("a change of one object", "objects", sizes, tuple(changes), limit=ONE_OF_MANY)
    yield Growth("all of a name, a fiftieth of all", "objects", sizes, tuple(names))


def _median(work: Callable[[], object], settings: Settings) -> float:
    run = run_of(work)
    return statistics.median(run() for _ in range(settings.repeat))
