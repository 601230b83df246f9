"""From the options of `hypermap query` to a `Query`, and from its answer to rows."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any, TypeAlias

import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.console.moments import left_the_map, map_at, version_in
from hypermap.console.places import names_rooms, parse_area, parse_point
from hypermap.core.errors import HypermapError, did_you_mean
from hypermap.core.hypermap import ROOMS, FoundObject, Hypermap
from hypermap.core.semantic import SemanticLayer
from hypermap.core.value_layer import ValueLayer
from hypermap.history import time_of_version
from hypermap.perception.embedders.load import load_embedder
from hypermap.questions.answer import Answer, ask
from hypermap.questions.cells import Cell
from hypermap.questions.frames import pose_of_frame
from hypermap.questions.query import Condition, Give, Measured, Query, Reference, Seen, When
from hypermap.questions.times import parse_moment, time_of
from hypermap.rooms.questions import rooms_asked, rooms_at
from hypermap.rooms.rooms import rooms_on

Row: TypeAlias = dict[str, Any]
Options: TypeAlias = Mapping[str, Any]
"""What is given, by the names of the options; None where one is not given."""

_OF_OBJECTS = ("--like", "--near", "--inside", "--with", "--measured", "--since", "--new-since")
_TIMES: dict[str, Seen] = {"--since": "seen", "--new-since": "new", "--not-seen-for": "not seen"}


@dataclass(frozen=True, eq=False)
class Answered:
    """A map's answer to a question by options.

    Attributes:
        hypermap: the map that was asked: as it was, if an earlier time was given.
        answer: that.
        rows: each with layer, label, value, x and y in the base frame.
        remarks: what is to be said next to it.
    """

    hypermap: Hypermap
    answer: Answer
    rows: list[Row]
    remarks: list[str]


def answered(hypermap: Hypermap, given: Options) -> Answered:
    """Return the answer to the question that options ask.

    Raises:
        HypermapError: If a value is none of its kind, the question has no meaning, names an
            unknown layer or frame, or asks for a time that the map does not know.
    """
    asked_at = _time_asked(hypermap, given)
    hypermap, now = map_at(hypermap, given.get("--as-of"))
    query = query_of(hypermap, given, asked_at)
    folder = given.get("--embedder")
    encoder = None if folder is None else load_embedder(folder)
    radius = given.get("--robot-radius") or 0.0
    answer = ask(hypermap, query, robot_radius=radius, encoder=encoder, now=now)
    rows = rows_of(hypermap, answer)
    return Answered(hypermap, answer, rows, _remarks(hypermap, given, rows))


def query_of(hypermap: Hypermap, given: Options, now: datetime | None = None) -> Query:
    """Return the query that options ask; its points and areas are in the base frame.

    Args:
        hypermap: the map, as it was if an earlier time was given.
        given: the options.
        now: the time that times such as "12h" are before; None for the present.

    Raises:
        HypermapError: As `answered`.
    """
    _check(given)
    frame = _Frame(hypermap, given.get("--frame"))
    names, number = tuple(given.get("--name") or ()), given.get("--value")
    layers = tuple(given.get("--layer") or ())
    measured = _measured(given)
    give = _give(hypermap, given)
    if give == "places" and measured is not None and layers:
        measured, layers = Measured(layers[0], measured.above, measured.below), ()
    count = _count(given)
    start = _start(hypermap, given, frame)
    is_number = number is not None and float(number).is_integer()
    return Query(
        give=give,
        names=names,
        exact=True,
        ids=(int(number),) if number is not None and is_number else (),
        where=tuple(_where(hypermap, given, frame)),
        when=tuple(
            When(kind, parse_moment(given[option], option, now))
            for option, kind in _TIMES.items()
            if given.get(option) is not None
        ),
        measured=measured,
        layers=layers or (() if number is None else _semantic(hypermap)),
        value=float(number) if number is not None and give == "labels" else None,
        like=given.get("--like"),
        which=None if count is None else "nearest",
        count=given.get("-k") if given.get("--like") is not None else count,
        start=start,
        by="path" if given.get("--by") == "path" else "air",
    )


def _time_asked(hypermap: Hypermap, given: Options) -> datetime | None:
    """Return the time as of which a map is asked; None for now, and where it is not known."""
    text = given.get("--as-of")
    if text is None:
        return None
    version = version_in(text)
    if version is None:
        return parse_moment(text, "--as-of")
    stamp = time_of_version(hypermap, version)
    return None if stamp is None else datetime.fromtimestamp(stamp).astimezone()


def rows_of(hypermap: Hypermap, answer: Answer) -> list[Row]:
    """Return the rows of an answer: objects, then cells; at a point by layer, else by distance."""
    rows = [_row_of_object(item) for item in answer.objects]
    for row, measured in zip(rows, answer.measured, strict=False):
        row["measured"] = measured
    for row, similarity in zip(rows, answer.similarities, strict=False):
        row["similarity"] = similarity
    query = answer.query
    is_at_point = query.give == "labels" and any(one.relation == "at" for one in query.where)
    is_at_point &= all(one.reference.area is None for one in query.where)
    if is_at_point:
        (point,) = (one.reference.point_xy for one in query.where)
        rows = [_brief(row, point) for row in rows]
    else:
        _tell_rooms(hypermap, rows)
    rows += map(_row_of_cell, answer.cells)
    if is_at_point:
        order = {layer.name: place for place, layer in enumerate(hypermap)}
        order |= {name: place for place, name in enumerate(dict.fromkeys(query.layers))}
        rows.sort(key=lambda row: order[row["layer"]])
    elif query.which == "nearest":
        rows.sort(key=lambda row: float(row["distance"]))
    return _with_times(rows) if query.give == "last_seen" else rows


class _Frame:
    """The frame in which options give points and areas."""

    def __init__(self, hypermap: Hypermap, frame_id: str | None) -> None:
        self._base_T_frame = pose_of_frame(hypermap, frame_id)

    def point(self, text: str, option: str) -> Reference:
        """Return a point "X,Y" in the base frame."""
        x, y = self._base_T_frame.apply(parse_point(text, option))[0].tolist()
        return Reference(point_xy=(x, y))

    def area(self, text: str, option: str) -> Reference:
        """Return an area in the base frame."""
        area: BaseGeometry = self._base_T_frame.apply_geometry(parse_area(text, option))
        return Reference(area=shapely.to_wkt(area, rounding_precision=-1))


def _give(hypermap: Hypermap, given: Options) -> Give:
    limits = given.get("--above") is not None or given.get("--below") is not None
    if limits and given.get("--measured") is None:
        return "places"
    if given.get("--last-seen"):
        return "last_seen"
    if given.get("--near") is not None:
        return "distance"
    others = (*_OF_OBJECTS, "--not-seen-for")
    if given.get("--by") == "path" or any(given.get(option) is not None for option in others):
        return "objects"
    if given.get("--value") is not None and not given.get("--layer"):
        return "objects"
    area = given.get("--in")
    names_room = area is not None and names_rooms(area) and not _asks_values(hypermap, given)
    return "objects" if names_room else "labels"


def _where(hypermap: Hypermap, given: Options, frame: _Frame) -> Iterator[Condition]:
    """Yield the conditions on where objects and cells are."""
    if (at := given.get("--at")) is not None:
        yield Condition("at", frame.point(at, "--at"))
    if (area := given.get("--in")) is not None:
        if names_rooms(area):
            rooms_asked(hypermap, area)
            yield Condition("in", Reference(rooms=(area,)))
        else:
            yield Condition("at", frame.area(area, "--in"))
    near, within = given.get("--near"), given.get("--within")
    if near is not None and within is not None:
        yield Condition("near", _thing_or_point(hypermap, near, frame), within)
    if (inside := given.get("--inside")) is not None:
        is_area = _is_place(hypermap, inside)
        place = frame.area(inside, "--inside") if is_area else Reference(names=(inside,))
        yield Condition("in", place)
    if (having := given.get("--with")) is not None:
        yield Condition("with", Reference(names=(having,)))


def _start(hypermap: Hypermap, given: Options, frame: _Frame) -> Reference | None:
    """Return from where distances are measured."""
    if (near := given.get("--near")) is not None:
        return _thing_or_point(hypermap, near, frame)
    if _count(given) is None:
        return None
    return frame.point(given.get("--from") or "0,0", "--from")


def _thing_or_point(hypermap: Hypermap, text: str, frame: _Frame) -> Reference:
    if _is_place(hypermap, text):
        return frame.point(text, "--near")
    return Reference(names=(text,))


def _count(given: Options) -> int | None:
    """Return how many of the nearest are wanted; None for all objects."""
    if given.get("--like") is not None:
        return None
    most: int | None = given.get("-k")
    return most if most is not None else 1 if given.get("--nearest") else None


def _measured(given: Options) -> Measured | None:
    name, above, below = (given.get(option) for option in ("--measured", "--above", "--below"))
    is_asked = any(part is not None for part in (name, above, below))
    return Measured(name, above, below) if is_asked else None


def _semantic(hypermap: Hypermap) -> tuple[str, ...]:
    """Return the layers that have objects."""
    placed = hypermap.placed_layers()
    return tuple(layer.name for layer in placed if isinstance(layer, SemanticLayer))


def _asks_values(hypermap: Hypermap, given: Options) -> bool:
    """Return whether all layers that are asked hold measured values."""
    layers = given.get("--layer")
    return bool(layers) and all(isinstance(hypermap[name], ValueLayer) for name in layers or ())


def _is_place(hypermap: Hypermap, text: str) -> bool:
    """Return whether a text is numbers or WKT, and not the name of an object."""
    layers = (layer for layer in hypermap if isinstance(layer, SemanticLayer))
    if any(text in layer.table.names_in_use for layer in layers):
        return False
    return re.fullmatch(r"\s*([-+.\d][-+.,\s\deE]*|[A-Za-z]+\s*\(.*)", text) is not None


def _check_numbers(given: Options) -> None:
    """Refuse numbers that are not finite."""
    for name, value in given.items():
        if isinstance(value, float) and not math.isfinite(value):
            raise HypermapError(f"{name} {value}: expected a finite number")


def _check_places(given: Options, *, is_of_objects: bool) -> None:
    """Refuse questions about the places of measured values that cannot be answered."""
    if is_of_objects:
        raise HypermapError(
            "--above and --below find places; to find objects or rooms, give --measured LAYER, too"
        )
    if len(given.get("--layer") or ()) > 1:
        raise HypermapError("--above and --below need a single layer; give --layer once")


def _check(given: Options) -> None:
    """Refuse questions without a meaning."""

    def has(*options: str) -> bool:
        return any(given.get(option) not in (None, [], (), False) for option in options)

    _check_numbers(given)
    names = has("--name", "--value")
    if has("--name") and has("--value"):
        raise HypermapError("give either --name or --value, not both")
    if (by := given.get("--by") or "air") not in ("air", "path"):
        raise HypermapError(f"--by {by!r}: expected air or path")
    times = (*_TIMES, "--last-seen")
    asked = names or has("--in", "--like", "--near", "--inside", "--with", *times)
    if has("--at") and (asked or has("-k", "--nearest", "--measured", "--above", "--below")):
        raise HypermapError("--at queries a point; combine it only with --layer and --frame")
    if has("--above", "--below") and not has("--measured"):
        is_of_objects = names or has("--near", "--within", "--inside", "--with") or by == "path"
        _check_places(given, is_of_objects=is_of_objects)
        return
    if has("--like") and has("--nearest", "--near"):
        raise HypermapError("--like finds the most similar objects; leave out --nearest and --near")
    if has("--embedder") and not has("--like"):
        raise HypermapError("--embedder needs --like: what should the objects look like?")
    is_nearest = has("-k", "--nearest") and not has("--like")
    if is_nearest and not names and by != "path":
        raise HypermapError("the nearest what? give --name NAME")
    if not (has("--at") or asked or is_nearest or (has("--measured") and has("--layer"))):
        raise HypermapError("there is no query; give --at X,Y, --in AREA or --name NAME")
    if is_nearest and has("--near"):
        raise HypermapError("give either --nearest (or -k) with --from, or --near")
    if by == "path" and not is_nearest:
        raise HypermapError("--by path measures the nearest; give --nearest or -k")
    if has("--robot-radius") and by != "path":
        raise HypermapError("--robot-radius needs --by path")
    if has("--within") and not has("--near"):
        raise HypermapError("--within needs --near: a distance from what?")


def _remarks(hypermap: Hypermap, given: Options, rows: Sequence[Row]) -> list[str]:
    """Return what is to be said next to an answer."""
    if not rows:
        return ["nothing found" + "".join(f"; {hint}" for hint in _hints(hypermap, given))]
    if _count(given) is not None and given.get("--from") is None:
        return ["measured from (0, 0); give --from X,Y to measure from elsewhere"]
    return []


def _hints(hypermap: Hypermap, given: Options) -> Iterator[str]:
    """Yield what may be wrong with the names in a question to which there is no answer."""
    layers = [layer for layer in hypermap.layers if isinstance(layer, SemanticLayer)]
    known = sorted({name for layer in layers for name in layer.table.names_in_use})
    for name in (*(given.get("--name") or ()), given.get("--near"), given.get("--inside")):
        if isinstance(name, str) and name not in known and not _is_place(hypermap, name):
            known_before = left_the_map(hypermap, name)
            yield f"no object is called {name!r}; {known_before or did_you_mean(name, known)}"
    if given.get("--by") == "path":
        yield "what no path leads to is left out"


def _with_times(rows: list[Row]) -> list[Row]:
    """Return the rows of objects with when they were last seen, the latest first."""
    for row in rows:
        seen = row["object"]["last_seen"]
        row["last_seen"] = None if seen is None else time_of(seen, short=True)
    return sorted(rows, key=lambda row: -(row["object"]["last_seen"] or -math.inf))


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


def _row_of_object(found: FoundObject) -> Row:
    item = found.object
    row = _row(found.layer, item.name, item.id, found.point_xy)
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


def _brief(row: Row, point: Any) -> Row:
    """Return the row of an object as one of many objects at a point."""
    x, y = point
    return {"layer": row["layer"], "label": row["label"], "value": row["value"], "x": x, "y": y}


def _row_of_cell(cell: Cell) -> Row:
    row = _row(cell.layer, cell.label, cell.value, cell.point_xy)
    far = {} if cell.distance is None else {"distance": cell.distance}
    return row | dict(cell.more) | far


def _row(layer: str, label: Any, value: Any, point_xy: NDArray[Any]) -> Row:
    x, y = map(float, point_xy)
    return {"layer": layer, "label": str(label), "value": value, "x": x, "y": y}
