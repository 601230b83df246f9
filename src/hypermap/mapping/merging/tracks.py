"""Joins the tracks of two maps of one place: those of one object become one.

This is for drives of which the maps keep no frames; others are mapped again (`again`). Tracks of
two maps are associated one to one, as observations are with tracks; small ones also where poses may
have put them beside their places, as between drives. If only one map has a track, each later view
of the other map that should have shown it is a missed detection.
"""

from __future__ import annotations

import dataclasses
import math
from collections import Counter
from collections.abc import Callable, Sequence

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import BoolArray, ObjectArray, as_objects
from hypermap.mapping.association import ASSOCIATIONS
from hypermap.mapping.earlier_drives import beside
from hypermap.mapping.evidence_buffer import Evidence
from hypermap.mapping.footprint_iou import at_same_height
from hypermap.mapping.fusion import FUSIONS
from hypermap.mapping.merging.moving import renumbered
from hypermap.mapping.missed_detections import prune
from hypermap.mapping.prepared_polygon import shared_area
from hypermap.mapping.stages import EvidenceConfig
from hypermap.mapping.tracks import TrackTable, are_two

_VISIBLE, _WHOLE = 0.5, 1 - 1e-6
"""Share of an object that a later view must cover to have missed it: on free floor, elsewhere."""

_TINY = 1e-9  # [m²] of lines that people have drawn

IsFree = Callable[[BaseGeometry, float], bool]
"""Returns whether a map knows an area of the floor to be free, and so that nothing stands there
that begins at a height [m]."""


@dataclasses.dataclass(frozen=True)
class Joined:
    """The tracks of two maps as one table.

    Attributes:
        tracks: those of the first map, whose ids stay, then those only in the second one.
        ids: the new ids of the second map's tracks, by their old ids.
        pairs: the ids of the tracks in both maps.
        conflicts: the ids of those edited by hand in both maps; the first map's edits are kept.
    """

    tracks: TrackTable
    ids: dict[int, int]
    pairs: frozenset[int]
    conflicts: frozenset[int]


def join_tracks(
    first: TrackTable,
    second: TrackTable,
    config: EvidenceConfig,
    is_free: tuple[IsFree, IsFree],
) -> Joined:
    """Return the tracks of two maps in one table.

    Args:
        first: tracks of a map; not changed.
        second: those of another map, in the same frame.
        config: of both maps.
        is_free: for each map, whether its occupancy grid knows that nothing stands in an area.
    """
    tracks, second = first.snapshot(), second.snapshot()
    _use_same_classes(tracks, second)
    partners = _partners(tracks, second, config)
    partners |= _doubles(tracks, second, partners)
    until = _until(tracks, second, partners)
    views = _views(tracks), _views(second)
    _count_misses(tracks, until[0], views[1], is_free[1], config)
    _count_misses(second, until[1], views[0], is_free[0], config)
    ids = {other: tracks.objects[row].id for other, row in partners.items()}
    pairs = frozenset(ids.values())
    conflicts = _merge_pairs(tracks, second, partners, config)
    for row, track in enumerate(second.objects):
        if track.id not in ids:
            ids[track.id] = tracks.next_id
            tracks.add(
                renumbered(track, tracks.next_id),
                int(second.shapes.classes[row]),
                second.shapes.polygons[row],
                tuple(second.shapes.heights[row].tolist()),
                float(second.existence[row]),
                second.missed(row),
            )
    tracks.first_id = tracks.next_id  # none is of a drive that goes on
    _add_co_occurrences(tracks, second, ids, pairs)
    gone = {track.id for track in prune(tracks, config)}
    for track in tracks.objects:
        for number in gone & track.co_occurrences.keys():
            del track.co_occurrences[number]
    return Joined(tracks, ids, pairs, conflicts)


def _use_same_classes(*tables: TrackTable) -> None:
    numbers: dict[str, int] = {}
    for table in tables:
        for row, track in enumerate(table.objects):
            table.shapes.classes[row] = numbers.setdefault(track.name, len(numbers))


def _partners(first: TrackTable, second: TrackTable, config: EvidenceConfig) -> dict[int, int]:
    """Return the rows in the first table of tracks in both, by their ids in the second.

    Of those that match, the pairs with the largest Jaccard indexes are taken first, as a piece of
    an object overlaps it altogether. Tracks that are not on their map may be nothing, and count
    half.
    """
    associate = ASSOCIATIONS[config.association]
    weights = [np.where(_is_there(one, config), 1.0, 0.5) for one in (first, second)]
    found: list[tuple[float, int, int]] = []
    for row, shape in enumerate(second.shapes.polygons):
        for match in associate(shape, int(second.shapes.classes[row]), first.shapes, config):
            other = first.shapes.polygons[match]
            shared = shared_area(shape, other)
            jaccard = shared / max(shape.area + other.area - shared, _TINY)
            found.append((-jaccard * weights[0][match] * weights[1][row], row, match))
    partners: dict[int, int] = {}
    taken: set[int] = set()
    for _, row, match in sorted(found):
        if second.objects[row].id not in partners and match not in taken:
            taken.add(match)
            partners[second.objects[row].id] = match
    return partners


def _doubles(first: TrackTable, second: TrackTable, partners: dict[int, int]) -> dict[int, int]:
    """Return partners of more tracks of the second table, small ones beside those of the first.

    They are pieces of evidence for one object, unless frames of the second map show it together
    with a nearer partner.
    """
    taken = {row: second.objects[second.rows_of([other])[0]] for other, row in partners.items()}
    distances: list[tuple[float, int, int]] = []
    for row, track in enumerate(second.objects):
        if track.id not in partners and track.by_hand is None:
            polygon, class_ = second.shapes.polygons[row], int(second.shapes.classes[row])
            heights = second.shapes.heights[row]
            distances += [
                (distance, row, match)
                for distance, match in beside(polygon, class_, first.shapes)
                if first.objects[match].by_hand is None
                and at_same_height(heights, first.shapes.heights[match])
            ]
    found: dict[int, int] = {}
    for _, row, match in sorted(distances):
        track, partner = second.objects[row], taken.get(match)
        if track.id not in found and (partner is None or not are_two(partner, track, 0)):
            found[track.id] = match
            taken.setdefault(match, track)
    return found


def _is_there(tracks: TrackTable, config: EvidenceConfig) -> BoolArray:
    """Return which tracks are on their map, by their existence or by hand, shape (N,)."""
    is_there: BoolArray = tracks.existence > config.publish_above
    is_there |= np.array([track.by_hand is not None for track in tracks.objects], dtype=bool)
    return is_there


def _merge_pairs(
    first: TrackTable, second: TrackTable, partners: dict[int, int], config: EvidenceConfig
) -> frozenset[int]:
    """Add the evidence of tracks of the second table to their partners; return conflicts."""
    fuse = FUSIONS[config.fusion]
    conflicts = set()
    for other, row in partners.items():
        (other_row,) = second.rows_of([other])
        theirs, track = second.objects[other_row], first.objects[row]
        track.buffer.merge([theirs.buffer])
        mine, edit = track.by_hand, renumbered(theirs, track.id).by_hand
        if mine is not None and edit is not None:
            conflicts.add(track.id)
        track.by_hand = mine or edit
        misses, spared = second.missed(other_row)
        first.misses[row] += misses
        first.change_existence(row, float(second.existence[other_row]), spared)
        if track.by_hand is None or track.by_hand.shape is None:
            first.shapes.replace(row, fuse(track.buffer, config))
        elif mine is None:
            first.shapes.replace(row, second.shapes.polygons[other_row])
        if len(track.buffer):
            first.shapes.heights[row] = track.buffer.heights()
        track.pending = 0
    return frozenset(conflicts)


def _until(
    first: TrackTable, second: TrackTable, partners: dict[int, int]
) -> tuple[list[float], list[float]]:
    """Return the stamp at which the other map first saw each track [s]; infinite if never."""
    until = [math.inf] * len(first.objects), [math.inf] * len(second.objects)
    for other, row in partners.items():
        (other_row,) = second.rows_of([other])
        until[0][row] = min(until[0][row], second.objects[other_row].buffer.first_seen)
        until[1][other_row] = first.objects[row].buffer.first_seen
    return until


def _views(tracks: TrackTable) -> list[Evidence]:
    """Return one piece of the kept evidence of each view, oldest first."""
    items = (item for track in tracks.objects for item in track.buffer.items)
    views = {(id(item.map_T_camera), id(item.prepared_area)): item for item in items}
    return sorted(views.values(), key=lambda item: item.stamp)


def _count_misses(
    tracks: TrackTable,
    until: Sequence[float],
    views: list[Evidence],
    is_free: IsFree,
    config: EvidenceConfig,
) -> None:
    """Lower the existence of tracks by views of another map that should have shown them.

    The views are those of the kept evidence, which lacks frames that showed nothing. So an object
    is no longer published if the later map knows its place to be free, however few views there are.

    Args:
        tracks: of one map; changed.
        until: stamp at which the other map first saw each track [s]; infinite if never.
        views: of the other map, oldest first.
        is_free: whether the other map knows that nothing stands in an area.
        config: the costs of misses.
    """
    if not views:
        return
    stamps = np.array([view.stamp for view in views])
    seen = as_objects(view.visible_area for view in views)
    areas = shapely.buffer(seen, -config.margin, join_style="mitre")
    cameras: ObjectArray = np.asarray(shapely.points([view.map_T_camera[:2, 3] for view in views]))
    for row, track in enumerate(tracks.objects):
        begin = int(np.searchsorted(stamps, track.buffer.last_seen, side="right"))
        end = int(np.searchsorted(stamps, until[row]))
        if track.by_hand is not None or begin >= end:
            continue
        shape = tracks.shapes.polygons[row].geometry
        near = areas[begin:end][shapely.dwithin(cameras[begin:end], shape, config.max_range)]
        shares = shapely.area(shapely.intersection(near, shape)) / shape.area
        bottom = float(tracks.shapes.heights[row][0])
        if until[row] == math.inf and is_free(shape, bottom):
            misses = int((shares >= _VISIBLE).sum())
            too_much = float(tracks.existence[row]) - min(config.publish_above, 0.0)
            loss = config.gone_loss * misses + (max(too_much, 0) if misses else 0)
        else:
            loss = config.loss * int((shares >= _WHOLE).sum())
        tracks.change_existence(row, -loss)


def _add_co_occurrences(
    tracks: TrackTable, second: TrackTable, ids: dict[int, int], pairs: frozenset[int]
) -> None:
    """Add the co-occurrences of tracks of the second map."""
    for theirs in second.objects:
        (row,) = tracks.rows_of([ids[theirs.id]])
        track = tracks.objects[row]
        counts: Counter[int] = Counter()
        for other, n in theirs.co_occurrences.items():
            counts[ids[other]] += n
        del counts[track.id]  # of parts of one
        track.co_occurrences = track.co_occurrences + counts if track.id in pairs else counts
