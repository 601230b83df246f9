"""Questions to the value layers of a map, in any of its frames."""

from __future__ import annotations

from collections.abc import Sequence

import shapely
from shapely.geometry.base import BaseGeometry

from hypermap.core.errors import HypermapError
from hypermap.core.found import Found, FoundObject
from hypermap.core.hypermap import ROOMS, Hypermap
from hypermap.core.value_layer import ValueLayer, ValueSummary

AROUND = 0.5
"""Radius around an object for its mean value [m], as there is no free floor below furniture."""


def value_layer_called(hypermap: Hypermap, name: str | None = None) -> ValueLayer:
    """Return a value layer of a map; without a name, the only one.

    Raises:
        LayerNotFound: If there is no layer of that name.
        HypermapError: If it is of a different kind; without a name, if there is not exactly one.
    """
    if name is not None:
        layer = hypermap[name]
        if not isinstance(layer, ValueLayer):
            raise HypermapError(
                f"layer {name!r} is of class {layer.class_name}, which holds no measured values"
            )
        return layer
    layers = [layer for layer in hypermap if isinstance(layer, ValueLayer)]
    if len(layers) == 1:
        return layers[0]
    if not layers:
        raise HypermapError(
            "the map has no layer of measured values; `hypermap values` makes one, of a table "
            "(.csv) or a bag"
        )
    names = ", ".join(layer.name for layer in layers)
    raise HypermapError(f"the map has several layers of measured values: {names}; name one")


def summary_in(
    hypermap: Hypermap,
    layer: str | None,
    area: BaseGeometry,
    *,
    above: float | None = None,
    below: float | None = None,
    frame_id: str | None = None,
) -> ValueSummary:
    """Return mean, range and share of a quantity in an area; see `ValueLayer.summary_in`.

    Args:
        hypermap: the map.
        layer: name of the value layer; None for the only one.
        area: in the frame `frame_id` [m].
        above: `share` counts values above this.
        below: `share` counts values below this.
        frame_id: frame of the area; None for the base frame.

    Raises:
        HypermapError: As `value_layer_called` raises it.
        FrameError: If the frame is unknown.
    """
    values = value_layer_called(hypermap, layer)
    return values.summary_in(_to_layer(hypermap, values, area, frame_id), above=above, below=below)


def summaries_of(
    hypermap: Hypermap, layer: str | None, objects: Sequence[FoundObject], around: float = AROUND
) -> list[ValueSummary]:
    """Return what a quantity is in each room, and around each other object.

    Args:
        hypermap: the map.
        layer: name of the value layer; None for the only one.
        objects: as `Hypermap.objects` returns them.
        around: how far around an object that is not a room [m].

    Raises:
        HypermapError: As `value_layer_called` raises it.
    """
    values = value_layer_called(hypermap, layer)
    found = []
    for item in objects:
        area = item.object.footprint
        if item.layer != ROOMS:
            area = area.buffer(around)
        found.append(values.summary_in(_to_layer(hypermap, values, area, None)))
    return found


def where(
    hypermap: Hypermap,
    layer: str | None = None,
    *,
    above: float | None = None,
    below: float | None = None,
    area: BaseGeometry | None = None,
    frame_id: str | None = None,
) -> list[shapely.Polygon]:
    """Return where a quantity is above, below or between two values, the largest place first.

    Args:
        hypermap: the map.
        layer: name of the value layer; None for the only one.
        above: the values are larger.
        below: the values are smaller.
        area: only there, in the frame `frame_id` [m].
        frame_id: frame of the area; None for the base frame.

    Returns:
        Polygons in the base frame.

    Raises:
        HypermapError: As `value_layer_called` raises it.
        ValueError: If neither limit is given.
    """
    values = value_layer_called(hypermap, layer)
    asked = None if area is None else _to_layer(hypermap, values, area, frame_id)
    places = values.where(above=above, below=below, area=asked)
    in_base = hypermap.frames.lookup(hypermap.base_frame, values.frame_id).apply_geometry(places)
    parts: list[shapely.Polygon] = [
        part for part in shapely.get_parts(in_base) if not part.is_empty
    ]
    return sorted(parts, key=lambda part: -part.area)


def nearest_where(
    hypermap: Hypermap,
    layer: str | None,
    point_xy: tuple[float, float],
    k: int = 1,
    *,
    above: float | None = None,
    below: float | None = None,
    area: BaseGeometry | None = None,
    frame_id: str | None = None,
) -> list[Found]:
    """Return the nearest places at which a quantity is above, below or between two values.

    Args:
        hypermap: the map.
        layer: name of the value layer; None for the only one.
        point_xy: from where, in the frame `frame_id` [m].
        k: how many at most.
        above: the values are larger.
        below: the values are smaller.
        area: only there, in the frame `frame_id` [m].
        frame_id: frame of point and area; None for the base frame.

    Raises:
        HypermapError: As `value_layer_called` raises it.
        ValueError: If neither limit is given, or `k` is below 1.
    """
    values = value_layer_called(hypermap, layer)
    asked = None if area is None else _to_layer(hypermap, values, area, frame_id)
    start = hypermap.frames.lookup(values.frame_id, frame_id or hypermap.base_frame).apply(point_xy)
    places, distances = values.nearest_where(start, k, above=above, below=below, area=asked)
    in_base = hypermap.frames.lookup(hypermap.base_frame, values.frame_id).apply(places)
    pairs = zip(in_base, distances.tolist(), strict=True)
    return [Found(values.name, place, distance) for place, distance in pairs]


def _to_layer(
    hypermap: Hypermap, layer: ValueLayer, area: BaseGeometry, frame_id: str | None
) -> BaseGeometry:
    asked = frame_id or hypermap.base_frame
    return hypermap.frames.lookup(layer.frame_id, asked).apply_geometry(area)
