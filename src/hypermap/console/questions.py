"""From the options of a question to the rows of its answer."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.console.measured import (
    Limits,
    rows_nearest,
    rows_where,
    value_row,
    with_values,
)
from hypermap.console.places import names_rooms, parse_area, parse_point
from hypermap.core.errors import HypermapError, did_you_mean
from hypermap.core.hypermap import ROOMS, FoundObject, Hypermap
from hypermap.core.layer import Layer
from hypermap.core.opaque import OpaqueLayer
from hypermap.core.semantic import SemanticLayer
from hypermap.core.value_layer import ValueLayer
from hypermap.questions.query import Seen, When
from hypermap.questions.seen import seen_in
from hypermap.questions.times import parse_moment, time_of
from hypermap.rooms.questions import rooms_asked, rooms_at, rooms_with, stand_in_rooms
from hypermap.rooms.rooms import rooms_on

Row: TypeAlias = dict[str, Any]


@dataclass(frozen=True)
class Question:
    """What is asked; None where nothing is said.

    Attributes:
        at: a point [m].
        names: of which an object has one, or a layer says one.
        number: an object's id, or what a layer has as a value.
        area: as the user wrote it, like `near` and `inside`.
        rooms: name or kind of rooms in which objects are; `answers` finds out that an area is one.
        start: from where the nearest are measured [m]; None for (0, 0).
        by_path: whether they are measured by path, not by air.
        robot_radius: of the robot that drives there [m].
        having: name of an object that rooms have.
        most: how many of the nearest are wanted.
        near: a name or a point.
        within: distance to `near` [m].
        inside: a name or an area.
        above: a measured value is larger; without `measured`, places are asked for.
        below: a measured value is smaller.
        measured: the layer whose values around objects are asked for.
        when: conditions on when objects were seen.
        last_seen: whether the answer says when objects were last seen.
        layers: those that are asked; none for all.
        frame_id: of points and areas.
    """

    at: tuple[float, float] | None = None
    names: Sequence[str] = ()
    number: float | None = None
    area: str | None = None
    rooms: str | None = None
    start: tuple[float, float] | None = None
    most: int | None = None
    by_path: bool = False
    robot_radius: float | None = None
    having: str | None = None
    near: str | None = None
    within: float | None = None
    inside: str | None = None
    above: float | None = None
    below: float | None = None
    measured: str | None = None
    when: Sequence[When] = ()
    last_seen: bool = False
    layers: Sequence[str] = ()
    frame_id: str | None = None

    @classmethod
    def of_options(cls, given: Mapping[str, Any]) -> Question:
        """Return the question that options ask, by their names; None where one is not given.

        Raises:
            HypermapError: If a value is none of its kind, or two options say the same.
        """
        if given.get("--name") and given.get("--value") is not None:
            raise HypermapError("give either --name or --value, not both")
        by = given.get("--by") or "air"
        if by not in ("air", "path"):
            raise HypermapError(f"--by {by!r}: expected air or path")
        at, start, most = (given.get(name) for name in ("--at", "--from", "-k"))
        return cls(
            at=None if at is None else parse_point(at, "--at"),
            names=given.get("--name") or (),
            number=given.get("--value"),
            area=given.get("--in"),
            start=None if start is None else parse_point(start, "--from"),
            most=most if most is not None else 1 if given.get("--nearest") else None,
            by_path=by == "path",
            robot_radius=given.get("--robot-radius"),
            having=given.get("--with"),
            near=given.get("--near"),
            within=given.get("--within"),
            inside=given.get("--inside"),
            above=given.get("--above"),
            below=given.get("--below"),
            measured=given.get("--measured"),
            when=_times(given),
            last_seen=bool(given.get("--last-seen")),
            layers=given.get("--layer") or (),
            frame_id=given.get("--frame"),
        )

    @property
    def what(self) -> Sequence[str | float]:
        """The names and numbers that are looked for; none where anything is."""
        return [*self.names, *([] if self.number is None else [self.number])]

    @property
    def limits(self) -> Limits:
        """Above which and below which a measured value is to be."""
        return self.above, self.below

    @property
    def is_about_places(self) -> bool:
        """Whether only places can be an answer, those of a quantity within limits."""
        return self.limits != (None, None) and self.measured is None

    @property
    def is_about_objects(self) -> bool:
        """Whether only objects can be an answer."""
        others = (self.near, self.inside, self.rooms, self.having, self.measured)
        is_timed = self.last_seen or bool(self.when)
        return self.by_path or is_timed or any(part is not None for part in others)


def answers(hypermap: Hypermap, question: Question) -> list[Row]:
    """Return the rows of the answer, each with layer, label, value, x and y in the base frame.

    Raises:
        HypermapError: If the question has no meaning, or names an unknown layer or frame.
    """
    _check(question)
    if question.is_about_places:
        return _rows_of_places(hypermap, question)
    if (
        question.area is not None
        and names_rooms(question.area)
        and not _asks_values(hypermap, question)
    ):
        rooms_asked(hypermap, question.area)
        question = replace(question, area=None, rooms=question.area)
    layers = _asked_layers(hypermap, question)
    if question.at is not None:
        return [row for layer in layers for row in _rows_at(hypermap, layer, question)]
    semantic = {layer.name for layer in layers if isinstance(layer, SemanticLayer)}
    found = _objects(hypermap, question, semantic)
    for when in question.when:
        found, _ = seen_in(when, found)
    if question.measured is None:
        rows = [_row_of_object(item) for item in found]
    else:
        pairs = with_values(hypermap, question.measured, question.limits, found)
        rows = [_row_of_object(item) | {"measured": measured} for item, measured in pairs]
    _tell_rooms(hypermap, rows)
    if not question.is_about_objects:
        for layer in layers:
            if layer.name not in semantic:
                rows += _rows_of_layer(hypermap, layer, question)
    if question.most is not None:
        rows = sorted(rows, key=lambda row: float(row["distance"]))[: question.most]
    return _with_times(rows) if question.last_seen else rows


def _times(given: Mapping[str, Any]) -> tuple[When, ...]:
    """Return the conditions on time among the options."""
    kinds: dict[str, Seen] = {"--since": "seen", "--new-since": "new", "--not-seen-for": "not seen"}
    return tuple(
        When(kind, parse_moment(given[option], option))
        for option, kind in kinds.items()
        if given.get(option) is not None
    )


def _with_times(rows: list[Row]) -> list[Row]:
    """Return the rows of objects with when they were last seen, the latest first."""
    timed = [row for row in rows if "object" in row]
    for row in timed:
        seen = row["object"]["last_seen"]
        row["last_seen"] = None if seen is None else time_of(seen, short=True)
    return sorted(timed, key=lambda row: -(row["object"]["last_seen"] or -math.inf))


def remarks(hypermap: Hypermap, question: Question, rows: Sequence[Row]) -> list[str]:
    """Return what is to be said next to an answer."""
    if not rows:
        return ["nothing found" + "".join(f"; {hint}" for hint in _hints(hypermap, question))]
    if question.most is not None and question.start is None:
        return ["measured from (0, 0); give --from X,Y to measure from elsewhere"]
    return []


def _hints(hypermap: Hypermap, question: Question) -> Iterator[str]:
    """Yield what may be wrong with the names in a question to which there is no answer."""
    layers = [layer for layer in hypermap.layers if isinstance(layer, SemanticLayer)]
    known = sorted({str(name) for layer in layers for name in layer.names})
    for name in (*question.names, question.near, question.inside):
        if isinstance(name, str) and name not in known and not _is_place(hypermap, name):
            yield f"no object is called {name!r}; {did_you_mean(name, known)}"
    if question.by_path:
        yield "what no path leads to is left out"


def _check(question: Question) -> None:
    asked = (
        *(question.what or None, question.area, question.near, question.inside),
        *(question.having, question.when or None, question.last_seen or None),
    )
    others = (*asked, question.most, question.measured, *question.limits)
    if question.at is not None and any(part is not None for part in others):
        raise HypermapError(
            "--at asks what is at a point; combine it only with --layer and --frame"
        )
    if question.is_about_places:
        _check_places(question)
        return
    is_of_layer = question.measured is not None and question.layers
    if question.at is None and all(part is None for part in asked) and not is_of_layer:
        raise HypermapError("there is no query; give --at X,Y, --in AREA or --name NAME")
    if question.most is not None and not question.what:
        raise HypermapError("the nearest what? give --name NAME")
    if question.most is not None and question.near is not None:
        raise HypermapError("give either --nearest (or -k) with --from, or --near")
    if question.by_path and question.most is None:
        raise HypermapError("--by path measures the nearest; give --nearest or -k")
    if question.robot_radius is not None and not question.by_path:
        raise HypermapError("--robot-radius needs --by path")
    if question.within is not None and question.near is None:
        raise HypermapError("--within needs --near: a distance from what?")


def _check_places(question: Question) -> None:
    of_objects = (question.near, question.within, question.inside, question.having)
    if question.what or question.by_path or any(part is not None for part in of_objects):
        raise HypermapError(
            "--above and --below ask where a quantity is so; to ask which objects are there, give "
            "--measured LAYER, too"
        )
    if len(question.layers) > 1:
        raise HypermapError("--above and --below ask one layer; give --layer once")


def _asks_values(hypermap: Hypermap, question: Question) -> bool:
    """Return whether all layers that are asked hold measured values."""
    return bool(question.layers) and all(
        isinstance(hypermap[name], ValueLayer) for name in question.layers
    )


def _rows_of_places(hypermap: Hypermap, question: Question) -> list[Row]:
    """Return the places at which a quantity is within limits."""
    layer = question.layers[0] if question.layers else None
    area, frame_id = _area(hypermap, question)
    if question.most is None:
        return rows_where(hypermap, layer, question.limits, area, frame_id)
    if area is not None and frame_id != question.frame_id:  # that of rooms, which is the base
        start = tuple(_in_base_frame(hypermap, _start(question), question.frame_id).tolist())
    else:
        start = _start(question)
    return rows_nearest(hypermap, layer, question.limits, start, question.most, area, frame_id)


def _asked_layers(hypermap: Hypermap, question: Question) -> list[Layer]:
    if question.layers:
        named = [hypermap[name] for name in dict.fromkeys(question.layers)]
        for layer in named:
            if question.is_about_objects and not isinstance(layer, SemanticLayer):
                raise HypermapError(
                    f"the question asks for objects; layer {layer.name!r} holds none"
                )
        return named
    # A number is an id unless a layer is named: a grid has thousands of cells with each number.
    only_objects = question.number is not None
    return [
        layer
        for layer in hypermap.placed_layers()
        if isinstance(layer, SemanticLayer) or not (only_objects or isinstance(layer, OpaqueLayer))
    ]


def _rows_at(hypermap: Hypermap, layer: Layer, question: Question) -> list[Row]:
    """Return a row for each object at a point, the smallest first, or one for what is there."""
    assert question.at is not None
    point, frame_id = question.at, question.frame_id
    x, y = _in_base_frame(hypermap, point, frame_id)
    if isinstance(layer, SemanticLayer):
        found = [each.object for each in hypermap.objects_at(point, layer.name, frame_id)]
        if found:
            return [_row(layer.name, item.name, item.id, x, y) for item in found if item]
    label = hypermap.label_at(layer.name, point, frame_id)[0]
    value = hypermap.value_at(layer.name, point, frame_id)[0]
    row = _row(layer.name, label, value, x, y)
    if isinstance(layer, ValueLayer):
        layer_T_base = hypermap.frames.lookup(layer.frame_id, hypermap.base_frame)
        row |= value_row(layer, layer_T_base.apply((x, y)))
    return [row]


def _objects(hypermap: Hypermap, question: Question, layers: set[str]) -> list[FoundObject]:
    """Return the objects of some layers for which all that is asked is true."""
    if not layers:
        return []
    is_by_air = question.most is not None and not question.by_path
    near: Any = _start(question) if is_by_air else None
    if question.near is not None:
        is_point = _is_place(hypermap, question.near)
        near = parse_point(question.near, "--near") if is_point else question.near
    inside: Any = question.inside
    if inside is not None and _is_place(hypermap, inside):
        inside = parse_area(inside, "--inside")
    found = hypermap.objects(
        question.names or None,
        near=near,
        within=question.within,
        inside=inside,
        area=_area(hypermap, question)[0],
        layer=next(iter(layers)) if len(layers) == 1 else None,
        frame_id=question.frame_id,
    )
    number = question.number
    chosen = [item for item in found if item.layer in layers and number in (None, item.object.id)]
    chosen = _by_rooms(hypermap, question, chosen)
    if not question.by_path:
        return chosen
    from hypermap.paths import PathSettings, Planner  # with loops that take time to load

    settings = PathSettings(question.robot_radius or 0.0)
    start = _in_base_frame(hypermap, _start(question), question.frame_id)
    return Planner(hypermap, settings).by_path(chosen, start)


def _by_rooms(
    hypermap: Hypermap, question: Question, found: list[FoundObject]
) -> list[FoundObject]:
    """Return the objects that are in the rooms that are asked for, and of rooms those that have."""
    if question.rooms is not None and found:
        points = [item.point_xy for item in found]
        standing = stand_in_rooms(hypermap, question.rooms, points)
        assert standing is not None  # there are such rooms
        pairs = zip(found, standing.tolist(), strict=True)
        found = [item for item, is_there in pairs if is_there and item.layer != ROOMS]
    if question.having is not None:
        ids = {room.id for room in rooms_with(hypermap, question.having)}
        found = [item for item in found if item.layer == ROOMS and item.object.id in ids]
    return found


def _tell_rooms(hypermap: Hypermap, rows: list[Row]) -> None:
    """Say of each object, in a map that has rooms, in which it is."""
    things = [row for row in rows if row["layer"] != ROOMS]
    if ROOMS not in hypermap or not things:
        return
    rooms = rooms_on(hypermap)
    if rooms is None:
        return
    points = [(row["x"], row["y"]) for row in things]
    for row, room in zip(things, rooms_at(rooms, points), strict=True):
        row["room"] = None if room is None else {"id": room.id, "name": room.name}


def _rows_of_layer(hypermap: Hypermap, layer: Layer, question: Question) -> list[Row]:
    """Return the rows of a layer that has no objects."""
    area, frame_id = _area(hypermap, question)
    if question.what:
        each = [hypermap.find(layer.name, what, area, frame_id) for what in question.what]
        places = np.concatenate(each)
        labels = hypermap.label_at(layer.name, places)
        values = hypermap.value_at(layer.name, places)
    elif area is not None:
        found = hypermap.labels_in(layer.name, area, frame_id)
        labels, places = found.values, found.points_xy
        values = hypermap.values_in(layer.name, area, frame_id).values
    else:
        return []
    hits = zip(labels, values, places, strict=True)
    rows = [_row(layer.name, label, value, x, y) for label, value, (x, y) in hits]
    if isinstance(layer, ValueLayer):
        for row in rows:
            row["unit"] = layer.unit
    if question.most is not None:
        start = _in_base_frame(hypermap, _start(question), question.frame_id)
        for row, distance in zip(rows, np.hypot(*(places - start).T), strict=True):
            row["distance"] = float(distance)
    return rows


def _start(question: Question) -> tuple[float, float]:
    return question.start or (0.0, 0.0)


def _area(hypermap: Hypermap, question: Question) -> tuple[BaseGeometry | None, str | None]:
    """Return the area of a question, or the rooms that it names, and its frame."""
    if question.area is None or not names_rooms(question.area):
        area = None if question.area is None else parse_area(question.area, "--in")
        return area, question.frame_id
    rooms = rooms_asked(hypermap, question.area)
    return shapely.union_all([room.outline for room in rooms]), hypermap.base_frame


def _is_place(hypermap: Hypermap, text: str) -> bool:
    """Return whether a text is numbers or WKT, and not the name of an object."""
    if any(text in set(layer.names) for layer in hypermap if isinstance(layer, SemanticLayer)):
        return False
    return re.fullmatch(r"\s*([-+.\d][-+.,\s\deE]*|[A-Za-z]+\s*\(.*)", text) is not None


def _in_base_frame(
    hypermap: Hypermap, point: tuple[float, float], frame_id: str | None
) -> NDArray[np.float64]:
    base_T_asked = hypermap.frames.lookup(hypermap.base_frame, frame_id or hypermap.base_frame)
    in_base: NDArray[np.float64] = base_T_asked.apply(point)[0]
    return in_base


def _row_of_object(found: FoundObject) -> Row:
    item = found.object
    row = _row(found.layer, item.name, item.id, *found.point_xy)
    if found.distance is not None:
        row["distance"] = found.distance
    row["object"] = {
        "id": item.id,
        "name": item.name,
        "footprint": shapely.to_wkt(item.footprint, rounding_precision=6),
        "tags": list(item.tags),
        "confidence": list(item.confidence),
        "existence": item.existence,
        "first_seen": item.first_seen,
        "last_seen": item.last_seen,
        "attributes": dict(item.attributes),
    }
    return row


def _row(layer: str, label: Any, value: Any, x: float, y: float) -> Row:
    number = value.item() if isinstance(value, np.generic) else value
    if isinstance(number, float) and not math.isfinite(number):
        number = None
    return {"layer": layer, "label": str(label), "value": number, "x": float(x), "y": float(y)}
