"""How objects lose existence: a frame should have shown them, and did not."""

from __future__ import annotations

import math
from collections.abc import Set

import numpy as np
import shapely

from hypermap.mapping.known import KnownObjects
from hypermap.mapping.rivals import likeness
from hypermap.mapping.sight import samples_of, sights
from hypermap.mapping.stages import EvidenceConfig
from hypermap.perception.observation import Observation
from hypermap.perception.view import View

_VISIBLE = 0.5  # share of an object that a frame must be able to see for the object to lose
_GONE = 0.9  # share of what can be seen of it that rays must pass for an object to be gone
_EVERYWHERE = (-math.inf, -math.inf, math.inf, math.inf)


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
        known.remove(forgotten.tolist())


def _lose_in_view(known: KnownObjects, view: View, seen: Set[int], config: EvidenceConfig) -> None:
    """Take existence from the objects that the rays should have shown."""
    near = known.shapes.within(_EVERYWHERE, view.position[:2], config.max_range)
    rows = known.without(near, seen)
    samples = [known.shapes.outlines[row].once(samples_of) for row in rows]
    visible, through = sights(view, samples, known.shapes.heights[rows], config.tolerance)
    is_gone = through >= _GONE * visible
    for i in np.flatnonzero(visible >= _VISIBLE):
        known.change_existence(rows[i], -(config.gone_loss if is_gone[i] else config.loss))


def _lose_in_area(
    known: KnownObjects, observation: Observation, seen: Set[int], config: EvidenceConfig
) -> None:
    """Take existence from the objects that lie within the observed area."""
    area = observation.visible_area
    if config.margin > 0:
        area = shapely.buffer(area, -config.margin, join_style="mitre")
    if area.is_empty:
        return
    camera = observation.map_T_camera[:2, 3]
    rows = known.shapes.within(area.bounds, camera, config.max_range)
    if config.loses == "unmatched":
        rows = known.without(rows, seen)
    shapely.prepare(area)
    is_covered = shapely.covers(area, known.shapes.geometries(rows))
    for i in np.flatnonzero(is_covered):
        known.change_existence(rows[i], -config.loss)


def _lose_contested(known: KnownObjects, seen: Set[int], config: EvidenceConfig) -> None:
    """Take existence from the objects in whose place the frame shows another class."""
    shapes = known.shapes
    for row in known.rows_of(seen):
        shape, (low, high) = shapes.outlines[row], shapes.heights[row].tolist()
        near = known.without(shapes.near(None, shape.box), seen)
        near = [other for other in near if shapes.classes[other] != shapes.classes[row]]
        for other, alike in zip(near, likeness(shape, (low, high), shapes, near), strict=True):
            if alike >= config.min_contested:
                known.change_existence(other, -config.contested)
