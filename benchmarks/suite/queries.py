"""Questions to a semantic layer, against boost::geometry in C++, GeoPandas and rtree.

Each side has its index built beforehand, and keeps areas and centroids as columns, so that what is
measured is the question alone. A question in C++ returns numbers in a vector; ours and those in
Python return arrays.
"""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from hypermap.core.semantic import SemanticLayer, SemanticObject
from suite.objects import Floor, floor
from suite.programs import build, run
from suite.query_peers import NEAREST, GeoPandasLayer, Peer, RtreeLayer, joined
from suite.race import (
    Disagreement,
    Figure,
    Group,
    Growth,
    Race,
    Row,
    Settings,
    each_of,
    race,
    seconds_of,
)

BULK, ONE_BY_ONE = 100_000, 1000
AREAS = ("1 m2", "100 m2", "a sixteenth of the map", "the whole map")
ONE_OF_MANY = 0.5  # the largest exponent for one object's question: without index, it is 1
LIKE_CPP, NEAR_CPP, FASTER = 1.0, 0.2, 3.0  # the ratios asked: bulk, single, Python libraries

Ids = NDArray[np.int64]


def rows(settings: Settings) -> Iterator[Row]:
    """Yield the rows of questions to layers of some sizes."""
    parts: dict[str, Group] = {}
    for count in (1000,) if settings.quick else (1000, 100_000):
        world = floor(count, BULK, moves=100 if settings.quick else 1000)
        size = f"{count:,} objects"
        parts[f"{size}, boost::geometry"] = partial(_against_boost, world)
        parts[f"{size}, GeoPandas"] = partial(_against_python, GeoPandasLayer, world)
        parts[f"{size}, rtree"] = partial(_against_python, RtreeLayer, world)
    million = 10_000 if settings.quick else 1_000_000
    parts[f"{million:,} objects"] = partial(_figures, million)
    parts["growth with objects"] = _growth
    yield from each_of(settings, parts)


# In C++


def _against_boost(world: Floor, settings: Settings) -> Iterator[Race]:
    program = build("boost/layer_queries.cpp", (), settings)
    folder = settings.build / f"floor-{len(world.shapes)}"
    world.write(folder)
    printed = run(program, folder, settings.repeat)
    peer = f"boost::geometry {printed['version']} (C++)"
    layer, size = world.layer(), f"among {len(world.shapes):,} objects"

    def against(
        name: str, work: str, ask: Callable[[], Ids], asked: float | None, calls: int = 1
    ) -> Race:
        agreement = same_ids(ask(), answer_of(folder, name))
        ours = tuple(seconds_of(ask)[0] / calls for _ in range(settings.repeat))
        theirs = tuple(seconds / calls for seconds in printed["seconds"][name])
        return Race(f"{work} {size}", peer, ours, theirs, agreement, asked)

    points = world.points
    yield against("points", f"{BULK:,} points", lambda: layer.value_at(points), LIKE_CPP)
    one = tuple(
        seconds_of(lambda: one_by_one(layer, points[:ONE_BY_ONE]))[0] / ONE_BY_ONE
        for _ in range(settings.repeat)
    )
    theirs = tuple(seconds / BULK for seconds in printed["seconds"]["points"])
    first = answer_of(folder, "points")[:ONE_BY_ONE]
    agreement = same_ids(one_by_one(layer, points[:ONE_BY_ONE]), first)
    yield Race(f"one point {size}", peer, one, theirs, agreement, NEAR_CPP)

    name = str(world.names[0])
    for number, (boxes, what) in enumerate(zip(world.areas, AREAS, strict=True)):
        areas, calls = np.asarray(shapely.box(*boxes.T)), len(boxes)
        ask = partial(in_areas, layer, areas)
        yield against(f"area{number}", f"an area of {what}", ask, NEAR_CPP, calls)
        ask = partial(named_in_areas, layer, areas, name)
        yield against(f"named{number}", f"a name in {what}", ask, NEAR_CPP, calls)
    yield against("name", "all of a name", lambda: named(layer, name), NEAR_CPP)
    ask = partial(nearest, layer, world.starts, name)
    calls = len(world.starts)
    yield against("nearest", f"the {NEAREST} nearest of a name", ask, NEAR_CPP, calls)
    yield _moves_against_boost(world, folder, printed, peer, settings)


def _moves_against_boost(
    world: Floor, folder: Path, printed: Any, peer: str, settings: Settings
) -> Race:
    layer = world.layer()
    layer.value_at(world.points[0])  # as over there, the index is built
    seconds: list[float] = []
    answers: list[Ids] = []
    for _ in range(settings.repeat):  # over there, too, each run begins where the last one ended
        passed, found = seconds_of(partial(move_and_ask, layer, world.moves))
        seconds.append(passed / len(world.moves))
        answers.append(found)
    return Race(
        f"move one and ask a point among {len(world.shapes):,} objects",
        peer,
        tuple(seconds),
        tuple(passed / len(world.moves) for passed in printed["seconds"]["moves"]),
        mostly_same_ids(answers[-1], answer_of(folder, "moves")),
    )


def answer_of(folder: Path, work: str) -> Ids:
    """Return what the program in C++ has answered."""
    return np.fromfile(folder / f"{work}.answer", dtype=np.int32).astype(np.int64)


# Ours: what is asked, with -1 between the answers to several questions


def one_by_one(layer: SemanticLayer, points: NDArray[np.float64]) -> Ids:
    """Return the id at each point, asked one after the other."""
    return np.array([layer.value_at(point)[0] for point in points], dtype=np.int64)


def in_areas(layer: SemanticLayer, areas: NDArray[np.object_]) -> Ids:
    """Return the ids in some areas."""
    return joined([layer.values_in(area).values for area in areas])


def named_in_areas(layer: SemanticLayer, areas: NDArray[np.object_], name: str) -> Ids:
    """Return the ids of a name in some areas."""
    now = layer.snapshot
    return joined([now.column("ids", now.rows_of(name, area)) for area in areas])


def named(layer: SemanticLayer, name: str) -> Ids:
    """Return the ids of a name, of the objects whose centroids are found."""
    now = layer.snapshot
    found = now.rows_of(name)
    now.column("centroids", found)
    return np.asarray(now.column("ids", found))


def nearest(layer: SemanticLayer, starts: NDArray[np.float64], name: str) -> Ids:
    """Return the ids of the nearest objects of a name from some points."""
    now = layer.snapshot
    return joined([now.column("ids", now.nearest(name, at, NEAREST)[0]) for at in starts])


def move_and_ask(layer: SemanticLayer, moves: NDArray[np.float64]) -> Ids:
    """Move one object after the other, and ask for each at its new centroid."""
    found = []
    for number, move in enumerate(moves):
        thing = layer.get(number % len(layer))
        moved = shapely.transform(thing.footprint, partial(np.add, move))
        layer.update(number % len(layer), SemanticObject(thing.name, moved))
        found.append(layer.value_at(shapely.get_coordinates(moved.centroid))[0])
    return np.array(found, dtype=np.int64)


def same_ids(ours: Ids, theirs: Ids) -> str:
    """Return that the ids are the same, in whatever order within one answer.

    Raises:
        Disagreement: If they are not.
    """
    if len(ours) != len(theirs) or not (_sorted(ours) == _sorted(theirs)).all():
        raise Disagreement(f"{len(ours):,} and {len(theirs):,} ids, which are not the same")
    return f"the same {np.count_nonzero(ours >= 0):,} ids"


def mostly_same_ids(ours: Ids, theirs: Ids) -> str:
    """Return how many ids are the same; in C++ a moved polygon is rounded otherwise.

    Raises:
        Disagreement: If more than one in a hundred differs.
    """
    same = float((ours == theirs).mean()) if len(ours) == len(theirs) else 0.0
    if same < 0.99:
        raise Disagreement(f"only {same:.1%} of the ids are the same")
    return f"{same:.1%} of {len(ours):,} ids the same"


def _sorted(ids: Ids) -> Ids:
    """Return ids in ascending order within each answer; -1 ends an answer."""
    answers: Ids = np.cumsum(ids < 0) - (ids < 0)
    return ids[np.lexsort((ids, ids < 0, answers))]


# In Python


def _against_python(
    peer: Callable[[Floor], Peer], world: Floor, settings: Settings
) -> Iterator[Race]:
    theirs, layer = peer(world), world.layer()
    size, name = f"among {len(world.shapes):,} objects", str(world.names[0])

    def against(
        work: str, ask: Callable[..., Ids], *arguments: Any, calls: int, times: int = 1
    ) -> Race:
        ours, other = partial(ask, layer, *arguments), getattr(theirs, ask.__name__)
        result = race(
            f"{work} {size}", theirs.version, ours, partial(other, *arguments), same_ids, settings,
            FASTER, times,
        )  # fmt: skip
        mine, others = ([second / calls for second in x] for x in (result.ours, result.theirs))
        return replace(result, ours=tuple(mine), theirs=tuple(others))

    few = world.points[:ONE_BY_ONE]
    if theirs.has_bulk:
        yield race(
            f"{BULK:,} points {size}", theirs.version, partial(layer.value_at, world.points),
            partial(theirs.value_at, world.points), same_ids, settings, FASTER,
        )  # fmt: skip
    yield against("one point", one_by_one, few, calls=len(few))
    for boxes, what in zip(world.areas, AREAS, strict=True):
        areas = np.asarray(shapely.box(*boxes.T))
        yield against(f"an area of {what}", in_areas, areas, calls=len(areas))
        yield against(f"a name in {what}", named_in_areas, areas, name, calls=len(areas))
    yield against("all of a name", named, name, calls=1, times=20)
    starts = world.starts[:10]
    yield against(f"the {NEAREST} nearest of a name", nearest, starts, name, calls=len(starts))
    few = world.moves[:20]
    yield against("move one and ask a point", move_and_ask, few, calls=len(few))


# Without a peer


def _figures(count: int, settings: Settings) -> Iterator[Figure]:
    world, size = floor(count, BULK), f"among {count:,} objects"
    layer = world.layer()
    first, _ = seconds_of(partial(layer.value_at, world.points))
    yield Figure(f"the first question {size}, which builds the index", (first,), "s")
    runs = [seconds_of(partial(layer.value_at, world.points))[0] for _ in range(settings.repeat)]
    bulk = tuple(1e6 * seconds / BULK for seconds in runs)
    yield Figure(f"a point among many {size}", bulk, "us", 5.0, less_is_better=True)
    few = world.points[:ONE_BY_ONE]
    runs = [seconds_of(partial(one_by_one, layer, few))[0] for _ in range(settings.repeat)]
    single = tuple(1e6 * seconds / len(few) for seconds in runs)
    yield Figure(f"one point {size}", single, "us", 30.0, less_is_better=True)
    others = world.points[ONE_BY_ONE:].reshape(-1, ONE_BY_ONE, 2)
    places = [others[run % len(others)] for run in range(settings.repeat)]
    runs = [seconds_of(partial(one_by_one, layer, new))[0] for new in places]
    first_time = tuple(1e6 * seconds / ONE_BY_ONE for seconds in runs)
    yield Figure(
        f"one point {size}, in places not asked about before",
        first_time,
        "us",
        30.0,
        less_is_better=True,
    )
    # So many that the log of changes is full once, and all objects are copied.
    rounds = count // 30
    change = partial(_add_move_remove, layer, world, _boxes(world), rounds)
    seconds, _ = seconds_of(change)
    note = f"{rounds:,} added, moved and removed, one by one, and {rounds:,} points asked between"
    yield Figure(
        f"a change of one object {size}",
        (1e6 * seconds / (3 * rounds),),
        "us",
        50.0,
        less_is_better=True,
        note=note,
    )


def _boxes(world: Floor) -> list[SemanticObject]:
    boxes = np.asarray(shapely.box(*world.points[:1000].T, *(world.points[:1000] + 0.5).T))
    return [SemanticObject("class 1", box) for box in boxes]


def _add_move_remove(
    layer: SemanticLayer, world: Floor, things: list[SemanticObject], rounds: int
) -> None:
    for number in range(rounds):
        (added,) = layer.add([things[number % 1000]])
        layer.update(number, things[(number + 1) % 1000])
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
        points.append(_median(partial(one_by_one, layer, world.points), settings) / ONE_BY_ONE)
        names.append(_median(partial(named, layer, name), settings))
        change = partial(_add_move_remove, layer, world, _boxes(world), rounds)
        changes.append(_median(change, settings) / (3 * rounds))
    yield Growth("one point", "objects", sizes, tuple(points), limit=ONE_OF_MANY)
    yield Growth("a change of one object", "objects", sizes, tuple(changes), limit=ONE_OF_MANY)
    yield Growth("all of a name, a fiftieth of all", "objects", sizes, tuple(names))


def _median(work: Callable[[], object], settings: Settings) -> float:
    return statistics.median(seconds_of(work)[0] for _ in range(settings.repeat))
