"""Measured values as of a time: of the samples that had been taken by then."""

from __future__ import annotations

import numpy as np

from hypermap.core.errors import HypermapError
from hypermap.core.history import EARLIEST
from hypermap.core.hypermap import Hypermap
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.value_layer import ValueLayer
from hypermap.values.methods import METHODS


def why_undated(layer: ValueLayer) -> str | None:
    """Return why the values of a layer are known only as they are now; None if they are not."""
    samples = layer.samples
    if samples is None or layer.grid is None or layer.made_by.get("method") not in METHODS:
        return "it was not made of samples that it keeps"
    if np.isnan(samples.stamps).any():
        return "its samples have no stamps"
    if (samples.stamps < EARLIEST).any():
        return "the stamps of its samples do not count from 1970"
    return None


def values_at(hypermap: Hypermap, layer: ValueLayer, stamp: float) -> ValueLayer:
    """Return a layer of a map as it was at a time, made again by the settings and walls of today.

    Args:
        hypermap: the map, whose walls the values end at.
        layer: a layer of it. If `why_undated` has a reason, it is returned as it is.
        stamp: samples up to then count [s].

    Returns:
        The layer itself if it has no later samples; one without values if it had too few by then.
    """
    samples = layer.samples
    if why_undated(layer) is not None or samples is None:
        return layer
    is_known = samples.stamps <= stamp
    if is_known.all():
        return layer
    # Only here, as few maps have samples, and the solvers take a third of a second to import.
    from hypermap.values.on_map import made_again

    try:
        past = made_again(layer, samples.chosen(is_known), _walls(hypermap, layer))
    except HypermapError:  # too few of them by then
        past = _unknown(layer)
    past.settings.update(layer.settings)
    return past


def _walls(hypermap: Hypermap, layer: ValueLayer) -> OccupancyLayer | None:
    name = layer.made_by.get("occupancy")
    walls = hypermap[name] if isinstance(name, str) and name in hypermap else None
    if isinstance(walls, OccupancyLayer) and walls.frame_id == layer.frame_id:
        return walls
    return None


def _unknown(layer: ValueLayer) -> ValueLayer:
    assert layer.grid is not None
    unknown = np.full(layer.grid.shape, np.nan)
    return ValueLayer(
        layer.name,
        layer.frame_id,
        layer.grid,
        unknown,
        layer.unit,
        layer.decimals,
        quantity=layer.quantity,
        deviations=None if layer.deviations is None else unknown,
    )
