"""Semantic objects: one as a value, many as a table of columns."""

from __future__ import annotations

import bisect
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import IntArray, ObjectArray, as_objects, as_view, of_rows
from hypermap.core.shapes import can_be_footprints, check_footprint, valid_copies

MAX_ID = 2**31 - 1  # the largest in a message


@dataclass(frozen=True, eq=False)
class SemanticObject:
    """One object of a semantic layer, as a value.

    Attributes:
        name: its class, such as "cup".
        footprint: shapely Polygon or MultiPolygon on the floor, in the layer's frame [m]. Its
            outline may cross itself, as in some old files.
        id: stable identifier, 0 .. 2147483647; None lets the layer assign the next free one.
        tags: other names for it, most likely first.
        confidence: one number per tag; from mapping, the probability that there is such an object.
        existence: how much evidence there is for it (the score from mapping), if known.
        first_seen: stamp [s], if known.
        last_seen: stamp [s], if known.
        attributes: any others, of types that YAML has.

    Raises:
        ValueError: If the footprint has no points, a third or a non-finite coordinate, the id is
            out of range, or a number is not finite.
        TypeError: If the name is not a string, the footprint not a polygon, or the id not an
            integer.
    """

    name: str
    footprint: BaseGeometry
    id: int | None = None
    tags: tuple[str, ...] = ()
    confidence: tuple[float, ...] = ()
    existence: float | None = None
    first_seen: float | None = None
    last_seen: float | None = None
    attributes: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not isinstance(self.name, str):
            raise TypeError(f"an object's name must be text, got {self.name!r}")
        check_footprint(self.footprint)
        if self.id is not None:
            _check_id(self.id)
        tags: Any = self.tags
        if isinstance(tags, str):
            raise TypeError(f"tags must be several texts, got the text {tags!r}")
        object.__setattr__(self, "tags", tuple(self.tags))
        object.__setattr__(self, "confidence", tuple(self.confidence))
        if not all(math.isfinite(value) for value in self.confidence):
            raise ValueError(f"confidence must be finite, got {self.confidence}")
        for key in ("existence", "first_seen", "last_seen"):
            value = getattr(self, key)
            if value is not None and not math.isfinite(value):
                raise ValueError(f"{key} must be finite, got {value}")

    @property
    def probability(self) -> float | None:
        """The probability that there is such an object, 0..1; None if nothing is known about it."""
        existence = math.nan if self.existence is None else self.existence
        return _or_none(probability_of(self.confidence, existence))

    def __repr__(self) -> str:
        number = "" if self.id is None else f" {self.id}"
        with np.errstate(all="ignore"):  # GEOS divides by the lengths of edges without length
            middle, area = self.footprint.centroid, self.footprint.area
        where = f"at ({middle.x:.2f}, {middle.y:.2f}), {area:.3g} m^2"
        tags = f", tags {', '.join(map(repr, self.tags))}" if self.tags else ""
        return f"<SemanticObject{number} {self.name!r} {where}{tags}>"

    def with_id(self, number: int) -> SemanticObject:
        """Return the same object with an id.

        Raises:
            ValueError: If the id is out of range.
        """
        if self.id == number:
            return self
        _check_id(number)
        return _unchecked(vars(self), id=number)

    def copy(self) -> SemanticObject:
        """Return the same object with a copy of its footprint, which no other thread prepares."""
        return _unchecked(vars(self), footprint=shapely.force_2d(self.footprint))


def probability_of(confidence: Sequence[float], existence: float) -> float:
    """Return the probability that there is an object, 0..1.

    Args:
        confidence: the object's; the probability is that of the most likely tag.
        existence: the object's, from which it follows without a confidence; NaN if unknown.

    Returns:
        NaN if neither is known.

    >>> probability_of((0.7, 0.2), 3.0)
    0.7
    """
    if confidence:
        return max(confidence)
    if math.isnan(existence):
        return math.nan
    return 1 / (1 + math.exp(-max(-50.0, min(50.0, existence))))


@dataclass(frozen=True)
class Rejected:
    """An entry of a layer's file that could not be read; it is written back unchanged.

    Attributes:
        position: its position in the file, from 0, which would have been its id.
        name: its name, if it has one.
        reason: what is wrong with it.
        entry: the entry itself, as parsed.
    """

    position: int
    name: str
    reason: str
    entry: Any


@dataclass(frozen=True, eq=False)
class ObjectTable:
    """Semantic objects as parallel columns, one row per object; immutable.

    All users of the table share its geometries: before `shapely.prepare` or a function that
    prepares, such as `shapely.contains_xy`, make copies with `shapely.force_2d`.

    Attributes:
        ids: int64, shape (N,), unique.
        codes: the index of each name in the vocabulary, int32, shape (N,).
        footprints: geometries as they were given, shape (N,).
        tags: tuples, shape (N,).
        confidence: tuples, shape (N,).
        existence: shape (N,); NaN if unknown, as in the next two.
        first_seen: stamps [s], shape (N,).
        last_seen: stamps [s], shape (N,).
        attributes: mappings, shape (N,).
        vocabulary: name -> code; may include names of removed objects.
    """

    ids: NDArray[np.int64]
    codes: NDArray[np.int32]
    footprints: ObjectArray
    tags: ObjectArray
    confidence: ObjectArray
    existence: NDArray[np.float64]
    first_seen: NDArray[np.float64]
    last_seen: NDArray[np.float64]
    attributes: ObjectArray
    vocabulary: Mapping[str, int]

    @classmethod
    def of(
        cls, objects: Sequence[SemanticObject], vocabulary: Mapping[str, int] | None = None
    ) -> ObjectTable:
        """Return objects, all with ids, as a table; its vocabulary may extend another."""
        known = dict(vocabulary or {})
        codes = [known.setdefault(item.name, len(known)) for item in objects]
        return cls(
            ids=np.array([item.id for item in objects], dtype=np.int64),
            codes=np.array(codes, dtype=np.int32),
            footprints=as_objects(item.footprint for item in objects),
            tags=as_objects(item.tags for item in objects),
            confidence=as_objects(item.confidence for item in objects),
            existence=_or_nan(item.existence for item in objects),
            first_seen=_or_nan(item.first_seen for item in objects),
            last_seen=_or_nan(item.last_seen for item in objects),
            attributes=as_objects(item.attributes for item in objects),
            vocabulary=known,
        )

    def check(self, *, footprints: bool = True) -> None:
        """Check that columns from elsewhere are valid objects with ids.

        Args:
            footprints: whether to check these too, which takes most of the time.

        Raises:
            ValueError: If an id is out of range or a duplicate, a footprint is invalid, or a number
                is infinite. Names, tags, confidence and attributes are not checked.
        """
        ordered = np.sort(self.ids)
        if len(ordered) and not (ordered[0] >= 0 and ordered[-1] <= MAX_ID):
            raise ValueError(f"an object's id must be between 0 and {MAX_ID}")
        twice = ordered[1:][ordered[1:] == ordered[:-1]]
        if len(twice):
            raise ValueError(f"two objects have the id {twice[0]}")
        if footprints:
            for footprint in self.footprints[~can_be_footprints(self.footprints)][:1]:
                check_footprint(footprint)
        for name in ("existence", "first_seen", "last_seen"):
            if np.isinf(getattr(self, name)).any():
                raise ValueError(f"{name} must be finite")

    def __len__(self) -> int:
        return len(self.ids)

    def __getstate__(self) -> dict[str, Any]:
        return {column.name: getattr(self, column.name) for column in fields(self)}

    # Computed from the columns on first access

    @cached_property
    def shapes(self) -> ObjectArray:
        """The footprints for queries, repaired where they are not valid, shape (N,)."""
        return valid_copies(self.footprints)

    @cached_property
    def centroids(self) -> NDArray[np.float64]:
        """Centroids of the shapes [m], shape (N, 2)."""
        return np.asarray(shapely.get_coordinates(shapely.centroid(self.shapes)))

    @cached_property
    def areas(self) -> NDArray[np.float64]:
        """Areas of the shapes [m^2], shape (N,)."""
        return np.asarray(shapely.area(self.shapes))

    @cached_property
    def boxes(self) -> NDArray[np.float64]:
        """Boxes around the shapes: x0, y0, x1, y1 [m], shape (N, 4)."""
        return np.asarray(shapely.bounds(self.shapes))

    @cached_property
    def names(self) -> ObjectArray:
        """The objects' names, shape (N,)."""
        return self._known_names[self.codes]

    @cached_property
    def names_in_use(self) -> frozenset[str]:
        """The names that objects have; the vocabulary may have others, of removed objects."""
        used = np.bincount(self.codes, minlength=len(self.vocabulary)) > 0
        return frozenset(name for name, code in self.vocabulary.items() if used[code])

    @cached_property
    def attribute_keys(self) -> frozenset[str]:
        """The keys of the attributes that any object has."""
        return frozenset().union(*set(map(tuple, self.attributes.tolist())))

    @cached_property
    def _known_names(self) -> ObjectArray:
        return as_objects(self.vocabulary)

    def rows_of(self, what: str | float) -> IntArray:
        """Return the rows of the objects with a name or, for a number, an id, shape (M,)."""
        if isinstance(what, str):
            return np.flatnonzero(self.codes == self.vocabulary.get(what, -1))
        return np.flatnonzero(self.ids == what)

    def object(self, row: int) -> SemanticObject:
        """Return one row as an object, with a copy of the footprint."""
        return _unchecked(
            name=str(self._known_names[self.codes[row]]),
            footprint=shapely.force_2d(self.footprints[row]),
            id=int(self.ids[row]),
            tags=self.tags[row],
            confidence=self.confidence[row],
            existence=_or_none(self.existence[row]),
            first_seen=_or_none(self.first_seen[row]),
            last_seen=_or_none(self.last_seen[row]),
            attributes=self.attributes[row],
        )

    def take(self, rows: IntArray) -> ObjectTable:
        """Return some of the rows."""
        return self._changed(lambda name: of_rows(getattr(self, name), rows), self.vocabulary)

    def row_of_id(self, object_id: int) -> int:
        """Return the row of an id; -1 if there is none."""
        ids, order = self._sorted_ids
        at = bisect.bisect_left(ids, object_id)
        if at == len(ids) or ids[at] != object_id:
            return -1
        return at if order is None else int(order[at])

    @cached_property
    def _sorted_ids(self) -> tuple[memoryview[int], IntArray | None]:
        """The ids in ascending order, and the row of each; None if the rows are in this order."""
        if (self.ids[1:] > self.ids[:-1]).all():
            return as_view(self.ids), None
        order = np.argsort(self.ids, kind="stable")
        return as_view(self.ids[order]), order

    def take_with(self, rows: IntArray, other: ObjectTable) -> ObjectTable:
        """Return some rows of this table, with all rows of another table among them.

        Args:
            rows: each number from `len(self)` on stands for the next row of the other table.
            other: its vocabulary extends this one's.
        """
        mine, others = np.flatnonzero(rows < len(self)), np.flatnonzero(rows >= len(self))

        def column(name: str) -> NDArray[Any]:
            values = getattr(self, name)
            both = np.empty((len(rows), *values.shape[1:]), dtype=values.dtype)
            both[mine] = of_rows(values, rows[mine])
            both[others] = getattr(other, name)
            return both

        return self._changed(column, other.vocabulary)

    def _changed(
        self, column: Callable[[str], NDArray[Any]], vocabulary: Mapping[str, int]
    ) -> ObjectTable:
        """Return a table of other columns; computed columns are updated, not computed again."""
        columns: dict[str, Any] = {name: column(name) for name in _COLUMNS}
        table = ObjectTable(**columns, vocabulary=vocabulary)
        vars(table).update({name: column(name) for name in _COMPUTED if name in vars(self)})
        return table


_COLUMNS = [column.name for column in fields(ObjectTable) if column.name != "vocabulary"]
_COMPUTED = ("shapes", "centroids", "areas", "boxes")


def _unchecked(*values: Mapping[str, Any], **others: Any) -> SemanticObject:
    """Return an object from attributes that were checked before."""
    item = object.__new__(SemanticObject)
    vars(item).update(*values, **others)
    return item


def _check_id(number: int) -> None:
    if isinstance(number, bool) or not isinstance(number, int | np.integer):
        raise TypeError(f"an object's id must be an integer, got {number!r}")
    if not 0 <= number <= MAX_ID:
        raise ValueError(f"an object's id must be between 0 and {MAX_ID}, got {number}")


def _or_nan(values: Iterable[float | None]) -> NDArray[np.float64]:
    return np.array([np.nan if value is None else value for value in values], dtype=np.float64)


def _or_none(value: float) -> float | None:
    return None if math.isnan(value) else float(value)
