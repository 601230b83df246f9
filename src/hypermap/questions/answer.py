"""Answers a `Query` about a map: the one place that does."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import PointsLike, as_objects
from hypermap.core.embeddings import TextEncoder
from hypermap.core.errors import HypermapError, did_you_mean
from hypermap.core.frames import Pose2D
from hypermap.core.hypermap import ROOMS, FoundObject, Hypermap, Matches
from hypermap.core.layer import Layer
from hypermap.core.notes_layer import NotesLayer
from hypermap.core.opaque import OpaqueLayer
from hypermap.core.semantic import SemanticLayer
from hypermap.core.value_layer import ValueLayer
from hypermap.history import as_of, in_force
from hypermap.questions.cells import (
    Cell,
    cell_at,
    cells_in,
    nearest_places,
    places_where,
    value_in,
    values_around,
)
from hypermap.questions.chosen import chosen_objects, chosen_rooms
from hypermap.questions.finder import ASKER, Finder
from hypermap.questions.noted import notes_at, notes_in
from hypermap.questions.per_room import counted_by_room
from hypermap.questions.query import Query
from hypermap.questions.seen import seen_in
from hypermap.questions.sizes import size_of_object
from hypermap.questions.taxonomy import Taxonomy, load_taxonomy
from hypermap.rooms.questions import rooms_at
from hypermap.rooms.rooms import Room
from hypermap.values import value_layer_called
from hypermap.values.past import why_undated

_SHOWN = 3  # objects in the short form of an answer


@dataclass(frozen=True, eq=False)
class Answer:
    """The answer of a map to a query.

    Attributes:
        query: the query.
        found: the objects that meet its conditions, in the base frame; with distances where the
            query measures any, nearest first.
        rooms: the requested rooms; for "room" in the order of `found`, None for an object in none.
        counts: of the objects in each of `rooms`, for a query with `per`.
        cells: the labels of layers without objects, for "labels" and "places".
        similarities: for each object, the cosine with the text of `like`.
        measured: for each object, the values around it, if the query asks for them.
        notes: remarks, such as that there is no object of a name.
    """

    query: Query
    found: Matches
    rooms: tuple[Room | None, ...] = ()
    counts: tuple[int, ...] = ()
    cells: tuple[Cell, ...] = ()
    measured: tuple[Mapping[str, Any], ...] = ()
    similarities: tuple[float, ...] = ()
    notes: tuple[str, ...] = ()

    def __repr__(self) -> str:
        """Return what was found, as a person reads it."""
        if self.query.give == "exists":
            said = "yes" if self.exists else "no"
        elif self.query.give == "count" and not self.query.counts_each_room:
            said = str(self.count)
        else:
            names, of = self._shown()
            said = ", ".join(names[:_SHOWN]) + (", ..." if of > _SHOWN else "") or "none"
        notes = "".join(f"; {note}" for note in self.notes)
        return f"<Answer: {said}{notes}>"

    def _shown(self) -> tuple[list[str], int]:
        """Return the names of the first things that were found, and the number of all."""
        rooms = ["no room" if room is None else room.name for room in self.rooms]
        if self.query.counts_each_room:
            counts = zip(rooms, self.counts, strict=True)
            return [f"{count} in {room}" for room, count in counts], len(rooms)
        if self.query.asks_rooms:
            return rooms, len(rooms)
        names = [f"{item.object.name} {item.object.id}" for item in self.first(_SHOWN)]
        if self.query.give == "size":
            sizes = (size_of_object(item.object) for item in self.first(_SHOWN))
            names = [f"{name}: {size}" for name, size in zip(names, sizes, strict=True)]
        if self.query.give == "room":
            names = [f"{name} in {room}" for name, room in zip(names, rooms, strict=False)]
        return [*names, *(str(cell.label) for cell in self.cells)], self.count

    @cached_property
    def objects(self) -> tuple[FoundObject, ...]:
        """All objects; `first` is faster where some of many are enough."""
        return tuple(self.found.first())

    def first(self, count: int) -> tuple[FoundObject, ...]:
        """Return the first objects."""
        return tuple(self.found.first(count))

    @property
    def count(self) -> int:
        """The number of rooms if these are wanted, else of objects and cells."""
        if self.query.asks_rooms and not self.query.counts_each_room:
            return len(self.rooms)
        return len(self.found) + len(self.cells)

    @property
    def exists(self) -> bool:
        """Whether there is any, or the number that is asked about."""
        number = self.query.number
        if number is not None and self.query.per is None:
            return number.holds(self.count)
        return self.count > 0


def ask(
    hypermap: Hypermap,
    query: Query,
    *,
    asker: Pose2D | None = None,
    taxonomy: Taxonomy | None = None,
    robot_radius: float = 0.0,
    now: float | None = None,
    encoder: TextEncoder | None = None,
) -> Answer:
    """Return the answer of a map to a query.

    Expired objects are ignored.

    Args:
        hypermap: the map.
        query: the question.
        asker: position and heading of the person who asks, in the base frame.
        taxonomy: names and kinds of objects; None for ours.
        robot_radius: of the robot that distances by path are for [m].
        now: the time by which objects expire, in seconds since 1970; None for the present.
        encoder: for the text of `like`; None for the one that the environment variable
            HYPERMAP_EMBEDDER names.

    Raises:
        HypermapError: If the query needs to know where the asker is, asks for rooms of a map that
            has none, for an unknown room or layer, for heights that the map does not have, or for
            a time that the map does not know.
        TypeError: If the question is no query, as one in English, which `ask_map` answers.

    >>> from hypermap import SemanticLayer, SemanticObject
    >>> things = [SemanticObject("couch", shapely.box(x, 0, x + 1, 1)) for x in (0, 4)]
    >>> hypermap = Hypermap([SemanticLayer("semantic", "map", things)])
    >>> ask(hypermap, Query("count", ("seating",))).count
    2
    """
    if not isinstance(query, Query):
        raise TypeError(f"expected a Query, got {query!r}; ask_map takes questions in English, too")
    if query.as_of is None:
        hypermap = in_force(hypermap, time.time() if now is None else now)
    else:
        if query.measured is not None:
            _check_dated(value_layer_called(hypermap, query.measured.layer))
        elif query.give != "labels" and not query.layers:
            hypermap = _without_values(hypermap)  # which take seconds to make again
        hypermap = as_of(hypermap, query.as_of)
    finder = Finder(hypermap, query.exact, asker, taxonomy or load_taxonomy(), robot_radius)
    return _Asking(hypermap, query, finder, encoder).answer()


def _without_values(hypermap: Hypermap) -> Hypermap:
    return hypermap.with_layers(
        ValueLayer(layer.name, layer.frame_id) if isinstance(layer, ValueLayer) else layer
        for layer in hypermap
    )


def _check_dated(layer: ValueLayer) -> None:
    """Raise a HypermapError if values are not known as of a time."""
    if (reason := why_undated(layer)) is not None:
        raise HypermapError(
            f"the values of layer {layer.name!r} are known only as they are now, not as of a time: "
            f"{reason}"
        )


class _Asking:
    """Answers one query."""

    def __init__(
        self,
        hypermap: Hypermap,
        query: Query,
        finder: Finder,
        encoder: TextEncoder | None,
    ) -> None:
        self._hypermap, self._query = hypermap, query
        self._finder, self._encoder = finder, encoder
        self._similarities: tuple[float, ...] = ()

    def answer(self) -> Answer:
        query, finder = self._query, self._finder
        layers = self._layers()
        found = Matches.of_shapes(as_objects([]))
        rooms: Sequence[Room | None] = []
        cells: list[Cell] = []
        measured: list[dict[str, Any]] = []
        if query.give == "places":
            return self._answer(found, cells=self._places())
        if query.give == "value":
            return self._answer(found, cells=self._value())
        if query.describes_objects or not query.asks_rooms:
            found = self._found(layers)
        if query.measured is not None:
            rows, measured = values_around(self._hypermap, query.measured, found.first())
            if query.which in ("highest", "lowest"):
                known = [place for place, one in enumerate(measured) if one["cells"]]
                known = (known[::-1] if query.which == "highest" else known)[query.chosen]
                rows, measured = [rows[i] for i in known], [measured[i] for i in known]
            found = found.take(np.array(rows, dtype=np.int64))
        if query.per is not None:
            found, counted, counts = counted_by_room(finder, query, found)
            return self._answer(found, counted, counts=counts)
        if query.give == "labels":
            found, cells = self._nearest_of(found, self._cells(layers, found))
        elif query.asks_rooms:
            of_objects = query.describes_objects
            rooms = finder.rooms.of(found) if of_objects else chosen_rooms(finder, query)
        elif query.give == "room":
            rooms = rooms_at(finder.rooms.known, found.centroids) if len(found) else []
        return self._answer(found, rooms, cells, measured)

    def _answer(
        self,
        found: Matches,
        rooms: Sequence[Room | None] = (),
        cells: Iterable[Cell] = (),
        measured: Iterable[Mapping[str, Any]] = (),
        counts: Iterable[int] = (),
    ) -> Answer:
        notes = tuple(dict.fromkeys(self._finder.notes))
        parts = tuple(rooms), tuple(counts), tuple(cells), tuple(measured)
        return Answer(self._query, found, *parts, self._similarities, notes)

    # Layers

    def _layers(self) -> list[Layer]:
        """Return the layers that are asked."""
        query, hypermap = self._query, self._hypermap
        if not query.layers:
            placed = hypermap.placed_layers()
            return [layer for layer in placed if not isinstance(layer, OpaqueLayer)]
        if ROOMS in query.layers:
            self._finder.rooms.check()
        named = [hypermap[name] for name in dict.fromkeys(query.layers)]
        for layer in named:
            if query.give not in ("labels", "places") and not isinstance(layer, SemanticLayer):
                raise HypermapError(f"the question asks for objects; layer {layer.name!r} has none")
        return named

    def _cells(self, layers: Sequence[Layer], found: Matches) -> list[Cell]:
        """Return what layers without objects say; at a point also those that have none there."""
        query, hypermap = self._query, self._hypermap
        point = self._point()
        if point is not None:
            silent = [layer for layer in layers if not found.are_of(layer.name).any()]
            return [cell for layer in silent for cell in _cells_at(hypermap, layer, point)]
        what: list[str | float] = [*query.names, *([] if query.value is None else [query.value])]
        area = self._area()
        start = self._finder.place(query.start or ASKER) if query.which == "nearest" else None
        others = [layer for layer in layers if not isinstance(layer, SemanticLayer)]
        asked = what, area, start, query.count or 1
        return [cell for layer in others for cell in _cells_in(hypermap, layer, *asked)]

    def _places(self) -> Iterable[Cell]:
        """Return the places at which a quantity is within limits."""
        query = self._query
        assert query.measured is not None  # or it would be no query
        if query.which is None:
            return places_where(self._hypermap, query.measured, self._area())
        start = self._finder.place(query.start or ASKER)
        count = query.count or 1
        return nearest_places(self._hypermap, query.measured, self._area(), start, count)

    def _value(self) -> Iterable[Cell]:
        """Return what was measured at a point, in rooms or everywhere."""
        assert self._query.measured is not None  # or it would be no query
        layer = value_layer_called(self._hypermap, self._query.measured.layer)
        point = self._point()
        if point is not None:
            return [cell_at(self._hypermap, layer, point)]
        return value_in(self._hypermap, layer, self._area())

    def _nearest_of(self, found: Matches, cells: list[Cell]) -> tuple[Matches, list[Cell]]:
        """Return the nearest of objects and cells together, if these are wanted."""
        if self._query.which != "nearest" or not cells:
            return found, cells
        own = np.zeros(0) if found.distances is None else found.distances
        far = np.concatenate([own, [cell.distance or 0.0 for cell in cells]])
        chosen = np.argsort(far, kind="stable")[: self._query.count or 1]
        is_object = chosen < len(found)
        nearest = [cells[i] for i in (chosen[~is_object] - len(found)).tolist()]
        return found.take(chosen[is_object]), nearest

    def _point(self) -> NDArray[np.float64] | None:
        """Return the point that the query asks about, if it does."""
        for condition in self._query.where:
            if condition.relation == "at" and condition.reference.point_xy is not None:
                return np.array(condition.reference.point_xy)
            if condition.relation == "at" and condition.reference.is_asker:
                return self._finder.place(condition.reference)
        return None

    def _area(self) -> BaseGeometry | None:
        """Return the area, or that of the rooms, that the query asks about; None for everywhere."""
        for condition in self._query.where:
            reference = condition.reference
            if condition.relation == "in" and reference.is_asker:
                return self._finder.rooms.of_asker.outline
            is_area = reference.area is not None or reference.rooms
            if condition.relation in ("at", "in") and is_area:
                return shapely.union_all(self._finder.others(reference).shapes)
        return None

    # Objects

    def _found(self, layers: Sequence[Layer]) -> Matches:
        """Return the objects of the answer."""
        query = self._query
        found = self._finder.objects(query.names, query.where, layers if query.layers else None)
        if query.ids or query.value is not None:
            found = found.take(np.isin(found.column("ids"), query.ids))
        if query.besides:
            others = {name for other in query.besides for name in self._finder.matching(other)}
            found = found.take(~np.isin(found.column("names"), [*others]))
        if query.tags:
            found = self._tagged(found)
        for when in query.when:
            is_so, unsure = seen_in(when, found)
            found = found.take(is_so)
            if unsure:
                said = f"{unsure} more were seen before and after, and may have been then"
                self._finder.notes.append(said)
        if query.like is None:
            return chosen_objects(self._finder, query, found)
        # Imported here: numba is slow to load, and most questions are about nothing like that.
        from hypermap.questions.likeness import most_like

        rows, cosines = most_like(self._hypermap, query.like, found, query.count, self._encoder)
        self._similarities = tuple(cosines.tolist())
        return found.take(rows)

    def _tagged(self, found: Matches) -> Matches:
        """Return those that have all tags of the query; a note says which tags none has."""
        query, own = self._query, found.column("tags").tolist()
        known = sorted(set().union(*set(own)))
        for tag in query.tags:
            if tag not in known:
                said = f"nothing there has the tag {tag!r}"
                self._finder.notes.append(f"{said}; {did_you_mean(tag, known)}" if known else said)
        return found.take(np.array([set(query.tags).issubset(tags) for tags in own], dtype=bool))


def _cells_at(hypermap: Hypermap, layer: Layer, point_xy: PointsLike) -> list[Cell]:
    notes = notes_at(hypermap, layer, point_xy) if isinstance(layer, NotesLayer) else []
    return notes or [cell_at(hypermap, layer, point_xy)]


def _cells_in(
    hypermap: Hypermap,
    layer: Layer,
    what: Sequence[str | float],
    area: BaseGeometry | None,
    start: NDArray[np.float64] | None,
    count: int,
) -> Iterable[Cell]:
    if isinstance(layer, NotesLayer):
        return notes_in(hypermap, layer, what, area, start)
    return cells_in(hypermap, layer, what, area, start, count)
