"""ROS messages become what questions and changes of a map need.

Rings may be closed or open and wind either way; the height of a point does not count.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from hypermap.core.errors import FormatError
from hypermap.core.frames import Pose2D
from hypermap.core.objects import SemanticObject
from hypermap.core.occupancy import OCCUPIED, UNKNOWN, OccupancyLayer
from hypermap.core.semantic import SemanticLayer
from hypermap.core.shapes import repaired
from hypermap.core.tangles import check_tangle
from hypermap.recordings.messages.header import clean_frame
from hypermap.ros.messages.geometry_messages import outline
from hypermap.text import counted

_CROSSING = 1e-3  # of the area; rounding to float32 makes less


def point_of(message: Any) -> tuple[NDArray[np.float64], str | None]:
    """Return where a `geometry_msgs/PointStamped` lies, shape (1, 2), and in which frame.

    The frame is None, the base frame, where the message names none.

    Raises:
        FormatError: If a coordinate is not finite.
    """
    xy = np.array([[message.point.x, message.point.y]], dtype=np.float64)
    if not np.isfinite(xy).all():
        raise FormatError(f"the point must be finite, got ({xy[0, 0]}, {xy[0, 1]})")
    return xy, _frame(message)


def pose_of(message: Any) -> tuple[Pose2D, str | None]:
    """Return a `geometry_msgs/PoseStamped` as seen from above, and its frame like `point_of`.

    Raises:
        FormatError: If a number is not finite.
    """
    at, q = message.pose.position, message.pose.orientation
    # An orientation of zeros, as some programs leave it, turns nothing: atan2(0, 0) is 0.
    yaw = math.atan2(2 * (q.w * q.z + q.x * q.y), q.w**2 + q.x**2 - q.y**2 - q.z**2)
    try:
        return Pose2D(float(at.x), float(at.y), yaw), _frame(message)
    except ValueError:
        raise FormatError(f"the pose must be finite, got ({at.x}, {at.y}), yaw {yaw}") from None


def is_empty_area(message: Any) -> bool:
    """Return whether a `geometry_msgs/PolygonStamped` has no points."""
    return len(message.polygon.points) == 0


def area_of(message: Any) -> tuple[shapely.Polygon, str | None]:
    """Return the area of a `geometry_msgs/PolygonStamped`, and its frame like `point_of`.

    Raises:
        FormatError: If it has fewer than three points or very many, a coordinate is not finite, or
            the outline crosses itself.
    """
    try:
        area = _polygon(message.polygon)
    except ValueError as error:
        raise FormatError(f"the area is not a polygon: {error}") from None
    if crosses_itself(area):
        raise FormatError(
            "the area is not a polygon: its outline crosses itself; everything inside it counts"
        )
    return area, _frame(message)


def semantic_objects_of(message: Any) -> tuple[list[SemanticObject], list[str]]:
    """Return the objects of a `hypermap_msgs/SemanticMap`, and what is wrong with others.

    Ids are those of the message if they are all different, otherwise the positions in it: old
    programs leave them 0. An object whose outline crosses itself is kept as it is, and reported.
    """
    ids = [int(item.id) for item in message.objects]
    if len(set(ids)) < len(ids) or any(number < 0 for number in ids):
        ids = list(range(len(ids)))
    return _objects(message.objects, ids, "object")


def apply_semantic_update(layer: SemanticLayer, message: Any) -> list[str]:
    """Change a layer as a `hypermap_msgs/SemanticMapUpdate` says.

    Objects to add get new ids. A changed object keeps what the message cannot carry, as its
    existence; also its exact shape, if the message brings back the outline that was sent.

    Returns:
        What is wrong with single objects; those are left out, all others applied.

    Raises:
        FormatError: If the message contradicts itself or names an id that the layer has not;
            nothing is applied then.
    """
    to_modify = [int(number) for number in message.to_modify]
    to_delete = [int(number) for number in message.to_delete]
    _check_update(layer, to_modify, len(message.updates), to_delete)
    added, problems = _objects(message.to_add, [None] * len(message.to_add), "to_add")
    changes: dict[int, SemanticObject] = {}
    for number, update in zip(to_modify, message.updates, strict=True):
        changed, wrong = _objects([update], [number], "object")
        problems += wrong
        changes.update((number, _changed(layer.get(number), item)) for item in changed)
    layer.update_many(changes)
    layer.remove(to_delete)
    layer.add(added)
    return problems


def with_grid_update(layer: OccupancyLayer, message: Any) -> OccupancyLayer:
    """Return a layer with the window of a `map_msgs/OccupancyGridUpdate` in it.

    Raises:
        FormatError: If the window does not lie in the layer's grid, holds too few or too many
            cells or others than -1 .. 100, or is of another frame.
    """
    frame_id = _frame(message)
    if frame_id is not None and frame_id != clean_frame(layer.frame_id):
        raise FormatError(
            f"the update is for frame {frame_id!r}, but layer {layer.name!r} is in "
            f"{layer.frame_id!r}"
        )
    if layer.grid is None or layer.cells is None:
        raise FormatError(f"layer {layer.name!r} is empty; an update needs a map")
    x, y, width, height = message.x, message.y, message.width, message.height
    if min(x, y) < 0 or x + width > layer.grid.width or y + height > layer.grid.height:
        raise FormatError(
            f"the update's {width} x {height} cells at ({x}, {y}) reach out of the map of "
            f"{layer.grid.width} x {layer.grid.height} cells"
        )
    cells = np.asarray(message.data, dtype=np.int8)
    if len(cells) != width * height:
        raise FormatError(f"the update of {width} x {height} cells has {len(cells)} numbers")
    if len(cells) and not (cells.min() >= UNKNOWN and cells.max() <= OCCUPIED):
        raise FormatError(
            f"the update's cells must be -1 to 100, found {cells.min()} to {cells.max()}"
        )
    updated = layer.cells.copy()
    updated[y : y + height, x : x + width] = cells.reshape(height, width)
    return OccupancyLayer(layer.name, layer.frame_id, layer.grid, updated, layer.settings)


def crosses_itself(polygon: shapely.Polygon) -> bool:
    """Return whether an outline crosses itself, or winds around an area twice.

    An outline that touches itself, as one with a hole and a way to it, does not; nor does one
    that only rounding has made cross.
    """
    if polygon.is_valid:
        return False
    x, y = shapely.get_coordinates(polygon.exterior).T
    x, y = x - x.mean(), y - y.mean()
    enclosed = abs(float(np.sum(x[:-1] * y[1:] - x[1:] * y[:-1]))) / 2
    area = float(repaired(polygon).area)
    return abs(enclosed - area) > _CROSSING * area


def _objects(
    messages: Sequence[Any], ids: Sequence[int | None], what: str
) -> tuple[list[SemanticObject], list[str]]:
    objects, problems = [], []
    for position, (message, number) in enumerate(zip(messages, ids, strict=True)):
        label = f"{what} {position if number is None else number} ({message.name!r})"
        try:
            footprint = _polygon(message.shape)
            objects.append(_object(message, footprint, number))
        except (ValueError, TypeError) as error:
            problems.append(f"{label} is left out: {error}")
            continue
        if crosses_itself(footprint):
            problems.append(f"{label}: its outline crosses itself; everything inside it counts")
    return objects, problems


def _object(message: Any, footprint: shapely.Polygon, number: int | None) -> SemanticObject:
    return SemanticObject(
        name=message.name,
        footprint=footprint,
        id=number,
        tags=tuple(message.tags),
        confidence=tuple(float(value) for value in message.confidence),
    )


def _changed(old: SemanticObject, new: SemanticObject) -> SemanticObject:
    """Return an object with what a message says of it, and all else as it was."""
    sent, brought = (np.float32(outline(item.footprint)) for item in (old, new))
    is_same = np.array_equal(sent, brought)
    return replace(
        old,
        name=new.name,
        footprint=old.footprint if is_same else new.footprint,
        tags=new.tags,
        confidence=new.confidence,
    )


def _check_update(
    layer: SemanticLayer, to_modify: list[int], updates: int, to_delete: list[int]
) -> None:
    if len(to_modify) != updates:
        raise FormatError(
            f"the update names {len(to_modify)} objects to modify, but brings {updates} new states"
        )
    named = np.array([*to_modify, *set(to_delete)], dtype=np.int64)
    ids, counts = np.unique(named, return_counts=True)
    if (counts > 1).any():
        raise FormatError(f"the update changes object {ids[counts > 1][0]} twice")
    missing = np.setdiff1d(ids, layer.ids)
    if len(missing):
        raise FormatError(f"layer {layer.name!r} has no object with id {missing[0]}")


def _polygon(message: Any) -> shapely.Polygon:
    """Return a `geometry_msgs/Polygon`.

    Raises:
        ValueError: If it has too few points, one is not finite, or it is too tangled.
    """
    xy = [(float(point.x), float(point.y)) for point in message.points]
    if not all(math.isfinite(x) and math.isfinite(y) for x, y in xy):
        raise ValueError("its shape has a coordinate that is not finite")
    count = len(set(xy))
    if count < 3:
        points = counted(count, "different point")
        raise ValueError(f"its shape has {points}; three are needed")
    polygon = shapely.Polygon(xy)
    check_tangle(polygon)
    return polygon


def _frame(message: Any) -> str | None:
    return clean_frame(message.header.frame_id) or None
