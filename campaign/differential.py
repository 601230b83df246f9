"""Differential: random maps and questions, against a slow oracle and what was answered before."""

from __future__ import annotations

import itertools
import math
import random
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from campaign import golden
from campaign.oracle import EPSILON, Grid, Oracle, Pose, Thing, Things, label
from campaign.part import Budget, Finding, Result
from campaign.random_things import NAMES, RandomThings
from hypermap import (
    FrameTree,
    GridGeometry,
    Hypermap,
    OccupancyLayer,
    Pose2D,
    SemanticLayer,
    SemanticObject,
    Transform,
    open_map,
    save_map,
)
from hypermap.core.hypermap import ROOMS
from hypermap.questions import Condition, Query, Reference, ask
from hypermap.questions.sizes import size_of_object

SHORT_WORLDS = 4
QUESTIONS = 8  # of each kind, to each state of a world
CHANGES = 4  # of each world; after each, all is asked again


class Wrong(Exception):
    """An answer is not the oracle's."""


def run(budget: Budget) -> Result:
    """Ask worlds until the time is over; the short form asks some."""
    findings: list[Finding] = []
    asked = worlds = changes = 0
    slowest = 0.0
    seed = budget.seed
    while worlds < SHORT_WORLDS if budget.short else not budget.is_over:
        started = time.monotonic()
        world = World(seed)
        try:
            world.ask_and_change()
        except Wrong as error:
            findings.append(Finding(f"world {seed}: {error}", seed))
        except Exception as error:
            findings.append(Finding(f"world {seed}: {type(error).__name__}: {error}", seed))
        asked, worlds, changes = asked + world.asked, worlds + 1, changes + world.changes
        slowest = max(slowest, time.monotonic() - started)
        seed += 1
    differences = golden.differences()
    findings += [Finding(f"golden answers: {text}", budget.seed) for text in differences]
    figures: dict[str, float | str] = {
        "worlds": worlds,
        "changes": changes,
        "golden answers": golden.count(),
        "slowest": f"{slowest:.2f} s (a world)",
    }
    return Result("differential", asked + golden.count(), findings, figures)


class World:
    """A random map, twice: for the program and for the oracle.

    Attributes:
        asked: how many questions were asked.
        changes: how often it was changed.
    """

    def __init__(self, seed: int) -> None:
        self.asked = self.changes = 0
        self._draw = random.Random(seed)
        self._drawn = RandomThings(self._draw, is_lattice=seed % 4 == 0)
        self._next: dict[str, int] = {}
        self.oracle, self.hypermap = self._made()

    def ask_and_change(self) -> None:
        """Ask all kinds of questions, change something, ask again, save, open, ask again.

        Raises:
            Wrong: If an answer is not the oracle's.
        """
        self._ask()
        for _ in range(CHANGES):
            self._change()
            self.oracle.changed()
            self.changes += 1
            self._ask()
        with tempfile.TemporaryDirectory() as folder:
            form = self._draw.choice(["yaml", "parquet"])
            save_map(self.hypermap, Path(folder) / "map.hmap", form)  # type: ignore[arg-type]
            self.hypermap = open_map(Path(folder) / "map.hmap")
        self._ask()

    # The map

    def _made(self) -> tuple[Oracle, Hypermap]:
        draw = self._draw
        poses: dict[str, Pose] = {"map": (0.0, 0.0, 0.0)}
        transforms = []
        for frame in ("lab", "attic")[: draw.randrange(3)]:
            parent = draw.choice(list(poses))
            pose = self._drawn.pose()
            transforms.append(Transform(parent, frame, Pose2D(*pose)))
            poses[frame] = _combined(poses[parent], pose)
        layers: list[Grid | Things] = []
        made: list[Any] = []
        for number in range(draw.randrange(1, 5)):
            frame = "map" if number == 0 else draw.choice(list(poses))
            if draw.random() < 0.4:
                grid = self._drawn.grid(f"grid {number}", frame)
                layers.append(grid)
                made.append(_layer_of(grid))
            else:
                things = [self._drawn.thing(i) for i in range(draw.choice([0, 1, 5, 20, 60]))]
                layer = Things(f"things {number}", frame, things)
                layers.append(layer)
                objects = [_object_of(thing) for thing in things]
                made.append(SemanticLayer(layer.name, frame, objects))
                self._next[layer.name] = len(things)
        margin = 0.0 if self._drawn.is_lattice else EPSILON
        return Oracle(layers, poses, margin), Hypermap(made, FrameTree(transforms))

    def _change(self) -> None:
        """Add, replace, rename or remove objects, or put another grid in place of one."""
        draw = self._draw
        chosen = draw.choice(self.oracle.layers)
        if isinstance(chosen, Grid):
            new = self._drawn.grid(chosen.name, chosen.frame)
            self.oracle.layers[self.oracle.layers.index(chosen)] = new
            self.hypermap = self.hypermap.with_layer(_layer_of(new))
            return
        layer = self.hypermap[chosen.name]
        assert isinstance(layer, SemanticLayer)
        things, kind = chosen.things, draw.randrange(4)
        if kind == 0 or not things:
            added = [
                self._drawn.thing(self._next[chosen.name] + i) for i in range(draw.choice([1, 9]))
            ]
            self._next[chosen.name] += len(added)
            things += added
            given = layer.add([_object_of(thing) for thing in added])
            if given != [thing.number for thing in added]:
                raise Wrong(f"ids {given} were given, not those that follow")
        elif kind == 1:
            some = draw.sample(range(len(things)), min(3, len(things)))
            for place in some:
                things[place] = self._drawn.thing(things[place].number)
            layer.update_many({things[i].number: _object_of(things[i]) for i in some})
        elif kind == 2:
            thing = draw.choice(things)
            thing.name = draw.choice(NAMES)
            layer.rename(thing.number, thing.name)
        else:
            gone = draw.sample(things, min(2, len(things)))
            layer.remove([thing.number for thing in gone])
            chosen.things = [thing for thing in things if thing not in gone]

    # Questions

    def _ask(self) -> None:
        for layer in self.oracle.layers:
            for question in (self._at, self._in, self._find, self._nearest):
                for _ in range(QUESTIONS):
                    question(layer)
                    self.asked += 1
        for _ in range(QUESTIONS):
            self._objects()
            self._objects_at()
            self._same_room()
            self._sizes()
            self.asked += 4

    def _known_frame(self) -> str | None:
        """Return a frame that a question may be asked in; None is the map's base frame."""
        known = {layer.frame for layer in self.oracle.layers}
        known |= {name for one in self.hypermap.frames for name in (one.parent, one.child)}
        return self._draw.choice([None, *sorted(known)])

    def _area(self) -> tuple[str, BaseGeometry]:
        """Return an area: a box, a polygon or a circle."""
        draw = self._draw
        x, y = self._drawn.place()
        kind = draw.choice(["box", "polygon", "circle"])
        if kind == "box":
            w, h = (draw.randrange(1, 20) / 4 for _ in range(2))
            return kind, shapely.box(x, y, x + w, y + h)
        if kind == "polygon":
            return kind, self._drawn.shape(5.0)
        return kind, shapely.Point(x, y).buffer(draw.choice([0.25, 1.0, 4.0]))

    def _at(self, layer: Grid | Things) -> None:
        frame = self._known_frame()
        points = [self._drawn.place() for _ in range(self._draw.choice([1, 1, 7]))]
        values = self.hypermap.value_at(layer.name, points, frame).tolist()
        labels = self.hypermap.label_at(layer.name, points, frame).tolist()
        for point, value, said in zip(points, values, labels, strict=True):
            at = self.oracle.point_in_base(point, frame or "map")
            may = self.oracle.values_at(layer, at.x, at.y)
            what = f"{layer.name!r} at {point} in {frame}"
            _require(value in may, f"{what}: {value}, not one of {may}")
            _require(said == _label(layer, value), f"{what}: {said!r} for {value}")

    def _in(self, layer: Grid | Things) -> None:
        kind, area = self._area()
        frame = self._known_frame()
        in_base = self.oracle.in_base(area, frame or "map")
        bracket = self.oracle.inside(layer, in_base)
        values = self.hypermap.values_in(layer.name, area, frame)
        labels = self.hypermap.labels_in(layer.name, area, frame)
        what = f"{layer.name!r} in a {kind} {area.wkt} in {frame}"
        found = list(self._rows(layer, values.points_xy, values.values, what))
        _require(bracket.holds(found), f"{what}: {_difference(found, bracket)}")
        for value, said in zip(values.values.tolist(), labels.values.tolist(), strict=True):
            _require(said == _label(layer, value), f"{what}: {said!r} for {value}")

    def _find(self, layer: Grid | Things) -> None:
        what, frame = self._what(layer), self._known_frame()
        area = self._area()[1] if self._draw.random() < 0.6 else None
        rows = self.oracle.called(layer, what)
        if area is None:
            sure, may = frozenset(rows), frozenset(rows)
        else:
            bracket = self.oracle.inside(layer, self.oracle.in_base(area, frame or "map"))
            sure, may = bracket.sure & rows, bracket.possible & rows
        points = self.hypermap.find(layer.name, what, area, frame)
        expected = self._locations(layer)
        text = f"find {what!r} in {layer.name!r}, {area and area.wkt} in {frame}"
        _require(len(sure) <= len(points) <= len(may), f"{text}: {len(points)} answers")
        _require_near(expected[sorted(sure)], points, f"{text}: nothing at")
        _require_near(points, expected[sorted(may)], f"{text}: what is not asked for, at")

    def _nearest(self, layer: Grid | Things) -> None:
        what, frame, k = self._what(layer), self._known_frame(), self._draw.choice([1, 2, 5])
        point = self._drawn.place()
        at = self.oracle.point_in_base(point, frame or "map")
        expected = [far for far, _ in self.oracle.distances(layer, what, at.x, at.y)][:k]
        found = self.hypermap.nearest(what, point, k, layer.name, frame)
        given = [hit.distance for hit in found]
        _require(
            len(given) == len(expected) and np.allclose(given, expected, atol=1e-6),  # type: ignore[arg-type]
            f"nearest {what!r} of {layer.name!r} to {point} in {frame}: {given}, not {expected}",
        )
        places, rows = self._locations(layer), sorted(self.oracle.called(layer, what))
        text = f"nearest {what!r} of {layer.name!r} to {point} in {frame}"
        for hit in found:
            _require_near([hit.point_xy], places[rows], f"{text}: what is not asked for, at")
            if isinstance(layer, Things):
                (shape,) = (
                    shape
                    for thing, shape in zip(layer.things, self.oracle.shapes(layer), strict=True)
                    if hit.object is not None and thing.number == hit.object.id
                )
                far = float(shapely.distance(shape, at))
            else:
                far = float(np.hypot(*(np.asarray(hit.point_xy) - (at.x, at.y))))
            _require(
                hit.distance is not None and abs(far - hit.distance) < 1e-6,
                f"{text}: {hit.distance} m to what is {far} m away",
            )

    def _objects_at(self) -> None:
        point, frame = self._drawn.place(), self._known_frame()
        at = self.oracle.point_in_base(point, frame or "map")
        keys, shapes = self._keys(), [shape for _, _, shape in self.oracle.objects()]
        may, sure = map(set, self.oracle.around(np.array(shapes, dtype=object), at))
        found = self.hypermap.objects_at(point, frame_id=frame)
        given = [keys[hit.layer, _id(hit)] for hit in found]
        _require(sure <= set(given) <= may, f"objects at {point} in {frame}: {given}")
        for one, other in itertools.pairwise(found):
            _require(
                one.layer != other.layer
                or one.object.footprint.area <= other.object.footprint.area * (1 + 1e-9),
                f"objects at {point} in {frame}: a larger one comes first",
            )

    def _objects(self) -> None:
        """Ask for objects by name, tags, area, what they stand in and what they are near to."""
        draw, keys = self._draw, self._keys()
        everything = self.oracle.objects()
        frame = self._known_frame()
        name = draw.choice([None, *NAMES])
        tags = draw.choice([(), (), ("red",)])
        kind, area = self._area() if draw.random() < 0.4 else ("", None)
        near: Any = draw.choice([None, self._drawn.place(), draw.choice(NAMES)])
        within = draw.choice([None, 0.5, 3.0]) if near is not None else None
        inside: Any = draw.choice([None, None, self._area()[1], draw.choice(NAMES)])
        found = self.hypermap.objects(
            name, near=near, within=within, inside=inside, area=area, tags=tags, frame_id=frame
        )
        base = frame or "map"
        sure, may = set(), set()
        for number, (_, thing, shape) in enumerate(everything):
            if name not in (None, thing.name) or not set(tags) <= set(thing.tags):
                continue
            margins = [math.inf]  # by how much each condition holds [m]
            if area is not None:
                margins.append(_overlap(shape, self.oracle.in_base(area, base)))
            if isinstance(inside, BaseGeometry):
                margins.append(_depth(shape.centroid, self.oracle.in_base(inside, base)))
            elif inside is not None:
                margins.append(
                    max(
                        (
                            _depth(shape.centroid, other)
                            for i, (_, one, other) in enumerate(everything)
                            if i != number and one.name == inside
                        ),
                        default=-math.inf,
                    )
                )
            if near is not None:
                far = self._distance(number, near, base)
                margins.append((math.inf if within is None else within) - far)
                if not math.isfinite(far):
                    margins.append(-math.inf)
            if min(margins) >= -EPSILON:
                may.add(number)
            if min(margins) > EPSILON or (self._drawn.is_lattice and min(margins) >= 0):
                sure.add(number)
        given = [keys[hit.layer, _id(hit)] for hit in found]
        text = f"objects {name}, near {near}, within {within}, inside {inside}, {kind} in {frame}"
        _require(len(set(given)) == len(given), f"{text}: some are there twice")
        _require(sure <= set(given) <= may, f"{text}: {given}, sure {sure}, possible {may}")
        if near is not None:
            exact = [self._distance(number, near, base) for number in given]
            _require(
                np.allclose([hit.distance for hit in found], exact, atol=1e-6)  # type: ignore[arg-type]
                and all(b - a > -1e-6 for a, b in itertools.pairwise(exact)),
                f"{text}: the distances are {[hit.distance for hit in found]}, not {exact}",
            )

    def _same_room(self) -> None:
        """Ask what shares a room with an object of a name; the rooms are strips of the plane."""
        draw, everything = self._draw, self.oracle.objects()
        borders = sorted(draw.uniform(-5.0, 15.0) for _ in range(draw.randrange(4)))
        edges = itertools.pairwise([-1e4, *borders, 1e4])
        rooms = [SemanticObject("room", shapely.box(a, -1e4, b, 1e4)) for a, b in edges]
        hypermap = self.hypermap.with_layers([*self.hypermap, SemanticLayer(ROOMS, "map", rooms)])
        middles = np.array([shape.centroid.x for _, _, shape in everything])
        if any(np.abs(middles - border).min(initial=1.0) < EPSILON for border in borders):
            return
        names = [thing.name for _, thing, _ in everything]
        places = np.searchsorted(borders, middles).tolist()
        name, of = draw.choice([None, *NAMES]), draw.choice(NAMES)
        others = {(place, i) for i, place in enumerate(places) if names[i] == of}
        expected = {
            i
            for i, place in enumerate(places)
            if name in (None, names[i]) and any(p == place and j != i for p, j in others)
        }
        shared = Condition("in the room of", Reference(names=(of,)))
        query = Query(names=() if name is None else (name,), exact=True, where=(shared,))
        keys = self._keys()
        found = [hit for hit in ask(hypermap, query).objects if hit.layer != ROOMS]
        given = {keys[hit.layer, _id(hit)] for hit in found}
        text = f"{name} in the room of {of}, rooms end at {borders}"
        _require(given == expected, f"{text}: {sorted(given)}, not {sorted(expected)}")

    def _sizes(self) -> None:
        """Ask how large the objects of a name are."""
        name, keys, everything = self._draw.choice(NAMES), self._keys(), self.oracle.objects()
        found = ask(self.hypermap, Query("size", (name,), exact=True)).objects
        given = {keys[hit.layer, _id(hit)]: size_of_object(hit.object) for hit in found}
        expected = {i for i, (_, thing, _) in enumerate(everything) if thing.name == name}
        _require(set(given) == expected, f"sizes of {name}: of {sorted(given)}")
        for number, size in given.items():
            shape = everything[number][2]
            sides = _rectangle(shape)
            text = f"size of {name} {everything[number][1].number}: {size}"
            _require(abs(size.area - shape.area) < 1e-6, f"{text}, not {shape.area} m^2")
            product = sides[0] * sides[1]  # rectangles of one area may have other sides
            _require(abs(size.length * size.width - product) < 1e-5, f"{text}, not {sides}")

    def _distance(self, number: int, near: Any, frame: str) -> float:
        """Return how far an object is from a point, or from the nearest other of a name."""
        everything = self.oracle.objects()
        shape = everything[number][2]
        if not isinstance(near, str):
            at = self.oracle.point_in_base(near, frame)
            return float(shapely.distance(shape, at))
        others = [o for i, (_, t, o) in enumerate(everything) if i != number and t.name == near]
        return float(shapely.distance(shape, others).min()) if others else math.inf

    def _keys(self) -> dict[tuple[str, int], int]:
        everything = enumerate(self.oracle.objects())
        return {(layer.name, thing.number): number for number, (layer, thing, _) in everything}

    def _what(self, layer: Grid | Things) -> str | int:
        draw = self._draw
        if isinstance(layer, Things):
            numbers = [thing.number for thing in layer.things] or [0]
            some: list[str | int] = [*NAMES, "nothing", draw.choice(numbers)]
        else:
            some = ["Free", "Occupied", "Unknown", "nothing", 0, 57, 100, -1]
        return draw.choice(some)

    def _locations(self, layer: Grid | Things) -> Any:
        if isinstance(layer, Grid):
            return self.oracle.centers(layer)
        middles = [shape.centroid.coords[0] for shape in self.oracle.shapes(layer)]
        return np.array(middles).reshape(-1, 2)

    def _rows(self, layer: Grid | Things, points: Any, values: Any, what: str) -> Iterator[int]:
        """Yield which cells or objects an answer tells of; their places must be right."""
        places = self._locations(layer)
        if isinstance(layer, Things):
            row_of = {thing.number: row for row, thing in enumerate(layer.things)}
            rows = [row_of.get(int(value), -1) for value in values]
            _require(-1 not in rows, f"{what}: an id that is not there")
        else:
            cells = self.oracle.cells_at(layer, points)
            rows = (cells[:, 0] * layer.cells.shape[1] + cells[:, 1]).tolist()
            expected = layer.cells.ravel()[rows] if rows else np.empty(0)
            _require(np.array_equal(expected, values), f"{what}: values of other cells")
        if len(rows):
            off = np.abs(places[rows] - points).max()
            _require(off < 100 * EPSILON, f"{what}: {off} m beside the right place")
        return iter(rows)


def _rectangle(shape: BaseGeometry) -> tuple[float, float]:
    """Return the sides of the smallest rectangle around a shape, along one of its hull's edges."""
    corners = shapely.get_coordinates(shapely.convex_hull(shape))
    best = (math.inf, math.inf)
    for one, other in itertools.pairwise(corners):
        x, y = (other - one) / np.hypot(*(other - one))
        along, across = (np.ptp(corners @ axis) for axis in ((x, y), (-y, x)))
        best = min(best, (float(along), float(across)), key=math.prod)
    return best


def _combined(parent: Pose, child: Pose) -> Pose:
    x, y, yaw = parent
    dx, dy, turn = child
    return (
        x + math.cos(yaw) * dx - math.sin(yaw) * dy,
        y + math.sin(yaw) * dx + math.cos(yaw) * dy,
        yaw + turn,
    )


def _layer_of(grid: Grid) -> OccupancyLayer:
    height, width = grid.cells.shape
    geometry = GridGeometry(width, height, grid.resolution, Pose2D(*grid.origin))
    return OccupancyLayer(grid.name, grid.frame, geometry, grid.cells)


def _object_of(thing: Thing) -> SemanticObject:
    return SemanticObject(thing.name, thing.shape, tags=thing.tags)


def _label(layer: Grid | Things, value: int) -> str:
    if isinstance(layer, Grid):
        return label(value)
    return next((thing.name for thing in layer.things if thing.number == value), "Empty")


def _id(hit: Any) -> int:
    return int(hit.object.id)


def _overlap(one: BaseGeometry, other: BaseGeometry) -> float:
    """Return by how much two shapes overlap [m]: little where they hardly do, negative apart."""
    if not shapely.intersects(one, other):
        return -float(shapely.distance(one, other))
    return 1.0 if shapely.intersects(one.buffer(-2 * EPSILON), other) else 0.0


def _depth(point: shapely.Point, shape: BaseGeometry) -> float:
    """Return how deep a point lies within a shape [m]; negative outside."""
    border = float(shapely.distance(point, shape.boundary))
    return border if shapely.intersects(point, shape) else -border


def _difference(found: Any, bracket: Any) -> str:
    given = set(found)
    return f"{sorted(bracket.sure - given)} are missing, {sorted(given - bracket.possible)} wrong"


def _require_near(points: Any, places: Any, what: str) -> None:
    """Require that each point is one of the places, but for what is rounded."""
    points, places = np.reshape(points, (-1, 2)), np.reshape(places, (-1, 2))
    if not len(points):
        return
    known = {tuple(place) for place in np.round(places, 5).tolist()}
    for point in points:
        near = np.round([point, point - 5e-7, point + 5e-7], 5)  # either side of rounding
        some = set(itertools.product(near[:, 0].tolist(), near[:, 1].tolist()))
        _require(bool(some & known), f"{what} {point}")


def _require(is_right: bool, what: str) -> None:
    if not is_right:
        raise Wrong(what)
