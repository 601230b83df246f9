"""What a drive shows of the objects that earlier drives knew: which have stayed, moved, or left.

Each drive makes tracks of its own. They and those of earlier drives are assigned to each other, all
together: what has stayed adds its evidence to the known object, and what was moved keeps the known
id. Nothing is decided before the next drive begins: what comes later may tell more.

Source: a linear assignment with costs that are negative logarithms of likelihoods, up to a
constant, as of targets in Blackman, "Multiple-target tracking with radar applications" (1986); here
of objects, between drives.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence, Set
from typing import Generic, TypeAlias, TypeVar

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import as_objects
from hypermap.history.likeness import MAY_BE, SAME_SHAPE, fills_its_place
from hypermap.mapping.association import ASSOCIATIONS
from hypermap.mapping.compared_tracks import likeness_of, sides
from hypermap.mapping.evidence_buffer import CONFIRMED, Evidence, EvidenceBuffer
from hypermap.mapping.fusion import FUSIONS
from hypermap.mapping.moved import GONE
from hypermap.mapping.prepared_polygon import PreparedPolygon
from hypermap.mapping.reunion import Reunion, SeenBefore, parted
from hypermap.mapping.seen_sizes import hull_of_both
from hypermap.mapping.stages import EvidenceConfig
from hypermap.mapping.track_shapes import TrackShapes
from hypermap.mapping.tracks import Track, TrackTable, are_two

T = TypeVar("T")

_LEAST = 0.2  # [m]; least distance of centroids for a move within an object's place
_PER_AREA = 0.4  # [m] per square meter of an object of which a drive may see only one side
_AS_MUCH = 0.5  # share of the floor that a moved object leaves, from which it takes about as much
_GROWN = 0.2  # share of the floor that it takes, below which what it leaves tells of no move
_LITTLE = 0.4  # IoU below which it is not in its place, whether or not this was seen
_APART = 0.2  # IoU below which another shape does not tell that it has stayed
_VIEWS = 2  # of the floor that it has left or taken
_COVERED = 0.5  # share of that floor which such a view must cover
_BESIDE = 0.2  # [m] by which poses may put a small object beside its place


_Evidence: TypeAlias = "tuple[EvidenceBuffer, PreparedPolygon | None]"
"""Evidence, not to be changed, and the shape that it shows; None if people have given one."""


class EarlierDrives:
    """Joins the tracks of the present drive to those of earlier ones."""

    def __init__(self, config: EvidenceConfig) -> None:
        self._config = config
        self._fuse = FUSIONS[config.fusion]
        self._associate = ASSOCIATIONS[config.association]
        self._seen_before: SeenBefore = {}
        self._have_shifted = _OfPairs(_has_shifted)
        self._joined = _OfPairs(self._join)

    def begin_drive(self) -> None:
        """Forget what is known of the tracks of the drive so far."""
        self._seen_before.clear()
        self._have_shifted.keep(frozenset())
        self._joined.keep(frozenset())

    def settled(self, tracks: TrackTable) -> TrackTable:
        """Return a table in which each object has one track; `tracks` itself if it has already.

        Args:
            tracks: of earlier drives, and of the present one; not changed.
        """
        known, fresh = parted(tracks)
        if not known or not fresh:
            return tracks
        pairs = Reunion(tracks, self._config, self._seen_before).pairs()
        ids = {tracks.objects[row].id for row in fresh}
        self._seen_before = {n: seen for n, seen in self._seen_before.items() if n in ids}
        self._have_shifted.keep(ids)
        self._joined.keep(ids)
        if not pairs:
            return tracks
        table = tracks.snapshot()
        joined: dict[int, int] = {}  # rows of this drive's tracks, and the known ones that get them
        for pair in pairs:
            confidence = pair.confidence
            if confidence is None and self._have_shifted.of(tracks, pair.known, pair.fresh):
                confidence = 1.0
            if confidence is None:
                self._add_evidence(table, pair.known, pair.fresh)
            else:
                _move(table, pair.known, pair.fresh, confidence)
            joined[pair.fresh] = pair.known
        for row in fresh:
            is_there = row not in joined and tracks.existence[row] > GONE
            if is_there and (whole := self._whole_of(table, row, joined)) is not None:
                self._add_evidence(table, whole, row)
                joined[row] = whole
        objects = table.objects
        _rename(table, {objects[own].id: objects[known].id for own, known in joined.items()})
        table.remove(sorted(joined))
        return table

    def _add_evidence(self, table: TrackTable, known: int, fresh: int) -> None:
        """Add the evidence of a track of this drive to the known one that it shows."""
        track, (buffer, shape) = table.objects[known], self._joined.of(table, known, fresh)
        track.buffer = buffer
        track.pending, track.gone_since = 0, None
        existence, spared = table.existence, table.spared
        table.change_existence(known, max(0.0, -float(existence[known])))
        table.change_existence(known, float(existence[fresh]), float(spared[fresh]))
        table.misses[known] += table.misses[fresh]
        if shape is not None:
            table.shapes.replace(known, shape)
        table.shapes.heights[known] = buffer.heights()
        table.note_times([known])

    def _join(self, table: TrackTable, known: int, fresh: int) -> _Evidence:
        """Return the evidence of two tracks, and the shape that it shows."""
        track, own = table.objects[known], table.objects[fresh]
        buffer = track.buffer.copy()
        buffer.merge([own.buffer])
        has_shape = track.by_hand is not None and track.by_hand.shape is not None
        return buffer, None if has_shape else self._fuse(buffer, self._config)

    def _whole_of(self, table: TrackTable, row: int, joined: dict[int, int]) -> int | None:
        """Return the row of the known track of which another one shows a part; None if of none.

        The known one has its evidence of this drive already, from a track that no frame shows
        together with this one.
        """
        objects, shapes = table.objects, table.shapes
        own = {known: fresh for fresh, known in joined.items()}
        shape, class_ = shapes.polygons[row], int(shapes.classes[row])
        matches = self._associate(shape, class_, shapes, self._config)
        near = [one for _, one in beside(shape, class_, shapes)]
        near += _along(shape, class_, shapes)
        near = [one for one in near if objects[one].id < table.first_id]
        for known in [*matches, *near]:
            is_free = objects[known].by_hand is None and table.existence[known] > GONE
            if known in own and is_free and not are_two(objects[own[known]], objects[row], 0):
                return known
        return None


class _OfPairs(Generic[T]):
    """What is computed of a known track and one of this drive: anew only if one has changed."""

    def __init__(self, make: Callable[[TrackTable, int, int], T]) -> None:
        """Prepare to compute it by `make`, given a table, and the rows of both tracks."""
        self._make = make
        self._found: dict[tuple[int, int], tuple[object, T]] = {}

    def of(self, tracks: TrackTable, known: int, fresh: int) -> T:
        """Return it for the tracks in two rows."""
        one, other = tracks.objects[known], tracks.objects[fresh]
        shapes = tracks.shapes.polygons[known], tracks.shapes.polygons[fresh]
        state, pair = (one.buffer.state, other.buffer.state, shapes), (one.id, other.id)
        found = self._found.get(pair)
        if found is None or found[0] != state:
            found = self._found[pair] = state, self._make(tracks, known, fresh)
        return found[1]

    def keep(self, ids: Set[int]) -> None:
        """Forget all tracks of this drive but some."""
        self._found = {pair: found for pair, found in self._found.items() if pair[1] in ids}


def _has_shifted(tracks: TrackTable, known: int, fresh: int) -> bool:
    """Return whether an object has moved within its place, or next to it.

    Some pieces of evidence of both drives must agree on places apart, and this drive must have seen
    the floor where it was. Its shape may be another one only if it is hardly in its place any more.
    A large object must have moved farther, because a drive may see only one side of it, unless
    about as much floor is taken as is left, and earlier views saw that. What leaves hardly any has
    not moved: more of it is seen, or something beside it is taken for a part of it.
    """
    track, own = tracks.objects[known], tracks.objects[fresh]
    if min(len(track.buffer), len(own.buffer)) < CONFIRMED or track.by_hand is not None:
        return False
    if own.buffer.first_seen < track.buffer.last_seen:  # an older drive, which is mapped later
        return False
    was, here = (tracks.shapes.polygons[row] for row in (known, fresh))
    if shapely.distance(was.geometry.centroid, here.geometry.centroid) < _LEAST:
        return False
    shared = shapely.area(shapely.intersection(was.geometry, here.geometry))
    is_apart = shared < _APART * (was.area + here.area - shared)
    if likeness_of(was, here) < (MAY_BE if is_apart else SAME_SHAPE):
        return False
    return _is_elsewhere(here.geometry, was.geometry, own.buffer.items, track.buffer.items)


def beside(shape: PreparedPolygon, class_: int, tracks: TrackShapes) -> list[tuple[float, int]]:
    """Return where tracks of a class are just beside a small shape, in the order of their rows.

    Poses may put one small object into two places. Of a larger one, they overlap.

    Returns:
        The distances of the centroids [m], and the rows of the tracks; none for a larger shape.
    """
    if not shape.area < _BESIDE**2:
        return []
    place = shape.geometry.centroid
    rows = tracks.near(class_, place.buffer(_BESIDE).bounds)
    distances = [
        (float(shapely.distance(tracks.polygons[row].geometry.centroid, place)), row)
        for row in rows
    ]
    return [(distance, row) for distance, row in distances if distance < _BESIDE]


def _along(shape: PreparedPolygon, class_: int, tracks: TrackShapes) -> list[int]:
    """Return the rows of tracks of a class in front of or behind a thin shape, not in a row."""
    if sides(shape)[0] >= _BESIDE:
        return []
    xmin, ymin, xmax, ymax = shape.box
    box = xmin - _BESIDE, ymin - _BESIDE, xmax + _BESIDE, ymax + _BESIDE
    rows = []
    for row in tracks.near(class_, box):
        other = tracks.polygons[row]
        longest = max(shape.diameter, other.diameter)
        is_near = shapely.dwithin(other.geometry, shape.geometry, _BESIDE)
        if is_near and hull_of_both(shape, other).diameter < longest + _BESIDE:
            rows.append(row)
    return rows


def _move(table: TrackTable, known: int, fresh: int, confidence: float) -> None:
    """Let a known track go on at the place of one of this drive."""
    track, own = table.objects[known], table.objects[fresh]
    pictures, colors, embedding = track.buffer.pictures, track.buffer.colors, track.buffer.embedding
    track.buffer = own.buffer.since(track.buffer.first_seen)
    track.buffer.keep_looks(pictures, colors, embedding)
    track.pending, track.gone_since = own.pending, None
    track.moved, track.moved_since = confidence, own.buffer.first_seen
    table.shapes.replace(known, table.shapes.polygons[fresh])
    table.shapes.heights[known] = table.shapes.heights[fresh]
    for column in (table.existence, table.spared, table.misses):
        column[known] = column[fresh]
    _forget_co_occurrences(table, track)
    table.note_times([known])


def _forget_co_occurrences(table: TrackTable, track: Track) -> None:
    for row in table.rows_of(track.co_occurrences):
        table.objects[row].co_occurrences.pop(track.id, None)
    track.co_occurrences.clear()


def _rename(table: TrackTable, ids: dict[int, int]) -> None:
    """Count co-occurrences with tracks of this drive for the known ones that they have joined.

    Args:
        table: changed.
        ids: of the known ones, by those of this drive.
    """
    for track in table.objects:
        for own in ids.keys() & track.co_occurrences.keys():
            track.co_occurrences[ids[own]] += track.co_occurrences.pop(own)
    by_id = {track.id: track for track in table.objects}
    for own, known in ids.items():
        by_id[known].co_occurrences.update(by_id[own].co_occurrences)
        by_id[own].co_occurrences.clear()
    for known in set(ids.values()):
        by_id[known].co_occurrences.pop(known, None)


def _is_elsewhere(
    here: BaseGeometry,
    was: BaseGeometry,
    fresh: Sequence[Evidence],
    earlier: Sequence[Evidence],
) -> bool:
    """Return whether a shape has moved from another one, by the views of it and of that one."""
    shift = shapely.distance(shapely.centroid(here), shapely.centroid(was))
    left, taken = _only_in(was, here), _only_in(here, was)
    if left.is_empty or not _saw(left, fresh):
        shared = shapely.area(shapely.intersection(here, was))
        together = here.area + was.area - shared
        return bool(shared < _LITTLE * together) and not fills_its_place(here, was)
    if shift >= _PER_AREA * min(here.area, was.area) and not fills_its_place(here, was):
        return True
    is_larger = left.area < _GROWN * taken.area  # rather than elsewhere
    return not is_larger and bool(taken.area >= _AS_MUCH * left.area) and _saw(taken, earlier)


def _only_in(one: BaseGeometry, other: BaseGeometry) -> BaseGeometry:
    """Return the part of a shape outside of another one, which may be off by a little."""
    return one.difference(shapely.buffer(other, 0.05))


def _saw(area: BaseGeometry, items: Sequence[Evidence]) -> bool:
    """Return whether some views of an object saw an area of the floor."""
    seen = as_objects(item.visible_area for item in items)
    shares = shapely.area(shapely.intersection(seen, area)) / area.area
    return int(np.count_nonzero(shares >= _COVERED)) >= _VIEWS
