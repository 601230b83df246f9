"""Missed detections: tracks that a frame should have shown, and did not, lose existence."""

from __future__ import annotations

import math
from collections.abc import Set

import numpy as np
import shapely

from hypermap.mapping.footprint_iou import footprint_ious
from hypermap.mapping.occlusion import sample_points, visible_shares
from hypermap.mapping.stages import EvidenceConfig
from hypermap.mapping.tracks import Track, TrackTable
from hypermap.perception.depth_view import DepthView
from hypermap.perception.observation import Observation

_VISIBLE = 0.5  # share of an object that a frame must be able to see for it to count as missed
_ABSENT = 0.9  # share of what can be observed of it that rays must pass for it to be absent
_EVERYWHERE = (-math.inf, -math.inf, math.inf, math.inf)


def penalize_missed(
    tracks: TrackTable, observation: Observation, observed: Set[int], config: EvidenceConfig
) -> None:
    """Lower the existence of the tracks that a frame should have shown, as `config` says.

    Args:
        tracks: all tracks; changed.
        observation: the frame.
        observed: the ids of the tracks that the frame showed.
        config: how to tell what the frame should have shown, and what a miss costs.
    """
    if config.sight == "rays" and observation.view is not None:
        _penalize_by_rays(tracks, observation.view, observed, config)
    else:
        _penalize_by_area(tracks, observation, observed, config)
    if config.contested > 0:
        _penalize_conflicts(tracks, observed, config)


def prune(tracks: TrackTable, below: float) -> list[Track]:
    """Remove the tracks with less existence than a limit, and return them.

    Those that people have edited stay, at the limit.
    """
    rows = np.flatnonzero(tracks.existence < below).tolist()
    tracks.existence[[row for row in rows if tracks.objects[row].by_hand is not None]] = below
    rows = [row for row in rows if tracks.objects[row].by_hand is None]
    pruned = [tracks.objects[row] for row in rows]
    if rows:
        tracks.remove(rows)
    return pruned


def _penalize_by_rays(
    tracks: TrackTable, view: DepthView, observed: Set[int], config: EvidenceConfig
) -> None:
    """Lower the existence of the tracks that the rays should have shown."""
    near = tracks.shapes.within(_EVERYWHERE, view.position[:2], config.max_range)
    rows = tracks.excluding(near, observed)
    samples = [tracks.shapes.polygons[row].cached(sample_points) for row in rows]
    visible, through = visible_shares(view, samples, tracks.shapes.heights[rows], config.tolerance)
    is_absent = through >= _ABSENT * visible
    for i in np.flatnonzero(visible >= _VISIBLE):
        tracks.change_existence(rows[i], -(config.gone_loss if is_absent[i] else config.loss))


def _penalize_by_area(
    tracks: TrackTable, observation: Observation, observed: Set[int], config: EvidenceConfig
) -> None:
    """Lower the existence of the tracks that lie within the observed area."""
    area = observation.visible_area
    if config.margin > 0:
        area = shapely.buffer(area, -config.margin, join_style="mitre")
    if area.is_empty:
        return
    camera = observation.map_T_camera[:2, 3]
    rows = tracks.shapes.within(area.bounds, camera, config.max_range)
    if config.loses == "unmatched":
        rows = tracks.excluding(rows, observed)
    shapely.prepare(area)
    is_covered = shapely.covers(area, tracks.shapes.geometries(rows))
    for i in np.flatnonzero(is_covered):
        tracks.change_existence(rows[i], -config.loss)


def _penalize_conflicts(tracks: TrackTable, observed: Set[int], config: EvidenceConfig) -> None:
    """Lower the existence of the tracks in whose place the frame shows another class."""
    shapes = tracks.shapes
    for row in tracks.rows_of(observed):
        shape, (low, high) = shapes.polygons[row], shapes.heights[row].tolist()
        near = tracks.excluding(shapes.near(None, shape.box), observed)
        near = [other for other in near if shapes.classes[other] != shapes.classes[row]]
        for other, ious in zip(near, footprint_ious(shape, (low, high), shapes, near), strict=True):
            if ious >= config.min_contested:
                tracks.change_existence(other, -config.contested)
