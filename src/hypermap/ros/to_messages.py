"""Maps become ROS messages.

The functions take `types`, which knows the message classes of a middleware: a `Port` is one. They
build the messages of ROS 1 and ROS 2 alike. Stamps are nanoseconds. What geometry_msgs/Polygon
carries is rounded to float32 on its way: about 1 mm at 10 km from the origin.
"""

from __future__ import annotations

import array
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Protocol

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.errors import FrameError
from hypermap.core.frames import Pose2D
from hypermap.core.hypermap import Hypermap
from hypermap.core.layer import Layer
from hypermap.core.objects import ObjectTable, SemanticObject
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.placed import Found
from hypermap.core.semantic import SemanticLayer
from hypermap.core.shapes import repaired
from hypermap.ros.ros1_arrays import writing_arrays

Message = Any  # of the middleware's own class

FLAGS = {"subscribe_mode": False, "enable_update": True, "publish_global_topics": False}
"""The settings of a layer that the map server heeds, and what holds where they are not given."""


class Types(Protocol):
    """The message classes of a middleware."""

    def message(self, type_name: str) -> type[Any]:
        """Return the class of a message, as of "nav_msgs/OccupancyGrid"."""
        ...

    def stamp(self, nanoseconds: int) -> Message:
        """Return a time as messages carry it."""
        ...


def header(frame_id: str, types: Types, stamp: int) -> Message:
    """Return a `std_msgs/Header`; the frame has no leading slash."""
    return types.message("std_msgs/Header")(stamp=types.stamp(stamp), frame_id=frame_id.lstrip("/"))


# Occupancy


def map_meta_data(layer: OccupancyLayer, types: Types, stamp: int) -> Message:
    """Return the `nav_msgs/MapMetaData` of a layer; a grid of 0 x 0 cells for an empty one."""
    grid = layer.grid
    origin = Pose2D() if grid is None else grid.origin
    return types.message("nav_msgs/MapMetaData")(
        map_load_time=types.stamp(stamp),
        resolution=0.0 if grid is None else float(grid.resolution),
        width=0 if grid is None else int(grid.width),
        height=0 if grid is None else int(grid.height),
        origin=types.message("geometry_msgs/Pose")(
            position=point(origin.x, origin.y, types), orientation=_quaternion(origin.yaw, types)
        ),
    )


def occupancy_grid(layer: OccupancyLayer, types: Types, stamp: int) -> Message:
    """Return a layer as `nav_msgs/OccupancyGrid`.

    The message holds signed bytes. The values of a raw map above 127 wrap round, as in
    `map_server`: who reads the bytes as unsigned gets them back (255 is -1, unknown).
    """
    grid_class = writing_arrays(types.message("nav_msgs/OccupancyGrid"))
    cells = np.empty(0, np.int8) if layer.cells is None else layer.cells
    return grid_class(
        header=header(layer.frame_id, types, stamp),
        info=map_meta_data(layer, types, stamp),
        data=numbers(grid_class, cells.astype(np.int8, copy=False).ravel()),
    )


# Semantics


def semantic_map(layer: SemanticLayer, types: Types, stamp: int) -> Message:
    """Return a layer as `hypermap_msgs/SemanticMap`, in the layer's frame.

    An object's shape is the outer ring of its largest part; `object_state_array` carries all parts.
    """
    return types.message("hypermap_msgs/SemanticMap")(
        header=header(layer.frame_id, types, stamp), objects=_objects(layer.table, types)
    )


def object_state_array(layer: SemanticLayer, types: Types, stamp: int) -> Message:
    """Return all that is known of a layer's objects as `hypermap_msgs/ObjectStateArray`."""
    table = layer.table
    objects = (table.object(row) for row in range(len(table)))
    return types.message("hypermap_msgs/ObjectStateArray")(
        header=header(layer.frame_id, types, stamp),
        objects=[
            _state(layer.name, item, centroid, types)
            for item, centroid in zip(objects, table.centroids.tolist(), strict=True)
        ],
    )


def object_states(found: Iterable[Found], types: Types) -> list[Message]:
    """Return what a question has found as `hypermap_msgs/ObjectState`; hits without object not."""
    return [
        _state(hit.layer, hit.object, hit.point_xy.tolist(), types)
        for hit in found
        if hit.object is not None
    ]


def semantic_objects(found: Iterable[Found], types: Types) -> list[Message]:
    """Return what a question has found as `hypermap_msgs/SemanticObject`; like `object_states`."""
    return [
        _object(hit.object, hit.point_xy.tolist(), types) for hit in found if hit.object is not None
    ]


# The map


def hypermap_meta_data(hypermap: Hypermap, node_name: str, types: Types) -> Message:
    """Return what layers a map has as `hypermap_msgs/HypermapMetaData`."""
    layers = [_layer_meta_data(layer, types) for layer in hypermap]
    return types.message("hypermap_msgs/HypermapMetaData")(
        layer_cnt=len(layers), node_name=node_name, layers=layers
    )


def layer_transforms(hypermap: Hypermap, types: Types, stamp: int) -> list[Message]:
    """Return the poses of all layers' frames in the base frame, as TransformStamped.

    A frame that no transform of the map connects with the base frame is left out.
    """
    base = hypermap.base_frame
    transforms = []
    for frame_id in dict.fromkeys(layer.frame_id for layer in hypermap):
        if frame_id == base:
            continue
        try:
            pose = hypermap.frames.lookup(base, frame_id)
        except FrameError:
            continue
        transforms.append(_transform(base, frame_id, pose, types, stamp))
    return transforms


# Geometry


def polygon_stamped(geometry: BaseGeometry, frame_id: str, types: Types, stamp: int) -> Message:
    """Return the outer ring of a shape's largest part as `geometry_msgs/PolygonStamped`.

    It has no points where the shape is empty or no polygon.
    """
    return types.message("geometry_msgs/PolygonStamped")(
        header=header(frame_id, types, stamp),
        polygon=_ring(outline(geometry), types),
    )


def point(x: float, y: float, types: Types) -> Message:
    """Return a `geometry_msgs/Point` on the floor."""
    return types.message("geometry_msgs/Point")(x=float(x), y=float(y), z=0.0)


def points(points_xy: NDArray[np.float64], types: Types) -> list[Message]:
    """Return points of shape (N, 2) as a list of `geometry_msgs/Point`."""
    point_class = types.message("geometry_msgs/Point")
    return [point_class(x=x, y=y, z=0.0) for x, y in points_xy.tolist()]


def outline(geometry: BaseGeometry) -> NDArray[np.float64]:
    """Return the outer ring of a shape's largest part, without its first point again, (N, 2)."""
    parts = _parts(geometry)
    if not parts:
        return np.empty((0, 2))
    return _open_ring(max(parts, key=lambda part: part.area).exterior)


def numbers(message_class: type[Any], values: NDArray[Any]) -> Any:
    """Return numbers as the messages of a class carry them fastest.

    rosbags takes numpy's arrays. rclpy takes Python's without looking at each item, and genpy
    takes any sequence.
    """
    if hasattr(message_class, "__msgtype__"):
        return np.ascontiguousarray(values)
    numbers = array.array(values.dtype.char)
    numbers.frombytes(np.ascontiguousarray(values).tobytes())
    return numbers


def _objects(table: ObjectTable, types: Types) -> list[Message]:
    return [
        _object(table.object(row), centroid, types)
        for row, centroid in enumerate(table.centroids.tolist())
    ]


def _object(item: SemanticObject, position: Sequence[float], types: Types) -> Message:
    object_class = types.message("hypermap_msgs/SemanticObject")
    return object_class(
        id=-1 if item.id is None else int(item.id),
        shape=_ring(outline(item.footprint), types),
        position=point(position[0], position[1], types),
        name=item.name,
        tags=[str(tag) for tag in item.tags],
        confidence=numbers(object_class, np.array(item.confidence, dtype=np.float64)),
    )


def _state(layer: str, item: SemanticObject, position: Sequence[float], types: Types) -> Message:
    shape = item.footprint if item.footprint.is_valid else repaired(item.footprint)
    return types.message("hypermap_msgs/ObjectState")(
        layer=layer,
        object=_object(item, position, types),
        parts=[_polygon_with_holes(part, types) for part in _parts(item.footprint)],
        area=float(shape.area),
        existence=_or_nan(item.existence),
        first_seen=_or_nan(item.first_seen),
        last_seen=_or_nan(item.last_seen),
        attributes=json.dumps(_plain(item.attributes), ensure_ascii=False),
    )


def _polygon_with_holes(polygon: shapely.Polygon, types: Types) -> Message:
    return types.message("hypermap_msgs/PolygonWithHoles")(
        exterior=_ring(_open_ring(polygon.exterior), types),
        holes=[_ring(_open_ring(ring), types) for ring in polygon.interiors],
    )


def _ring(points_xy: NDArray[np.float64], types: Types) -> Message:
    point_class = types.message("geometry_msgs/Point32")
    return types.message("geometry_msgs/Polygon")(
        points=[point_class(x=x, y=y, z=0.0) for x, y in points_xy.tolist()]
    )


def _open_ring(ring: shapely.LinearRing) -> NDArray[np.float64]:
    return shapely.get_coordinates(ring)[:-1]


def _parts(geometry: BaseGeometry) -> list[shapely.Polygon]:
    """Return the polygons of a shape that have points."""
    return [
        part
        for part in shapely.get_parts(geometry)
        if isinstance(part, shapely.Polygon) and not part.is_empty
    ]


def _layer_meta_data(layer: Layer, types: Types) -> Message:
    flags = {name: bool(layer.settings.get(name, given)) for name, given in FLAGS.items()}
    return types.message("hypermap_msgs/LayerMetaData")(
        class_name=layer.class_name, name=layer.name, frame_id=layer.frame_id.lstrip("/"), **flags
    )


def _transform(parent: str, child: str, pose: Pose2D, types: Types, stamp: int) -> Message:
    translation = types.message("geometry_msgs/Vector3")(x=float(pose.x), y=float(pose.y), z=0.0)
    return types.message("geometry_msgs/TransformStamped")(
        header=header(parent, types, stamp),
        child_frame_id=child.lstrip("/"),
        transform=types.message("geometry_msgs/Transform")(
            translation=translation, rotation=_quaternion(pose.yaw, types)
        ),
    )


def _quaternion(yaw: float, types: Types) -> Message:
    return types.message("geometry_msgs/Quaternion")(
        x=0.0, y=0.0, z=math.sin(yaw / 2), w=math.cos(yaw / 2)
    )


def _or_nan(number: float | None) -> float:
    return math.nan if number is None else float(number)


def _plain(value: Any) -> Any:
    """Return what JSON can hold of what YAML can: other things as text."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple | set | frozenset):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value if isinstance(value, str | int | float | None) else str(value)
