"""Transforms tracks, with all of their evidence, to another frame."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray

from hypermap.core.arrays import as_objects
from hypermap.core.frames import Pose2D
from hypermap.mapping.by_hand import HandEdit
from hypermap.mapping.evidence_buffer import Evidence, EvidenceBuffer
from hypermap.mapping.moved_frames import turned
from hypermap.mapping.prepared_polygon import PreparedPolygon
from hypermap.mapping.stages import EvidenceConfig
from hypermap.mapping.tracks import Track, TrackTable


def moved_tracks(
    tracks: TrackTable, a_T_b: Pose2D, config: EvidenceConfig, later: float = 0.0
) -> TrackTable:
    """Return tracks in frame b transformed to frame a; their ids stay.

    Args:
        tracks: in frame b.
        a_T_b: transforms points from b to a.
        config: of the tracks.
        later: by how much all of their times are later in the other map [s].
    """
    items = [item for track in tracks.objects for item in track.buffer.items]
    items = _moved_evidence(items, a_T_b, later)
    shapes = PreparedPolygon.all_of(
        [a_T_b.apply_geometry(polygon.geometry) for polygon in tracks.shapes.polygons]
    )
    table = TrackTable(config.max_existence)
    begin = 0
    for row, track in enumerate(tracks.objects):
        old, end = track.buffer, begin + len(track.buffer)
        times = old.score_sum, old.first_seen + later, old.last_seen + later
        buffer = EvidenceBuffer.of(items[begin:end], config.max_evidence, old.count, *times)
        buffer.colors = tuple(color._replace(stamp=color.stamp + later) for color in old.colors)
        buffer.pictures = tuple(
            dataclasses.replace(each, azimuth=each.azimuth + a_T_b.yaw) for each in old.pictures
        )
        buffer.embedding = old.embedding
        by_hand = None if track.by_hand is None else _moved_edit(track.by_hand, a_T_b)
        low, high = tracks.shapes.heights[row].tolist()
        table.add(
            dataclasses.replace(
                track,
                buffer=buffer,
                by_hand=by_hand,
                moved_since=None if track.moved_since is None else track.moved_since + later,
                gone_since=None if track.gone_since is None else track.gone_since + later,
            ),
            int(tracks.shapes.classes[row]),
            shapes[row],
            (low, high),
            float(tracks.existence[row]),
            tracks.missed(row),
        )
        begin = end
    table.next_id, table.first_id = tracks.next_id, tracks.first_id
    return table


def _moved_evidence(items: Sequence[Evidence], a_T_b: Pose2D, later: float) -> list[Evidence]:
    """Return evidence in another frame; pieces of one view keep sharing its pose and area."""
    matrix = np.eye(4)
    matrix[np.ix_([0, 1, 3], [0, 1, 3])] = a_T_b.matrix()
    footprints = a_T_b.apply_geometries(as_objects(item.footprint for item in items))
    centroids = shapely.get_coordinates(shapely.centroid(footprints))
    poses: dict[int, NDArray[np.float64]] = {}
    areas: dict[int, PreparedPolygon] = {}
    prepared = PreparedPolygon.all_of(list(footprints))
    found = []
    for item, footprint, centroid_xy in zip(items, prepared, centroids, strict=True):
        pose, area = item.map_T_camera, item.prepared_area
        if id(pose) not in poses:
            poses[id(pose)] = matrix @ pose
        if id(area) not in areas:
            areas[id(area)] = PreparedPolygon.of(a_T_b.apply_geometry(area.geometry))
        found.append(
            dataclasses.replace(
                item,
                map_T_camera=poses[id(pose)],
                prepared_area=areas[id(area)],
                prepared=footprint,
                centroid_xy=centroid_xy,
                correction=turned(item.correction, a_T_b.yaw),
                stamp=item.stamp + later,
            )
        )
    return found


def _moved_edit(edit: HandEdit, a_T_b: Pose2D) -> HandEdit:
    shape, drawn = edit.footprint, edit.drawn
    return dataclasses.replace(
        edit,
        footprint=None if shape is None else a_T_b.apply_geometry(shape),
        drawn=None
        if drawn is None
        else dataclasses.replace(drawn, footprint=a_T_b.apply_geometry(drawn.footprint)),
    )


def renumbered(track: Track, number: int) -> Track:
    """Return a track with another id, and so its object if it was drawn by hand."""
    edit = track.by_hand
    if edit is not None and edit.drawn is not None:
        edit = dataclasses.replace(edit, drawn=dataclasses.replace(edit.drawn, id=number))
    return dataclasses.replace(track, id=number, by_hand=edit)
