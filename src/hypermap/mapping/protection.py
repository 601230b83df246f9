"""Turns edits made by hand into tracks, so that mapping does not undo them."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import shapely
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import as_objects
from hypermap.core.objects import SemanticObject
from hypermap.core.shapes import valid_copies
from hypermap.mapping.by_hand import HandEdit
from hypermap.mapping.evidence_buffer import EvidenceBuffer
from hypermap.mapping.prepared_polygon import PreparedPolygon
from hypermap.mapping.stages import EvidenceConfig
from hypermap.mapping.tracks import Track, TrackTable


def protected(
    tracks: TrackTable, edits: Mapping[int, HandEdit], config: EvidenceConfig
) -> TrackTable:
    """Return the tracks with the edits made by hand, in the order of their ids.

    An object drawn by hand gets a track, so its evidence does not create a second object. Its id
    may belong to another track: an unpublished one is replaced; one deleted by hand gets a new id,
    unless the drawn object is the same object again.

    Args:
        tracks: of mapping.
        edits: by the objects' ids.
        config: of the tracks.
    """
    if not edits and all(track.by_hand is None for track in tracks.objects):
        return tracks
    rows = {track.id: row for row, track in enumerate(tracks.objects)}
    table = TrackTable(config.max_existence)
    displaced: list[int] = []  # rows of deleted objects
    for number in sorted(rows.keys() | edits.keys()):
        edit, row = edits.get(number), rows.get(number)
        shape = None if edit is None or edit.shape is None else _prepared(edit.shape)
        was_drawn = row is not None and _is_drawn(tracks, row)
        is_drawn = edit is not None and edit.drawn is not None
        if row is not None and is_drawn == was_drawn:
            track = tracks.objects[row]
            track.by_hand = edit
            low, high = tracks.shapes.heights[row].tolist()
            existence = float(tracks.existence[row])
            missed, kept = tracks.missed(row), shape or tracks.shapes.polygons[row]
            table.add(track, 0, kept, (low, high), existence, missed)
        elif edit is not None and edit.drawn is not None and shape is not None:
            buffer = EvidenceBuffer(config.max_evidence)
            track = Track(number, edit.drawn.name, buffer, by_hand=edit)
            table.add(track, 0, shape, (0.0, 0.0), config.max_existence)
            if row is not None and _is_another(tracks, row, edit.drawn):
                displaced.append(row)
    table.next_id = max(table.next_id, tracks.next_id)
    table.first_id = tracks.first_id
    for row in displaced:
        track = dataclasses.replace(tracks.objects[row], id=table.next_id)
        table.add(track, 0, tracks.shapes.polygons[row], (0.0, 0.0), config.max_existence)
    return table


def _prepared(outline: BaseGeometry) -> PreparedPolygon:
    """Return what mapping computes with of an outline that people have drawn.

    It may cross itself. One without area stays as it is.
    """
    (valid,) = valid_copies(as_objects([outline]))
    if valid is outline:
        return PreparedPolygon.of(outline)
    parts = shapely.get_parts(shapely.get_parts(valid))  # lines, too, where it runs to and fro
    areas = parts[shapely.get_type_id(parts) == shapely.GeometryType.POLYGON]
    return PreparedPolygon.of(shapely.multipolygons(areas) if len(areas) else outline)


def _is_another(tracks: TrackTable, row: int, drawn: SemanticObject) -> bool:
    """Return whether a track was deleted by hand, and another object drawn."""
    track, shape = tracks.objects[row], tracks.shapes.polygons[row].geometry
    is_there = bool(shapely.intersects(shape, drawn.footprint))
    return track.is_deleted and not (track.name == drawn.name and is_there)


def _is_drawn(tracks: TrackTable, row: int) -> bool:
    edit = tracks.objects[row].by_hand
    return edit is not None and edit.drawn is not None
