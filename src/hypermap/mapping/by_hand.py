"""Edits of a map made by hand, which mapping never undoes.

They are found by comparing the objects of a map with those that mapping published. So it does not
matter what changed them: the page, a program, or a text editor.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import shapely
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import as_objects
from hypermap.core.objects import SemanticObject
from hypermap.core.semantic import SemanticLayer
from hypermap.formats.backup import BY_HAND
from hypermap.formats.columns.footprints import footprints_from_wkb
from hypermap.formats.semantic.records import object_from_record, record_from_object
from hypermap.history.differences import MOVE

_MEASURED = {"evidence", "z_min", "z_max", MOVE}  # attributes that mapping writes
_TOLERANCE = 1e-6  # meters; points that are closer are equal


@dataclass(frozen=True, eq=False)
class HandEdit:
    """The edits of one object; None means unchanged.

    Attributes:
        is_deleted: whether it was deleted, and must not come back.
        drawn: the object, if it was drawn by hand.
        name: its name.
        footprint: its shape [m].
        tags: other names for it.
        attributes: those that mapping does not set.
    """

    is_deleted: bool = False
    drawn: SemanticObject | None = None
    name: str | None = None
    footprint: BaseGeometry | None = None
    tags: tuple[str, ...] | None = None
    attributes: Mapping[str, Any] = field(default_factory=dict)

    @property
    def shape(self) -> BaseGeometry | None:
        """The shape set by hand; None for none."""
        return self.footprint if self.drawn is None else self.drawn.footprint

    @property
    def words(self) -> list[str]:
        """The kinds of edits, as in files."""
        if self.is_deleted:
            return ["deleted"]
        if self.drawn is not None:
            return ["drawn"]
        words = {"name": self.name, "shape": self.footprint, "tags": self.tags}
        changed = [word for word, value in words.items() if value is not None]
        return [*changed, *(["attributes"] if self.attributes else [])]

    def applied_to(self, found: SemanticObject) -> SemanticObject:
        """Return an object found by mapping, with the edits applied."""
        return replace(
            found,
            name=found.name if self.name is None else self.name,
            footprint=found.footprint if self.footprint is None else self.footprint,
            tags=found.tags if self.tags is None else self.tags,
            confidence=found.confidence if self.tags is None else (),  # it is of the old tags
            attributes={**found.attributes, **self.attributes, BY_HAND: self.words},
        )


def hand_edits(
    published: Iterable[SemanticObject],
    layer: SemanticLayer,
    before: Mapping[int, HandEdit] | None = None,
) -> dict[int, HandEdit]:
    """Return the edits of a layer, by the objects' ids.

    Args:
        published: the objects that mapping published.
        layer: the present one.
        before: earlier edits, which `published` contains.
    """
    edits = dict(before or {})
    unreadable = {entry.position for entry in layer.rejected}
    now = {item.id: item for item in layer if item.id is not None}
    known = set()
    for item in published:
        assert item.id is not None  # each object of a layer has one
        known.add(item.id)
        edit = edits.pop(item.id, HandEdit())
        if item.id in now:
            edit = _compared(item, now[item.id], edit)
        elif item.id not in unreadable:  # an object drawn and deleted leaves no trace
            edit = HandEdit(is_deleted=edit.drawn is None)
        if edit.words:
            edits[item.id] = edit
    for number in now.keys() - known:
        edits[number] = HandEdit(drawn=_marked(now[number], ["drawn"]))
    return edits


def are_new(edits: Mapping[int, HandEdit], before: Mapping[int, HandEdit]) -> bool:
    """Return whether edits, by the objects' ids, differ from earlier ones."""
    one, other = ({n: as_record(edit) for n, edit in some.items()} for some in (edits, before))
    return one != other


def marked(layer: SemanticLayer, edits: Mapping[int, HandEdit]) -> SemanticLayer:
    """Return a layer whose edited objects have the attribute `by_hand`."""
    other = layer.copy()
    there = {number: edit.words for number, edit in edits.items() if number in layer}
    other.update_many({n: _marked(layer.get(n), words) for n, words in there.items()})
    return other


def ids_by_edit(edits: Mapping[int, HandEdit]) -> dict[str, list[int]]:
    """Return the ids of the objects drawn, changed and deleted by hand."""
    found: dict[str, list[int]] = {}
    for number, edit in sorted(edits.items()):
        word = edit.words[0] if edit.is_deleted or edit.drawn is not None else "changed"
        found.setdefault(word, []).append(number)
    return found


def as_record(edit: HandEdit) -> dict[str, Any]:
    """Return an edit as plain values."""
    record: dict[str, Any] = {"words": edit.words}
    if edit.drawn is not None:
        record["drawn"] = {"id": edit.drawn.id, **record_from_object(edit.drawn)}
    if edit.shape is not None:
        record["shape"] = shapely.to_wkb(edit.shape, hex=True)
    if edit.drawn is None:
        record |= {"name": edit.name, "tags": edit.tags and list(edit.tags)}
        record["attributes"] = dict(edit.attributes)
    return record


def from_record(record: Mapping[str, Any]) -> HandEdit:
    """Return the edit of `as_record`; raises KeyError, TypeError or ValueError for others."""
    if "deleted" in record["words"]:
        return HandEdit(is_deleted=True)
    shape = None
    if record.get("shape"):
        (shape,) = footprints_from_wkb(as_objects([bytes.fromhex(record["shape"])]))
    if "drawn" in record:
        if shape is None:
            raise ValueError("a drawn object has no shape")
        return HandEdit(drawn=object_from_record(record["drawn"], shape))
    tags = record["tags"]
    edit = HandEdit(
        name=record["name"],
        footprint=shape,
        tags=None if tags is None else tuple(tags),
        attributes=dict(record["attributes"]),
    )
    edit.applied_to(SemanticObject("any", shapely.box(0, 0, 1, 1)))  # which checks the values
    return edit


def _compared(item: SemanticObject, now: SemanticObject, before: HandEdit) -> HandEdit:
    """Return an earlier edit combined with the changes since then."""
    others = {k: v for k, v in now.attributes.items() if k not in _MEASURED and k != BY_HAND}
    is_same_shape = shapely.equals_exact(item.footprint, now.footprint, _TOLERANCE)
    if before.drawn is not None:
        return HandEdit(drawn=_marked(now, ["drawn"]))
    return HandEdit(
        name=before.name if now.name == item.name else now.name,
        footprint=before.footprint if is_same_shape else now.footprint,
        tags=before.tags if now.tags == item.tags else now.tags,
        attributes=others,
    )


def _marked(item: SemanticObject, words: list[str]) -> SemanticObject:
    return replace(item, attributes={**item.attributes, BY_HAND: words})
