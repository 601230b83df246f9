"""Maps become ROS messages.

The functions take `types`, which knows the message classes of a middleware: a `Port` is one. They
build the messages of ROS 1 and ROS 2 alike. Stamps are nanoseconds. What geometry_msgs/Polygon
carries is rounded to float32 on its way: about 1 mm at 10 km from the origin.
"""

from __future__ import annotations

import json

import numpy as np

from hypermap.core.errors import FrameError
from hypermap.core.frames import Pose2D
from hypermap.core.hypermap import Hypermap
from hypermap.core.layer import Layer
from hypermap.core.occupancy import OCCUPIED, UNKNOWN, OccupancyLayer
from hypermap.core.value_layer import ValueLayer
from hypermap.recordings.messages.header import clean_frame
from hypermap.ros.messages.geometry_messages import (
    Message,
    Types,
    header,
    numbers,
    point,
    polygon_stamped,
    quaternion,
)
from hypermap.ros.messages.semantic_messages import (
    object_state_array,
    object_states,
    semantic_map,
    semantic_objects,
)
from hypermap.ros.ros1.arrays import writing_arrays

__all__ = [
    "FLAGS",
    "Message",
    "Types",
    "hypermap_meta_data",
    "layer_transforms",
    "map_meta_data",
    "object_state_array",
    "object_states",
    "occupancy_grid",
    "polygon_stamped",
    "semantic_map",
    "semantic_objects",
    "value_grid",
    "value_scale",
]

FLAGS = {"subscribe_mode": False, "enable_update": True, "publish_global_topics": False}
"""The settings of a layer that the map server heeds, and what holds where they are not given."""


def map_meta_data(layer: OccupancyLayer | ValueLayer, types: Types, stamp: int) -> Message:
    """Return the `nav_msgs/MapMetaData` of a layer; a grid of 0 x 0 cells for an empty one."""
    grid = layer.grid
    origin = Pose2D() if grid is None else grid.origin
    return types.message("nav_msgs/MapMetaData")(
        map_load_time=types.stamp(stamp),
        resolution=0.0 if grid is None else float(grid.resolution),
        width=0 if grid is None else int(grid.width),
        height=0 if grid is None else int(grid.height),
        origin=types.message("geometry_msgs/Pose")(
            position=point(origin.x, origin.y, types), orientation=quaternion(origin.yaw, types)
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


def value_grid(layer: ValueLayer, types: Types, stamp: int) -> Message:
    """Return a value layer as `nav_msgs/OccupancyGrid`: 0 its smallest value, 100 its largest.

    -1 is unknown; `value_scale` gives the two values.
    """
    grid_class = writing_arrays(types.message("nav_msgs/OccupancyGrid"))
    cells = np.empty(0, np.int8)
    if layer.cells is not None:
        known = ~np.isnan(layer.cells)
        least, most = _range(layer)
        shares = (layer.cells - np.float64(least)) / ((most - least) or 1.0)
        scaled = np.rint(OCCUPIED * np.where(known, shares, 0))
        cells = np.where(known, scaled, UNKNOWN).astype(np.int8)
    return grid_class(
        header=header(layer.frame_id, types, stamp),
        info=map_meta_data(layer, types, stamp),
        data=numbers(grid_class, cells.ravel()),
    )


def value_scale(layer: ValueLayer, types: Types, _: int) -> Message:
    """Return what the cells of `value_grid` mean, JSON in a `std_msgs/String`.

    Its keys are `quantity`, `unit`, and `at_0` and `at_100`: the values of the cells 0 and 100.
    """
    least, most = _range(layer)
    scale = {"quantity": layer.quantity, "unit": layer.unit, "at_0": least, "at_100": most}
    text = json.dumps(scale, ensure_ascii=False)
    return types.message("std_msgs/String")(data=text)


def _range(layer: ValueLayer) -> tuple[float, float]:
    """Return the smallest and the largest value; 0 for a layer without any."""
    found = layer.summary_in(layer.extent())
    return (found.least, found.most) if found.count else (0.0, 0.0)


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


def _layer_meta_data(layer: Layer, types: Types) -> Message:
    flags = {name: bool(layer.settings.get(name, given)) for name, given in FLAGS.items()}
    return types.message("hypermap_msgs/LayerMetaData")(
        class_name=layer.class_name, name=layer.name, frame_id=clean_frame(layer.frame_id), **flags
    )


def _transform(parent: str, child: str, pose: Pose2D, types: Types, stamp: int) -> Message:
    translation = types.message("geometry_msgs/Vector3")(x=float(pose.x), y=float(pose.y), z=0.0)
    return types.message("geometry_msgs/TransformStamped")(
        header=header(parent, types, stamp),
        child_frame_id=clean_frame(child),
        transform=types.message("geometry_msgs/Transform")(
            translation=translation, rotation=quaternion(pose.yaw, types)
        ),
    )
