"""Samples of value layers move with the frames of their time when poses are corrected."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np

from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import Hypermap
from hypermap.core.layer import Layer
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.samples import Samples
from hypermap.core.value_layer import ValueLayer
from hypermap.mapping.floor_motions import FloorMotions

_log = logging.getLogger(__name__)


def with_moved_samples(
    hypermap: Hypermap, motions: Callable[[], FloorMotions], occupancy: Callable[[], OccupancyLayer]
) -> Hypermap:
    """Return a map whose value layers are estimated again if their samples have moved.

    Args:
        hypermap: the map.
        motions: returns those in its base frame; called only if there are samples.
        occupancy: returns its present walls; likewise.
    """
    motions, occupancy = cache(motions), cache(occupancy)  # the same for all layers
    layers: list[Layer] = []
    for layer in hypermap:
        if isinstance(layer, ValueLayer) and layer.samples is not None:
            layer = _moved(hypermap, layer, layer.samples, motions(), occupancy())
        layers.append(layer)
    return hypermap.with_layers(layers)


def _moved(
    hypermap: Hypermap,
    layer: ValueLayer,
    samples: Samples,
    motions: FloorMotions,
    occupancy: OccupancyLayer,
) -> ValueLayer:
    pose = hypermap.frames.lookup(hypermap.base_frame, layer.frame_id)
    in_base = replace(samples, points_xy=pose.apply(samples.points_xy))
    moved = motions.moved(in_base)
    if np.array_equal(moved.points_xy, in_base.points_xy):
        return layer
    own = replace(moved, points_xy=pose.inverse().apply(moved.points_xy))
    walls = occupancy if layer.frame_id == occupancy.frame_id else None
    # Imported here, because few maps have samples, and the solvers take a third of a second.
    from hypermap.values.on_map import made_again

    try:
        return made_again(layer, own, walls)
    except HypermapError as error:
        _log.warning("the samples of layer %r stay where they were: %s", layer.name, error)
        return layer
