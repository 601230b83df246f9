"""Queries and answers in words."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from hypermap.core.hypermap import ROOMS, FoundObject, Hypermap
from hypermap.questions.answer import Answer
from hypermap.questions.cells import Cell
from hypermap.questions.finder import NEXT_TO
from hypermap.questions.query import Condition, Measured, Number, Query, Reference, When
from hypermap.questions.sizes import Size, size_of, size_of_object
from hypermap.questions.times import minute_of, time_of
from hypermap.rooms.questions import rooms_of_objects
from hypermap.rooms.rooms import Room
from hypermap.text import printable

_GIVES = {
    "objects": "which objects",
    "count": "how many objects",
    "exists": "whether there is any",
    "distance": "how far the objects are",
    "room": "which room the objects are in",
    "rooms": "which rooms",
    "last_seen": "when the objects were last seen",
    "size": "how large they are",
    "labels": "what layers say",
    "places": "which places",
    "value": "what was measured",
}
_LONGEST_NOTE = 1000  # characters of what is said next to an answer
_MOST = 20  # objects are listed


def understood(query: Query) -> list[tuple[str, str]]:
    """Return how a question was understood, part by part.

    >>> understood(Query(names=("cup",), which="nearest", start=Reference(rooms=("kitchen",))))
    [('asked', 'which objects'), ('what', 'cup'), ('which', 'the nearest to room kitchen')]
    """
    what = " or ".join(query.rooms or query.names)
    has_any = query.give not in ("rooms", "places", "value") or (
        query.give == "rooms" and query.where
    )
    what = what or ("any" if has_any else "")
    what += f", but not {' or '.join(query.besides)}" if query.besides else ""
    parts = [("asked", _asked(query)), ("what", what)]
    if query.like is not None:
        parts.append(("looks like", query.like))
    parts.append(("tags", " and ".join(query.tags)))
    if query.number is not None:
        parts.append(("how many", _number(query.number)))
    parts += [("where", _condition(one)) for one in query.where]
    parts += [("when", _when(when)) for when in query.when]
    if query.measured is not None:
        parts.append(("measured", _measured(query.measured)))
    if query.as_of is not None:
        parts.append(("as of", minute_of(query.as_of)))
    if query.which is not None:
        number = f"{query.count} " if query.count else _ordinal(query.rank)
        measured = f" to {_reference(query.start)}" if query.start else ""
        counted = " in a room" if query.per else ""
        parts.append(("which", f"the {number}{query.which}{counted}{measured}"))
    elif query.start is not None:
        parts.append(("from", _reference(query.start)))
    if query.by == "path":
        parts.append(("measured", "along a path"))
    return [(part, text) for part, text in parts if text]


def _asked(query: Query) -> str:
    if query.per is None and query.layers != (ROOMS,):
        return _GIVES[query.give]
    if query.counts_each_room:
        return "how many objects are in each room"
    return {"count": "how many rooms", "exists": "whether there is any room"}.get(
        query.give, _GIVES["rooms"]
    )


def _ordinal(rank: int | None) -> str:
    """Return a rank as "2nd ", with a blank; nothing for the first."""
    if rank in (None, 1):
        return ""
    ending = {1: "st", 2: "nd", 3: "rd"}.get(
        rank % 10 if rank % 100 not in (11, 12, 13) else 0, "th"
    )
    return f"{rank}{ending} "


def _number(number: Number) -> str:
    if number.at_most == 0:
        return "none"
    if number.at_least == number.at_most:
        return f"exactly {number.at_least}"
    least = [f"at least {number.at_least}"] if number.at_least else []
    most = [] if number.at_most is None else [f"at most {number.at_most}"]
    return " and ".join([*least, *most])


def _when(when: When) -> str:
    since = "" if when.since is None else f" since {minute_of(when.since)}"
    until = "" if when.until is None else f" until {minute_of(when.until)}"
    if when.since is not None and when.until is not None:
        since = f" from {minute_of(when.since)}"
    return f"{when.seen}{since}{until}"


def _measured(measured: Measured) -> str:
    limits = (("above", measured.above), ("below", measured.below))
    said = [f"{word} {limit:g}" for word, limit in limits if limit is not None]
    return " ".join([measured.layer or "the only quantity", " and ".join(said)]).strip()


def _condition(condition: Condition) -> str:
    relation: str = condition.relation
    if relation in ("near", "beyond"):
        within = NEXT_TO if condition.within is None else condition.within
        relation = f"{'within' if relation == 'near' else 'more than'} {within:g} m of"
    negated = "not " if condition.negated else ""
    place = _reference(condition.reference)
    if relation == "in" and condition.reference.is_asker:
        place = "the room where you are"
    if condition.other is not None:
        place += f" and {_reference(condition.other)}"
    return f"{negated}{relation} {place}"


def _reference(reference: Reference) -> str:
    if reference.rooms:
        rooms = " or ".join(reference.rooms)
        return rooms if rooms.startswith("room ") else f"room {rooms}"
    if reference.point_xy is not None:
        return "({:g}, {:g})".format(*reference.point_xy)
    if reference.area is not None:
        return "the given area"
    if reference.is_asker:
        return "you"
    names = " or ".join(reference.names)
    where = " and ".join(map(_condition, reference.where))
    return f"({names} {where})" if where else names


def lines(hypermap: Hypermap, answer: Answer) -> Iterator[str]:
    """Yield the lines of an answer."""
    query, give = answer.query, answer.query.give
    if give == "count" and not query.counts_each_room:
        yield str(answer.count)
    elif give == "exists":
        number = f", {answer.count}" if query.number and not query.per else ""
        yield f"{'yes' if answer.exists else 'no'}{number}"
    elif not answer.rooms and not answer.exists:
        yield "none"
    if query.per is not None:
        yield from map(_counted, answer.rooms[:_MOST], answer.counts)
    elif give == "rooms":
        yield from map(_title, answer.rooms[:_MOST])
    elif give == "size" and query.rooms:
        for asked in answer.rooms[:_MOST]:
            if asked is not None:
                yield f"{printable(asked.name)} (id {asked.id}): {size_of(asked.outline)}"
    elif query.rooms:
        yield from map(_title, answer.rooms[:_MOST] if give != "count" else ())
    elif give == "room":
        pairs = zip(answer.first(_MOST), answer.rooms, strict=False)
        yield from (f"{_line(item)}: {_title(room)}" for item, room in pairs)
    elif give in ("places", "value"):
        yield from map(_cell_line, answer.cells[:_MOST])
    elif give != "count":
        yield from _object_lines(hypermap, answer)
    shown = len(answer.rooms) if query.counts_each_room else answer.count
    if shown > _MOST and (give != "count" or query.per is not None):
        yield f"and {shown - _MOST} more; --json lists all"
    yield from (printable(note, _LONGEST_NOTE) for note in answer.notes)


def _object_lines(hypermap: Hypermap, answer: Answer) -> Iterator[str]:
    """Yield a line for each object, with what was asked about it."""
    query, found = answer.query, answer.first(_MOST)
    rooms = rooms_of_objects(hypermap, found)
    is_timed = query.give == "last_seen" or bool(query.when)
    measured = [f", {one['label']}" for one in answer.measured] or [""] * len(found)
    for item, room, value in zip(found, rooms, measured, strict=False):
        seen = item.object.last_seen if is_timed else None
        is_seen = "" if seen is None else f", last seen {time_of(seen)}"
        size = f": {size_of_object(item.object)}" if query.give == "size" else ""
        yield f"{_line(item, room)}{value}{is_seen}{size}"


def document(hypermap: Hypermap, answer: Answer) -> dict[str, Any]:
    """Return an answer as JSON values: lengths in meters, in the base frame."""
    rooms = (
        answer.rooms if answer.query.give == "room" else rooms_of_objects(hypermap, answer.objects)
    )
    found: dict[str, Any] = {
        "query": answer.query.to_json(),
        "frame_id": hypermap.base_frame,
        "count": answer.count,
        "objects": [_row(item, room) for item, room in zip(answer.objects, rooms, strict=True)],
        "notes": list(answer.notes),
    }
    if answer.query.give == "size":
        for row, item in zip(found["objects"], answer.objects, strict=True):
            row["size"] = _sizes(size_of_object(item.object))
    if answer.measured:
        pairs = zip(found["objects"], answer.measured, strict=True)
        found["objects"] = [{**row, "measured": dict(measured)} for row, measured in pairs]
    if answer.cells:
        found["cells"] = [_cell(cell) for cell in answer.cells]
    if answer.query.asks_rooms:
        found["rooms"] = [_room(room) for room in answer.rooms if room is not None]
        for row, count in zip(found["rooms"], answer.counts, strict=False):
            row["count"] = count
        if answer.query.give == "size":
            for row, room in zip(found["rooms"], filter(None, answer.rooms), strict=True):
                row["size"] = _sizes(size_of(room.outline))
    if answer.query.give == "exists":
        found["exists"] = answer.exists
    return found


def title(item: FoundObject) -> str:
    """Return what an object is called in answers: its name and id."""
    return f"{printable(item.object.name)} {item.object.id}"


def _line(item: FoundObject, room: Room | None = None) -> str:
    x, y = item.point_xy
    far = "" if item.distance is None else f", {item.distance:.2f} m away"
    where = "" if room is None else f", in {printable(room.name)}"
    return f"{title(item)} at ({x:.2f}, {y:.2f}){where}{far}"


def _cell_line(cell: Cell) -> str:
    """Return a place where a quantity is so, or what it is at a point or in an area."""
    (x, y), more = cell.point_xy.tolist(), cell.more
    if "outline" in more:
        mean = "" if cell.value is None else f", mean {cell.value:.4g} {more['unit']}".rstrip()
        return f"{cell.label} around ({x:.2f}, {y:.2f}), {more['area']:.1f} m²{mean}"
    if "min" in more:
        return f"{cell.layer}: mean {cell.label}, {more['min']:.4g} to {more['max']:.4g}"
    deviation = more.get("deviation")
    about = "" if deviation is None else f" ± {deviation:.2g}"
    return f"{cell.layer} at ({x:.2f}, {y:.2f}): {cell.label}{about}"


def _title(room: Room | None) -> str:
    if room is None:
        return "in no room"
    x, y = room.outline.representative_point().coords[0]
    return f"{printable(room.name)} (id {room.id}) at ({x:.2f}, {y:.2f}), {room.area:.1f} m²"


def _counted(room: Room | None, count: int) -> str:
    return f"{_title(room)}: {count}"


def _sizes(size: Size) -> dict[str, float]:
    return {key: value for key, value in vars(size).items() if value is not None}


def _room(room: Room) -> dict[str, Any]:
    return {"id": room.id, "name": room.name, "kind": room.kind}


def _cell(cell: Cell) -> dict[str, Any]:
    x, y = cell.point_xy.tolist()
    row = {"layer": cell.layer, "label": cell.label, "value": cell.value, "x": x, "y": y}
    return row | dict(cell.more)


def _row(item: FoundObject, room: Room | None) -> dict[str, Any]:
    x, y = map(float, item.point_xy)
    row: dict[str, Any] = {"layer": item.layer, "id": item.object.id, "name": item.object.name}
    row |= {"x": x, "y": y, "existence": item.object.existence}
    row |= {
        key: stamp
        for key in ("first_seen", "last_seen")
        if (stamp := getattr(item.object, key)) is not None
    }
    if item.distance is not None:
        row["distance"] = item.distance
    if room is not None:
        row["room"] = _room(room)
    return row
