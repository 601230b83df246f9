"""Missed detections: tracks that a frame should have shown, but did not, lose existence."""

from __future__ import annotations

import math
from collections.abc import Sequence, Set

import numpy as np
import shapely

from hypermap.mapping.compared_tracks import sides
from hypermap.mapping.evidence_buffer import MAPPED, STALE, EvidenceBuffer
from hypermap.mapping.footprint_iou import footprint_ious
from hypermap.mapping.occlusion import visible_shares
from hypermap.mapping.prepared_polygon import PreparedPolygon, shared_area
from hypermap.mapping.stages import EvidenceConfig
from hypermap.mapping.track_shapes import Rows
from hypermap.mapping.tracks import Track, TrackTable
from hypermap.perception.depth_view import DepthView
from hypermap.perception.observation import Observation

_VISIBLE = 0.5  # share of an object that must be visible for a missed detection
_PART = 0.25  # share of it that must be visible to tell, if empty, that it has left since
_FILLED = 0.5  # share of its visible samples whose rays end there, if something is there
_AS_HIGH = 0.5  # share of its height in which another object must be to be there instead
_ABSENT = 0.9  # share of its observable samples that rays must pass for it to be absent
_SAME_PLACE = 0.5  # share of a track in another one, from which they are one object
_USUAL_RATE = 0.8  # share of the frames that should show an object in which it is found
_WELL_SEEN = 8  # observations from which the detector is known to find an object
_MOST_GONE = 50  # tracks that are gone but kept
_EVERYWHERE = (-math.inf, -math.inf, math.inf, math.inf)


def penalize_missed(
    tracks: TrackTable, observation: Observation, observed: Set[int], config: EvidenceConfig
) -> None:
    """Lower the existence of the tracks that a frame should have shown, as `config` says.

    Args:
        tracks: all tracks; changed.
        observation: the frame.
        observed: the ids of the tracks that the frame showed.
        config: the occlusion test, and the costs of misses.
    """
    shown = tracks.rows_of(observed)
    if config.sight == "rays" and observation.view is not None:
        _penalize_by_rays(tracks, observation.stamp, observation.view, shown, config)
    else:
        _penalize_by_area(tracks, observation, shown, config)
    if config.contested > 0:
        _penalize_conflicts(tracks, shown, config)


def prune(tracks: TrackTable, config: EvidenceConfig) -> list[Track]:
    """Remove the tracks with less existence than `forget_below`, and return them.

    Tracks edited by hand are kept, and so are the newest of those that are gone, whose objects may
    have been moved.
    """
    below = config.forget_below
    rows = (tracks.existence < below).nonzero()[0].tolist()
    if not rows:  # the usual case
        return []
    kept = {row for row in rows if tracks.objects[row].by_hand is not None}
    if config.moves and len(kept) < len(rows):
        kept |= _newest_gone(tracks, below)
    low = sorted(kept.intersection(rows))
    tracks.existence[low] = below
    rows = [row for row in rows if row not in kept]
    pruned = [tracks.objects[row] for row in rows]
    if rows:
        tracks.remove(rows)
    return pruned


def _newest_gone(tracks: TrackTable, below: float) -> set[int]:
    """Return the rows of the gone tracks that were seen last, whose objects may reappear."""
    gone = [
        row
        for row in np.flatnonzero(tracks.existence <= below).tolist()
        if tracks.objects[row].buffer.count >= MAPPED
    ]
    return set(sorted(gone, key=lambda row: -tracks.objects[row].buffer.last_seen)[:_MOST_GONE])


def _penalize_by_rays(
    tracks: TrackTable,
    stamp: float,
    view: DepthView,
    shown: Rows,
    config: EvidenceConfig,
) -> None:
    """Lower the existence of tracks by the rays of a frame: misses and see-throughs."""
    near = tracks.shapes.within(_EVERYWHERE, view.position[:2], config.max_range)
    again = {row: _found_again(tracks, row) for row in near if row not in shown}
    rows = [row for row, existence in again.items() if not existence > config.publish_above]
    chosen = np.array(rows, np.int64)
    samples = tracks.shapes.samples(chosen)
    known_from = np.array([_known_from(tracks, row, stamp, again[row]) for row in rows])
    heights = tracks.shapes.heights
    seen = visible_shares(view, samples, heights, config.tolerance, chosen, known_from)
    shares = zip(rows, *seen.lists(), strict=True)
    for row, visible, through, beyond in shares:
        buffer, spared = tracks.objects[row].buffer, 0.0
        if _is_unseen_since(buffer, stamp, again[row]):
            is_large = bool(samples.widths[row] > 2 * config.tolerance)
            loss = _loss_since_another_drive(
                tracks, row, (visible, beyond), is_large, shown, config
            )
        elif visible < _VISIBLE:
            continue
        elif through >= _ABSENT * visible:
            loss = config.gone_loss
        else:
            loss = _loss_of_miss(tracks, row, shown, config)
            spared = config.loss - loss
        tracks.change_existence(row, -loss, spared)


def _is_unseen_since(buffer: EvidenceBuffer, stamp: float, again: float) -> bool:
    """Return whether only another drive has seen an object; `again` as of `_found_again`."""
    return stamp - buffer.last_seen > STALE and again == -math.inf


def _known_from(tracks: TrackTable, row: int, stamp: float, again: float) -> float:
    """Return up to which distance another drive has detected an object in half of its views [m].

    0 for those that this drive has seen.
    """
    buffer = tracks.objects[row].buffer
    if not buffer.items or not _is_unseen_since(buffer, stamp, again):
        return 0.0
    return tracks.shapes.polygons[row].cached(_median_distance, buffer)


def _median_distance(shape: PreparedPolygon, buffer: EvidenceBuffer) -> float:
    """Return the median distance of the cameras that have seen a shape from its middle [m]."""
    cameras = np.array([item.map_T_camera[:2, 3] for item in buffer.items])
    x, y = shape.geometry.centroid.coords[0]
    return float(np.median(np.hypot(*(cameras - (x, y)).T)))


def _loss_since_another_drive(
    tracks: TrackTable,
    row: int,
    shares: tuple[float, float],
    is_large: bool,
    shown: Rows,
    config: EvidenceConfig,
) -> float:
    """Return the existence that it costs that a frame does not find a track of another drive.

    The more rays pass an object that was seen often, the less likely it still is there; an empty
    part tells it, too, where a frame cannot see the rest.

    Args:
        tracks: all tracks.
        row: of the track.
        shares: of its samples, that are visible, and whose rays end behind it, 0..1.
        is_large: whether the error of surfaces is small for it; else rays may end right behind it.
        shown: rows of the tracks that the frame shows.
        config: the costs.
    """
    visible, beyond = shares
    is_gone = beyond >= _ABSENT * visible
    is_well_known = tracks.objects[row].buffer.count >= _WELL_SEEN
    if visible < _VISIBLE:
        tells = is_gone and is_well_known and visible >= _PART
        return visible * config.stale_loss if tells else 0.0
    if is_gone:
        return config.stale_loss
    passed = beyond / visible if is_large else 0.0
    thickness, _ = tracks.shapes.polygons[row].cached(sides)
    # Rays at a curtain that was taken away end at the wall, which is as near as their error.
    is_filled = is_large and thickness > config.tolerance and 1 - passed >= _FILLED
    if not is_well_known or (is_filled and not _touches_another(tracks, row, shown)):
        return config.loss
    return config.stale_miss + passed * (config.stale_loss - config.stale_miss)


def _found_again(tracks: TrackTable, row: int) -> float:
    """Return the existence of this drive's track in the place of an earlier one's; -inf if none."""
    found = -math.inf
    if tracks.objects[row].id < tracks.first_id:
        shapes = tracks.shapes
        polygon, (xmin, ymin, xmax, ymax) = shapes.polygons[row], shapes.boxes[row].tolist()
        for other in shapes.near(int(shapes.classes[row]), (xmin, ymin, xmax, ymax)):
            if tracks.objects[other].id >= tracks.first_id:
                least = min(polygon.area, shapes.polygons[other].area)
                if shared_area(polygon, shapes.polygons[other]) >= _SAME_PLACE * least:
                    found = max(found, tracks.existence.item(other))
    return found


def _loss_of_miss(
    tracks: TrackTable, row: int, shown: Sequence[int], config: EvidenceConfig
) -> float:
    """Count a missed detection of a track, and return the existence that it costs.

    If an object is seldom found, a miss says little: the log of its probability, relative to that
    for an object which is found as often as is expected at first. But a piece of an object that the
    frame shows as a whole is no object of its own that was missed.

    Source: Mahler, Vo, Vo, "CPHD filtering with unknown clutter rate and detection profile", IEEE
    TSP 59 (2011); here, each track has a rate of its own, the mean of a beta distribution.
    """
    if config.detection_rate == "fixed" or _is_part_of_one(tracks, row, shown):
        return config.loss
    tracks.misses[row] += 1
    found = tracks.objects[row].buffer.count + _USUAL_RATE
    rate = found / (found + tracks.misses.item(row) + 1 - _USUAL_RATE)
    return config.loss * min(1.0, math.log1p(-rate) / math.log1p(-_USUAL_RATE))


def _touches_another(tracks: TrackTable, row: int, shown: Sequence[int]) -> bool:
    """Return whether the frame shows an object of another class that reaches into a track.

    Then this, and not the track's own object, may be what rays end at.
    """
    shapes = tracks.shapes
    low, high = shapes.heights[row].tolist()
    for other in shown:
        z_min, z_max = shapes.heights[other].tolist()
        is_another = shapes.classes[other] != shapes.classes[row]
        is_as_high = min(high, z_max) - max(low, z_min) >= _AS_HIGH * (high - low)
        touches = shared_area(shapes.polygons[row], shapes.polygons[other]) > 0
        if is_another and is_as_high and touches:
            return True
    return False


def _is_part_of_one(tracks: TrackTable, row: int, others: Sequence[int]) -> bool:
    """Return whether at least half of a track, or of another of its class, is in both."""
    shapes = tracks.shapes
    polygon, (xmin, ymin, xmax, ymax) = shapes.polygons[row], shapes.boxes[row].tolist()
    for other in others:
        if shapes.classes[other] == shapes.classes[row]:
            left, bottom, right, top = shapes.boxes[other].tolist()
            if left < xmax and right > xmin and bottom < ymax and top > ymin:
                least = min(polygon.area, shapes.polygons[other].area)
                if shared_area(polygon, shapes.polygons[other]) >= _SAME_PLACE * least:
                    return True
    return False


def _penalize_by_area(
    tracks: TrackTable, observation: Observation, shown: Rows, config: EvidenceConfig
) -> None:
    """Lower the existence of tracks within the visible area of a frame."""
    area = observation.visible_area
    if config.margin > 0:
        area = shapely.buffer(area, -config.margin, join_style="mitre")
    if area.is_empty:
        return
    camera = observation.map_T_camera[:2, 3]
    rows = tracks.shapes.within(area.bounds, camera, config.max_range)
    if config.loses == "unmatched":
        rows = [row for row in rows if row not in shown]
    shapely.prepare(area)
    is_covered = shapely.covers(area, tracks.shapes.geometries(rows))
    for i in np.flatnonzero(is_covered):
        tracks.change_existence(rows[i], -config.loss)


def _penalize_conflicts(tracks: TrackTable, shown: Rows, config: EvidenceConfig) -> None:
    """Lower the existence of tracks in whose place the frame shows another class (conflicts)."""
    shapes = tracks.shapes
    for row, other in shapes.others_near(shown):
        low, high = shapes.heights[row].tolist()
        (iou,) = footprint_ious(shapes.polygons[row], (low, high), shapes, [other])
        if iou >= config.min_contested:
            tracks.change_existence(other, -config.contested)
