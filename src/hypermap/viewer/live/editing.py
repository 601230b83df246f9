"""From the page's operations to changes of a map."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from hypermap.core.objects import SemanticObject
from hypermap.viewer.live.changes import Draft
from hypermap.viewer.live.refusals import Refused
from hypermap.viewer.live.requests import footprint_in, text_in, whole_number_in

MOST_OPERATIONS = 500
"""How many operations one request may hold."""

_LONGEST = 200  # characters of a name or tag
_MOST_TAGS = 100


def operations_in(body: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Return the operations of a request.

    Raises:
        Refused: If there are none, too many, or one is no object.
    """
    operations = body.get("operations")
    if not isinstance(operations, list) or not operations:
        raise Refused("operations: a list with at least one operation is expected")
    if len(operations) > MOST_OPERATIONS:
        raise Refused(f"{len(operations)} operations at once are too many ({MOST_OPERATIONS})")
    if not all(isinstance(operation, dict) for operation in operations):
        raise Refused("operations: each must be an object with the key op")
    return operations


def carry_out(draft: Draft, operation: Mapping[str, Any]) -> int | None:
    """Make the change that an operation asks for, and return the object's id; None for a layer.

    Raises:
        Refused: If the operation is incomplete or wrong.
        LayerNotFound, ObjectNotFound: If there is no such layer or object.
        HypermapError: If a layer to be added is there already.
    """
    kind = operation.get("op")
    layer = text_in(operation, "layer")
    if layer is None:
        raise Refused("layer: the operation must name one")
    if kind == "add_layer":
        draft.add_layer(_checked(layer, "layer"))
        return None
    if kind == "add":
        return _add(draft, layer, operation)
    number = whole_number_in(operation, "id")
    if kind == "update":
        item = draft.get(layer, number)
        draft.update(layer, number, _changed(draft, layer, item, operation))
    elif kind == "remove":
        draft.remove(layer, number)
    else:
        raise Refused(f"op: expected add, update, remove or add_layer, got {kind!r}")
    return number


def _add(draft: Draft, layer: str, operation: Mapping[str, Any]) -> int:
    shape = footprint_in(operation)
    if shape is None or operation.get("name") is None:
        raise Refused("a new object needs a name and a polygon")
    item = SemanticObject(_name(operation), shape)
    return draft.add(layer, _changed(draft, layer, item, operation))


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
