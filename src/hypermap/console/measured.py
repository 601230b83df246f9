"""The part of an answer that measured values give: places, and objects with what is around them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.hypermap import FoundObject, Hypermap
from hypermap.core.value_layer import ValueLayer
from hypermap.values import nearest_where, summaries_of, value_layer_called, where

Limits = tuple[float | None, float | None]
"""Above which and below which a value is; None for any."""


def value_row(layer: ValueLayer, point_xy: NDArray[np.float64]) -> dict[str, Any]:
    """Return what a row says of a value at a point of the layer's frame besides the value."""
    return {
        "unit": layer.unit,
        "deviation": _known(layer.deviation_at(point_xy)[0]),
        "stamp": _known(layer.stamp_at(point_xy)[0]),
    }


def rows_where(
    hypermap: Hypermap,
    name: str | None,
    limits: Limits,
    area: BaseGeometry | None,
    frame_id: str | None,
) -> list[dict[str, Any]]:
    """Return a row for each place at which a quantity is within limits, the largest first."""
    layer = value_layer_called(hypermap, name)
    above, below = limits
    pose = hypermap.frames.lookup(layer.frame_id, hypermap.base_frame)
    rows = []
    for place in where(
        hypermap, layer.name, above=above, below=below, area=area, frame_id=frame_id
    ):
        found = layer.summary_in(pose.apply_geometry(place))
        at = place.centroid if place.covers(place.centroid) else place.representative_point()
        row = _row(layer, _label(layer, limits), found.mean, at.x, at.y)
        rows.append(
            row | {"area": place.area, "outline": shapely.to_wkt(place, rounding_precision=6)}
        )
    return rows


def rows_nearest(
    hypermap: Hypermap,
    name: str | None,
    limits: Limits,
    start: tuple[float, float],
    most: int,
    area: BaseGeometry | None,
    frame_id: str | None,
) -> list[dict[str, Any]]:
    """Return a row for each of the nearest cells at which a quantity is within limits."""
    layer = value_layer_called(hypermap, name)
    above, below = limits
    found = nearest_where(
        hypermap, layer.name, start, most, above=above, below=below, area=area, frame_id=frame_id
    )
    rows = []
    for place in found:
        value = float(hypermap.value_at(layer.name, place.point_xy)[0])
        row = _row(layer, layer.text(value), value, *place.point_xy.tolist())
        rows.append(row | {"distance": place.distance})
    return rows


def with_values(
    hypermap: Hypermap, name: str, limits: Limits, objects: Sequence[FoundObject]
) -> list[tuple[FoundObject, dict[str, Any]]]:
    """Return the objects around which a quantity is within limits, and what it is there.

    Those with the lowest mean come first, and those around which nothing is known last; with
    limits, these are left out.
    """
    layer = value_layer_called(hypermap, name)
    above, below = limits
    pairs = []
    for item, found in zip(objects, summaries_of(hypermap, layer.name, objects), strict=True):
        if limits != (None, None) and not (
            found.count
            and (above is None or found.mean > above)
            and (below is None or found.mean < below)
        ):
            continue
        measured = {
            "layer": layer.name,
            "label": layer.text(found.mean),
            "unit": layer.unit,
            "mean": _known(found.mean),
            "min": _known(found.least),
            "max": _known(found.most),
            "cells": found.count,
        }
        pairs.append((item, measured))
    return sorted(pairs, key=lambda pair: math.inf if pair[1]["mean"] is None else pair[1]["mean"])


def _label(layer: ValueLayer, limits: Limits) -> str:
    said = zip(("above", "below"), limits, strict=True)
    parts = [f"{word} {limit:g}" for word, limit in said if limit is not None]
    return f"{', '.join(parts)} {layer.unit}".rstrip()


def _row(layer: ValueLayer, label: str, value: float, x: float, y: float) -> dict[str, Any]:
    named = {"layer": layer.name, "label": label, "value": _known(value)}
    return named | {"x": x, "y": y, "unit": layer.unit}


def _known(number: float) -> float | None:
    return float(number) if math.isfinite(number) else None
