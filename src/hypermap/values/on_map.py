"""Samples on a map: its value layers get more of them, and are made again."""

from __future__ import annotations

import logging
from dataclasses import replace
from typing import Any

import numpy as np

from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import Hypermap
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.samples import Samples
from hypermap.core.value_layer import ValueLayer
from hypermap.values.layers import unknown_layer_of, value_layer_of
from hypermap.values.methods import METHODS, Method
from hypermap.values.random_field import FieldSettings

_log = logging.getLogger(__name__)

_SAME = 1e-6  # [m, s]; what lies nearer is at the same place and time


def known_layer(hypermap: Hypermap, name: str) -> ValueLayer | None:
    """Return the value layer of a name; None if there is no layer of that name.

    Raises:
        HypermapError: If the layer of that name is of a different kind.
    """
    if name not in hypermap:
        return None
    layer = hypermap[name]
    if not isinstance(layer, ValueLayer):
        raise HypermapError(
            f"the map already has a layer {name!r}, which holds no measured values; give the "
            "quantity another name"
        )
    return layer


def samples_of(hypermap: Hypermap, layer: ValueLayer, frame_id: str) -> Samples:
    """Return the samples that a layer of a map keeps, in a frame of that map.

    Raises:
        HypermapError: If it keeps none.
        FrameError: If the frame is unknown.
    """
    samples = layer.samples
    if samples is None:
        raise HypermapError(f"layer {layer.name!r} contains no samples")
    if layer.frame_id != frame_id:
        pose = hypermap.frames.lookup(frame_id, layer.frame_id)
        samples = replace(samples, points_xy=pose.apply(samples.points_xy))
    return samples


def method_of(layer: ValueLayer) -> tuple[Method, float | None]:
    """Return the method that a layer was made by, "gmrf" for another one, and its half-life."""
    made_by: dict[str, Any] = layer.made_by
    method = made_by.get("method")
    return method if method in METHODS else "gmrf", made_by.get("half_life")


def new_among(samples: Samples, kept: Samples) -> Samples:
    """Return the samples whose stamps are not among those of others, or unknown."""
    return samples.chosen(~np.isin(samples.stamps, kept.stamps))


def unlike(samples: Samples, kept: Samples) -> Samples:
    """Return the samples that differ from others in time, place or value; all without a stamp.

    What other units, frames and stamps round (1 us, 1 um, 1e-9 of a value) is no difference.
    """
    order = np.argsort(kept.stamps)  # those without a stamp last
    stamps = kept.stamps[order]
    begins = np.searchsorted(stamps, samples.stamps - _SAME, "left")
    ends = np.searchsorted(stamps, samples.stamps + _SAME, "right")

    def is_known(i: int) -> bool:
        rows = order[begins[i] : ends[i]]
        apart = np.abs(kept.points_xy[rows] - samples.points_xy[i]).max(axis=1, initial=0)
        alike = np.isclose(kept.values[rows], samples.values[i], rtol=1e-9, atol=1e-9)
        return bool(((apart < _SAME) & alike).any())

    has_stamp = np.isfinite(samples.stamps).tolist()
    is_new = [not (stamped and is_known(i)) for i, stamped in enumerate(has_stamp)]
    return samples.chosen(np.array(is_new, dtype=bool))


def made_of(
    name: str,
    samples: Samples,
    unit: str,
    occupancy: OccupancyLayer | None,
    frame_id: str,
    known: ValueLayer | None = None,
) -> ValueLayer:
    """Return a layer of samples, made as an earlier one of that name was made.

    If no field can be made of them, which is logged, all its cells are unknown, and it keeps the
    samples for later.

    Args:
        name: of the layer.
        samples: in the frame of the map.
        unit: of them.
        occupancy: walls, and where the floor is.
        frame_id: of the samples.
        known: the earlier layer; None for none.

    Raises:
        HypermapError: If the samples are too far apart for any grid.
    """
    method, half_life = ("gmrf", None) if known is None else method_of(known)
    quantity = name if known is None else known.quantity
    try:
        return value_layer_of(
            name,
            samples,
            occupancy,
            frame_id=frame_id,
            quantity=quantity,
            unit=unit,
            method=method,
            half_life=half_life,
        )
    except HypermapError as error:
        _log.warning("layer %r keeps its samples, but has no values: %s", name, error)
        return unknown_layer_of(name, samples, frame_id, quantity=quantity, unit=unit)


def made_again(layer: ValueLayer, samples: Samples, occupancy: OccupancyLayer | None) -> ValueLayer:
    """Return a layer as it is with the same samples in other places, by the same settings.

    Args:
        layer: made by one of `METHODS`.
        samples: its samples, where they really were taken.
        occupancy: walls, and where the floor is.

    Raises:
        HypermapError: If it cannot be created from them.
    """
    method: Any = layer.made_by.get("method")
    if method not in METHODS or layer.grid is None:
        raise HypermapError(f"layer {layer.name!r} was not made of its samples by {METHODS}")
    half_life: Any = layer.made_by.get("half_life")
    return value_layer_of(
        layer.name,
        samples,
        occupancy,
        frame_id=layer.frame_id,
        quantity=layer.quantity,
        unit=layer.unit,
        method=method,
        settings=_settings_of(layer),
        resolution=layer.grid.resolution,
        half_life=half_life,
    )


def with_value_layer(hypermap: Hypermap, layer: ValueLayer) -> Hypermap:
    """Return the map with a layer, which replaces an older one of that name, or comes last."""
    if layer.name in hypermap:
        layer.settings.update(hypermap[layer.name].settings)
        return hypermap.with_layer(layer)
    return hypermap.with_layers([*hypermap, layer])


def _settings_of(layer: ValueLayer) -> FieldSettings | None:
    """Return the settings of the field that a layer was made by; None for a method without."""
    if "length" not in layer.made_by:
        return None
    try:
        return FieldSettings.of_numbers(layer.made_by)
    except (TypeError, ValueError):
        return None
