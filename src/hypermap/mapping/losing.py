"""How objects lose existence: a frame should have shown them, and did not."""

from __future__ import annotations

from collections.abc import Set

import numpy as np
import shapely

from hypermap.mapping.known import KnownObjects
from hypermap.mapping.rivals import likeness
from hypermap.mapping.sight import sights
from hypermap.mapping.stages import EvidenceConfig
from hypermap.perception.observation import Observation
from hypermap.perception.view import View

_VISIBLE = 0.5  # share of an object that a frame must be able to see for the object to lose
_GONE = 0.9  # share of what can be seen of it that rays must pass for an object to be gone


def lose(
    known: KnownObjects, observation: Observation, seen: Set[int], config: EvidenceConfig
) -> None:
    """Take existence from the objects that a frame should have shown, as `config` says.

    Args:
        known: all objects; changed.
        observation: the frame.
        seen: the ids of the objects that the frame showed.
        config: how it is known what should have been seen, and what that costs.
    """
    if config.sight == "rays" and observation.view is not None:
        _lose_in_view(known, observation.view, seen, config)
    else:
        _lose_in_area(known, observation, seen, config)
    if config.contested > 0:
        _lose_contested(known, seen, config)


def forget(known: KnownObjects, below: float) -> None:
    """Remove the objects with less existence than some."""
    forgotten = np.flatnonzero(known.existence < below)
    if len(forgotten):
        known.remove(forgotten)


def _lose_in_view(known: KnownObjects, view: View, seen: Set[int], config: EvidenceConfig) -> None:
    """Take existence from the objects that the rays should have shown."""
    boxes = known.shapes.boxes
    offsets = (boxes[:, :2] + boxes[:, 2:]) / 2 - view.position[:2]
    rows = known.without(np.flatnonzero(np.hypot(*offsets.T) <= config.max_range), seen)
    shapes = shapely.convex_hull(known.shapes.shapes[rows])
    visible, through = sights(view, shapes, known.shapes.heights[rows], config.tolerance)
    losses = np.where(through >= _GONE * visible, config.gone_loss, config.loss)
    is_visible = visible >= _VISIBLE
    rows, losses = rows[is_visible], losses[is_visible]
    known.set_existence(rows, known.existence[rows] - losses)


def _lose_in_area(
    known: KnownObjects, observation: Observation, seen: Set[int], config: EvidenceConfig
) -> None:
    """Take existence from the objects that lie within the observed area."""
    area = observation.visible_area
    if config.margin > 0:
        area = shapely.buffer(area, -config.margin, join_style="mitre")
    if area.is_empty:
        return
    boxes, limits = known.shapes.boxes, shapely.bounds(area)
    centers = (boxes[:, :2] + boxes[:, 2:]) / 2
    distances = np.hypot(*(centers - observation.map_T_camera[:2, 3]).T)
    rows = np.flatnonzero(
        (boxes[:, :2] >= limits[:2]).all(axis=1)
        & (boxes[:, 2:] <= limits[2:]).all(axis=1)
        & (distances <= config.max_range)
    )
    shapely.prepare(area)
    losing = rows[shapely.covers(area, known.shapes.shapes[rows])]
    if config.loses == "unmatched":
        losing = known.without(losing, seen)
    known.set_existence(losing, known.existence[losing] - config.loss)


def _lose_contested(known: KnownObjects, seen: Set[int], config: EvidenceConfig) -> None:
    """Take existence from the objects in whose place the frame shows another class."""
    shapes = known.shapes
    for row in known.rows_of(seen):
        near = known.without(shapes.near(None, shapes.boxes[row]), seen)
        near = near[shapes.classes[near] != shapes.classes[row]]
        heights = shapes.heights[row]
        alike = likeness(shapes.shapes[row], (heights[0], heights[1]), shapes, near)
        losing = near[alike >= config.min_contested]
        known.set_existence(losing, known.existence[losing] - config.contested)
