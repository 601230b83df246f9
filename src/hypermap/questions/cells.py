"""What layers without objects say: labels, values, and where a measured quantity is so."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import PointsLike, as_point_xy
from hypermap.core.hypermap import FoundObject, Hypermap
from hypermap.core.layer import Layer
from hypermap.core.value_layer import ValueLayer
from hypermap.questions.query import Measured
from hypermap.values import nearest_where, summaries_of, value_layer_called, where

MOST_LISTED = 1_000_000
"""Cells; of more, it is told how many there are of each label."""


@dataclass(frozen=True, eq=False)
class Cell:
    """What a layer without objects says at a place.

    Attributes:
        layer: name of the layer.
        label: in words.
        value: as a number; None where there is none.
        point_xy: in the base frame [m], shape (2,).
        distance: where distances are measured from [m]; None if they are not wanted.
        more: of measured values: `unit`, `deviation`, `stamp`, `area` [m^2], `outline` (WKT).
            Of notes: `note`. Where it stands for all of its label in an area: `cells`, how many.
    """

    layer: str
    label: str
    value: float | None
    point_xy: NDArray[np.float64]
    distance: float | None = None
    more: Mapping[str, Any] = field(default_factory=dict)


def cell_at(hypermap: Hypermap, layer: Layer, point_xy: PointsLike) -> Cell:
    """Return what a layer says at a point of the base frame."""
    point = as_point_xy(point_xy)
    more: dict[str, Any] = {}
    if isinstance(layer, ValueLayer):
        own = hypermap.frames.lookup(layer.frame_id, hypermap.base_frame).apply(point)
        more = {
            "unit": layer.unit,
            "deviation": known(layer.deviation_at(own)[0]),
            "stamp": known(layer.stamp_at(own)[0]),
        }
    label = hypermap.label_at(layer.name, point)[0]
    value = hypermap.value_at(layer.name, point)[0]
    return Cell(layer.name, str(label), known(value), point, None, more)


def cells_in(
    hypermap: Hypermap,
    layer: Layer,
    what: Sequence[str | float],
    area: BaseGeometry | None,
    start: NDArray[np.float64] | None,
    count: int = 1,
) -> Iterator[Cell]:
    """Yield the cells of some labels or values, or all of an area.

    Instead of more than `MOST_LISTED`, it is one for each label, or what `value_in` says of the
    measured values in an area. Where distances are wanted, it is those that are nearest.

    Args:
        hypermap: the map.
        layer: one of its layers.
        what: labels and values, any of which cells have; none for any.
        area: in the base frame; None for everywhere, where `what` is given.
        start: from where distances are measured [m]; None for none.
        count: how many are wanted then, and all that are as near as the last of these.
    """
    if what:
        places = np.concatenate([hypermap.find(layer.name, one, area) for one in what])
        places = places if start is None else places[_nearest(places, start, count)]
        labels = hypermap.label_at(layer.name, places)
    elif area is not None:
        hits = hypermap.labels_in(layer.name, area)
        labels, places = hits.values, hits.points_xy
    else:
        return
    if len(places) > MOST_LISTED and start is None:
        if isinstance(layer, ValueLayer) and not what:
            yield from value_in(hypermap, layer, area)
        else:
            yield from _counted(layer, labels, places)
        return
    if what or area is None:
        values = hypermap.value_at(layer.name, places)
    else:
        values = hypermap.values_in(layer.name, area).values
        if start is not None:
            rows = _nearest(places, start, count)
            labels, values, places = labels[rows], values[rows], places[rows]
    more = {"unit": layer.unit} if isinstance(layer, ValueLayer) else {}
    far = [None] * len(places) if start is None else np.hypot(*(places - start).T).tolist()
    for label, value, place, distance in zip(labels, values, places, far, strict=True):
        yield Cell(layer.name, str(label), known(value), place, distance, more)


def _nearest(
    places: NDArray[np.float64], start: NDArray[np.float64], count: int
) -> NDArray[np.intp]:
    """Return the rows of the nearest places, and of all as near as the last of them, in order."""
    if len(places) <= count:
        return np.arange(len(places))
    far = np.hypot(*(places - start).T)
    return np.flatnonzero(far <= np.partition(far, count - 1)[count - 1])


def _counted(layer: Layer, labels: NDArray[Any], places: NDArray[np.float64]) -> Iterator[Cell]:
    """Yield one cell of each label, which tells how many there are."""
    for label, first, count in zip(*np.unique(labels, True, return_counts=True), strict=True):
        yield Cell(layer.name, str(label), None, places[first], None, {"cells": int(count)})


def places_where(
    hypermap: Hypermap, measured: Measured, area: BaseGeometry | None
) -> Iterator[Cell]:
    """Yield each place at which a quantity is within limits, the largest first."""
    layer = value_layer_called(hypermap, measured.layer)
    layer_T_base = hypermap.frames.lookup(layer.frame_id, hypermap.base_frame)
    above, below = measured.above, measured.below
    limits = (("above", above), ("below", below))
    said = (f"{word} {limit:g}" for word, limit in limits if limit is not None)
    label = f"{', '.join(said)} {layer.unit}".rstrip()
    for place in where(hypermap, layer.name, above=above, below=below, area=area):
        mean = layer.summary_in(layer_T_base.apply_geometry(place)).mean
        at = place.centroid if place.covers(place.centroid) else place.representative_point()
        outline = shapely.to_wkt(place, rounding_precision=6)
        more = {"unit": layer.unit, "area": place.area, "outline": outline}
        yield Cell(layer.name, label, known(mean), np.array([at.x, at.y]), None, more)


def nearest_places(
    hypermap: Hypermap,
    measured: Measured,
    area: BaseGeometry | None,
    start: NDArray[np.float64],
    count: int,
) -> Iterator[Cell]:
    """Yield the nearest cells at which a quantity is within limits."""
    layer = value_layer_called(hypermap, measured.layer)
    above, below = measured.above, measured.below
    x, y = start.tolist()
    found = nearest_where(hypermap, layer.name, (x, y), count, above=above, below=below, area=area)
    for place in found:
        value = float(hypermap.value_at(layer.name, place.point_xy)[0])
        more = {"unit": layer.unit}
        yield Cell(
            layer.name, layer.text(value), known(value), place.point_xy, place.distance, more
        )


def value_in(hypermap: Hypermap, layer: ValueLayer, area: BaseGeometry | None) -> Iterator[Cell]:
    """Yield the mean and range of a layer in an area, or all over; nothing where nothing is known.

    Args:
        hypermap: the map.
        layer: one of its layers.
        area: in the base frame; None for everywhere.
    """
    layer_T_base = hypermap.frames.lookup(layer.frame_id, hypermap.base_frame)
    in_layer = layer.extent() if area is None else layer_T_base.apply_geometry(area)
    found = layer.summary_in(in_layer)
    if not found.count:
        return
    (x, y), *_ = layer_T_base.inverse().apply_geometry(in_layer.representative_point()).coords
    more = {"unit": layer.unit, "min": found.least, "max": found.most, "cells": found.count}
    yield Cell(layer.name, layer.text(found.mean), found.mean, np.array([x, y]), None, more)


def values_around(
    hypermap: Hypermap, measured: Measured, objects: Sequence[FoundObject]
) -> tuple[list[int], list[dict[str, Any]]]:
    """Return around which objects a quantity is within limits, and what it is there.

    Those with the lowest mean come first, and those around which nothing is known last; with
    limits, these are left out.

    Returns:
        The places of the objects in the sequence, and for each what was measured.
    """
    layer = value_layer_called(hypermap, measured.layer)
    pairs = []
    for row, found in enumerate(summaries_of(hypermap, layer.name, objects)):
        if measured.has_limits and not (
            found.count
            and (measured.above is None or found.mean > measured.above)
            and (measured.below is None or found.mean < measured.below)
        ):
            continue
        summary = {
            "layer": layer.name,
            "label": layer.text(found.mean),
            "unit": layer.unit,
            "mean": known(found.mean),
            "min": known(found.least),
            "max": known(found.most),
            "cells": found.count,
        }
        pairs.append((row, summary))
    pairs.sort(key=lambda pair: math.inf if pair[1]["mean"] is None else pair[1]["mean"])
    return [row for row, _ in pairs], [summary for _, summary in pairs]


def known(number: Any) -> float | None:
    """Return a layer's value as a number of Python; None for one that is not finite."""
    plain = number.item() if isinstance(number, np.generic) else number
    return None if isinstance(plain, float) and not math.isfinite(plain) else plain
