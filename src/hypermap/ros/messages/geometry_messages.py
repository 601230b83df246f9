"""The parts that many messages have: headers, points, polygons, arrays of numbers."""

from __future__ import annotations

import array
import math
from collections.abc import Iterator
from functools import cache
from typing import Any, Protocol

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import ObjectArray
from hypermap.recordings.messages.header import clean_frame

Message = Any  # of the middleware's own class
_COORDINATES = {"_x", "_y", "_z"}  # slots of points in rclpy


class Types(Protocol):
    """The message classes of a middleware; a `Port` is one."""

    def message(self, type_name: str) -> type[Any]:
        """Return the class of a message, as of "nav_msgs/OccupancyGrid"."""
        ...

    def stamp(self, nanoseconds: int) -> Message:
        """Return a time as messages carry it."""
        ...


def header(frame_id: str, types: Types, stamp: int) -> Message:
    """Return a `std_msgs/Header`; the frame has no leading slash."""
    return types.message("std_msgs/Header")(
        stamp=types.stamp(stamp), frame_id=clean_frame(frame_id)
    )


def point(x: float, y: float, types: Types) -> Message:
    """Return a `geometry_msgs/Point` on the floor."""
    return types.message("geometry_msgs/Point")(x=float(x), y=float(y), z=0.0)


def points(points_xy: NDArray[np.float64], types: Types) -> list[Message]:
    """Return points of shape (N, 2) as a list of `geometry_msgs/Point`."""
    rows = np.column_stack([points_xy, np.zeros(len(points_xy))])
    return list(points_of_rows(types.message("geometry_msgs/Point"), rows))


def points_of_rows(point_class: Any, points_xyz: NDArray[np.float64]) -> Iterator[Message]:
    """Yield points of shape (N, 3) as objects of the class of `geometry_msgs/Point`.

    The classes that rosidl generates for rclpy keep a field `x` in the slot `_x`, and check what is
    assigned to it, for which numbers out of an array give no reason: their slots are filled.

    Source: rosidl_generator_py, resource/_msg.py.em.
    """
    others = _slots_besides(point_class)
    if others is None:
        for x, y, z in points_xyz.tolist():
            yield point_class(x=x, y=y, z=z)
        return
    for x, y, z in points_xyz.tolist():
        made: Any = object.__new__(point_class)
        made._x, made._y, made._z = x, y, z
        for name, value in others:
            setattr(made, name, value)
        yield made


@cache
def _slots_besides(point_class: Any) -> tuple[tuple[str, Any], ...] | None:
    """Return what a new point holds besides its coordinates; None where it has no such slots."""
    slots = set(getattr(point_class, "__slots__", ()))
    if not slots >= _COORDINATES:
        return None
    blank = point_class()
    return tuple((name, getattr(blank, name)) for name in sorted(slots - _COORDINATES))


def quaternion(yaw: float, types: Types) -> Message:
    """Return a turn about the vertical as `geometry_msgs/Quaternion`."""
    return types.message("geometry_msgs/Quaternion")(
        x=0.0, y=0.0, z=math.sin(yaw / 2), w=math.cos(yaw / 2)
    )


def ring(points_xy: NDArray[np.float64], types: Types) -> Message:
    """Return points of shape (N, 2) as a `geometry_msgs/Polygon`."""
    point_class = types.message("geometry_msgs/Point32")
    return types.message("geometry_msgs/Polygon")(
        points=[point_class(x=x, y=y, z=0.0) for x, y in points_xy.tolist()]
    )


def polygon_stamped(geometry: BaseGeometry, frame_id: str, types: Types, stamp: int) -> Message:
    """Return the outer ring of a shape's largest part as `geometry_msgs/PolygonStamped`.

    It has no points where the shape is empty or no polygon.
    """
    return types.message("geometry_msgs/PolygonStamped")(
        header=header(frame_id, types, stamp), polygon=ring(outline(geometry), types)
    )


def polygons_of(geometry: BaseGeometry) -> list[shapely.Polygon]:
    """Return the polygons of a shape that have points."""
    return [
        part
        for part in shapely.get_parts(geometry)
        if isinstance(part, shapely.Polygon) and not part.is_empty
    ]


def outline(geometry: BaseGeometry) -> NDArray[np.float64]:
    """Return the outer ring of a shape's largest part, without its first point again, (N, 2)."""
    parts = polygons_of(geometry)
    if not parts:
        return np.empty((0, 2))
    return open_ring(max(parts, key=lambda part: part.area).exterior)


def outlines(footprints: ObjectArray) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the outlines of many shapes, each of which has one.

    Returns:
        All points (P, 2), and where each outline starts and the one before it ends, (N + 1,).
    """
    parts, owners = shapely.get_parts(footprints, return_index=True)
    areas = np.where(shapely.is_empty(parts), -1, shapely.area(parts))
    order = np.lexsort((-areas, owners))
    _, first = np.unique(owners[order], return_index=True)
    rings = shapely.get_exterior_ring(parts[order[first]])
    points_xy, ring_of = shapely.get_coordinates(rings, return_index=True)
    is_last = np.diff(ring_of, append=len(rings)) != 0  # the first point again
    counts = shapely.get_num_points(rings) - 1
    return points_xy[~is_last], np.concatenate([[0], np.cumsum(counts)])


def open_ring(ring: shapely.LinearRing) -> NDArray[np.float64]:
    """Return a ring's points without the first one again, shape (N, 2)."""
    return shapely.get_coordinates(ring)[:-1]


def octets(message_class: type[Any], content: bytes) -> Any:
    """Return bytes as a field `uint8[]` of a message holds them; genpy takes nothing else."""
    is_genpy = hasattr(message_class, "_md5sum")
    return content if is_genpy else numbers(message_class, np.frombuffer(content, np.uint8))


def numbers(message_class: type[Any], values: NDArray[Any]) -> Any:
    """Return numbers as the messages of a class carry them fastest.

    rosbags takes numpy's arrays. rclpy takes Python's without looking at each item, and genpy
    takes any sequence.
    """
    if hasattr(message_class, "__msgtype__"):
        return np.ascontiguousarray(values)
    packed = array.array(values.dtype.char)
    packed.frombytes(np.ascontiguousarray(values).tobytes())
    return packed
