"""Applies the page's edit operations to a map."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import shapely

from hypermap.core.arrays import as_objects
from hypermap.core.hypermap import ROOMS
from hypermap.core.notes import Attachment
from hypermap.core.objects import SemanticObject
from hypermap.core.shapes import valid_copies
from hypermap.rooms.rooms import Rooms
from hypermap.viewer.live.changes import Draft
from hypermap.viewer.live.note_edits import NOTE_KINDS, apply_to_note
from hypermap.viewer.live.request_errors import Refused
from hypermap.viewer.live.requests import footprint_in, line_in, text_in, whole_number_in
from hypermap.viewer.live.room_edits import find_rooms, set_doors, split_room

MOST_OPERATIONS = 500
"""How many operations one request may hold."""

_KINDS = ("add", "update", "merge", "split", "remove", "add_layer", "find_rooms", *NOTE_KINDS)
_SEEN = "evidence"  # the attribute that says how often an object was seen
_LONGEST = 200  # characters of a name or tag
_MOST_TAGS = 100


def operations_in(body: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Return the operations of a request.

    Raises:
        Refused: If there are none, too many, or one is not an object.
    """
    operations = body.get("operations")
    if not isinstance(operations, list) or not operations:
        raise Refused("operations: a list with at least one operation is expected")
    if len(operations) > MOST_OPERATIONS:
        raise Refused(f"{len(operations)} operations at once are too many ({MOST_OPERATIONS})")
    if not all(isinstance(operation, dict) for operation in operations):
        raise Refused("operations: each must be an object with the key op")
    return operations


def apply_operation(
    draft: Draft, operation: Mapping[str, Any], files: Mapping[str, Attachment] | None = None
) -> int | None:
    """Make the change that an operation asks for, and return the object's id; None for layers.

    Args:
        draft: the map.
        operation: what to do.
        files: that may be attached to notes, by their hashes.

    Raises:
        Refused: If the operation is incomplete or wrong.
        LayerNotFound, ObjectNotFound: If there is no such layer or object.
        HypermapError: If a layer to be added is there already.
    """
    kind = operation.get("op")
    layer = text_in(operation, "layer")
    if layer is None:
        raise Refused("layer: the operation must name one")
    if kind in NOTE_KINDS:
        return apply_to_note(draft, layer, operation, files or {})
    if kind == "add_layer":
        draft.add_layer(_checked(layer, "layer"))
        return None
    if kind == "find_rooms":
        find_rooms(draft, layer)
        return None
    if kind == "add":
        return _add(draft, layer, operation)
    number = whole_number_in(operation, "id")
    if kind == "update":
        item = draft.get(layer, number)
        draft.update(layer, number, _changed(draft, layer, item, operation))
    elif kind == "merge":
        _merge(draft, layer, number, operation.get("others"))
    elif kind == "split":
        split_room(draft, layer, number, line_in(operation, "line"))
    elif kind == "remove":
        draft.remove(layer, number)
    else:
        raise Refused(f"op: expected one of {', '.join(_KINDS)}, got {kind!r}")
    return number


def _add(draft: Draft, layer: str, operation: Mapping[str, Any]) -> int:
    shape = footprint_in(operation)
    if shape is None or operation.get("name") is None:
        raise Refused("a new object needs a name and a polygon")
    item = SemanticObject(_name(operation), shape)
    if operation.get("like") is not None:
        item = _copied(draft.get(layer, whole_number_in(operation, "like")))
    return draft.add(layer, _changed(draft, layer, item, operation))


def _copied(item: SemanticObject) -> SemanticObject:
    """Return an object like one, of which nothing has been seen yet."""
    attributes = {key: value for key, value in item.attributes.items() if key != _SEEN}
    unseen: dict[str, Any] = dict.fromkeys(("id", "existence", "first_seen", "last_seen"))
    return replace(item, **unseen, attributes=attributes)


def _merge(draft: Draft, layer: str, number: int, others: Any) -> None:
    """Make objects part of one; it keeps its name, and is there if one of them is."""
    if not isinstance(others, list) or not others or number in others:
        raise Refused("others: the ids of other objects are expected, of which one is made")
    parts = [draft.get(layer, whole_number_in({"others": other}, "others")) for other in others]
    item = draft.get(layer, number)
    everything = [item, *parts]
    shapes = valid_copies(as_objects([part.footprint for part in everything]))
    merged = replace(
        item,
        footprint=shapely.union_all(shapes),
        existence=_of_known(max, (part.existence for part in everything)),
        first_seen=_of_known(min, (part.first_seen for part in everything)),
        last_seen=_of_known(max, (part.last_seen for part in everything)),
        attributes=_merged_attributes([part.attributes for part in everything]),
    )
    tags = list(dict.fromkeys(tag for part in everything for tag in part.tags))
    rooms = Rooms.of_layer(draft.layer(layer)) if layer == ROOMS else None
    for other in others:
        draft.remove(layer, other)
    draft.update(layer, number, _tagged(merged, tags))
    if rooms is not None:
        set_doors(draft, rooms.joined(number, others))


def _merged_attributes(attributes: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the attributes of a merged object: the first one's, and what all parts measure."""
    merged = {key: value for one in reversed(attributes) for key, value in one.items()}
    measured: dict[str, Callable[[Iterable[float]], float]]
    measured = {_SEEN: sum, "z_min": min, "z_max": max}
    for key, together in measured.items():
        values = [one[key] for one in attributes if isinstance(one.get(key), int | float)]
        merged |= {key: together(values)} if values else {}
    return merged


def _of_known(
    choose: Callable[[Iterable[float]], float], values: Iterable[float | None]
) -> float | None:
    known = [value for value in values if value is not None]
    return choose(known) if known else None


def _changed(
    draft: Draft, layer: str, item: SemanticObject, operation: Mapping[str, Any]
) -> SemanticObject:
    """Return an object with all that an operation names; shapes are given in the base frame."""
    if operation.get("name") is not None:
        item = replace(item, name=_name(operation))
    shape = footprint_in(operation)
    if shape is not None:
        hypermap = draft.hypermap
        layer_T_base = hypermap.frames.lookup(draft.layer(layer).frame_id, hypermap.base_frame)
        item = replace(item, footprint=layer_T_base.apply_geometry(shape))
    if operation.get("tags") is not None:
        item = _tagged(item, operation["tags"])
    return item


def _tagged(item: SemanticObject, tags: Any) -> SemanticObject:
    """Return an object with other tags; confidences stay if all of them are known."""
    if not isinstance(tags, list) or len(tags) > _MOST_TAGS:
        raise Refused(f"tags: a list of at most {_MOST_TAGS} texts is expected")
    names = tuple(_checked(tag, "tags") for tag in tags)
    known = dict(zip(item.tags, item.confidence, strict=False))
    all_known = all(name in known for name in names)
    confidence = tuple(known[name] for name in names) if all_known else ()
    return replace(item, tags=names, confidence=confidence)


def _name(operation: Mapping[str, Any]) -> str:
    return _checked(operation["name"], "name")


def _checked(text: Any, key: str) -> str:
    if not isinstance(text, str) or not text.strip():
        raise Refused(f"{key}: a text is expected, got {text!r}"[:200])
    if len(text) > _LONGEST:
        raise Refused(f"{key}: a text of {len(text)} letters is too long; at most {_LONGEST}")
    if not all(letter.isprintable() for letter in text):
        raise Refused(f"{key}: {text!r} has letters that cannot be shown")
    return text.strip()
