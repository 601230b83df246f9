"""Value layers as messages of grid_map (https://github.com/ANYbotics/grid_map).

Its maps have float32 cells in several layers, NaN where nothing is known. Of a map with the size
(width, height), index (0, 0) is the cell with the largest x and y, the first index counts along -x,
the second along -y, and the first one counts fastest: these are our cells, by rows, backwards.

Source: grid_map_ros, GridMapRosConverter.cpp (toOccupancyGrid) and GridMapMsgHelpers.hpp.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hypermap.core.value_layer import ValueLayer
from hypermap.ros.messages.geometry_messages import (
    Message,
    Types,
    header,
    numbers,
    point,
    quaternion,
)
from hypermap.ros.ros1.arrays import writing_arrays

GRID_MAP = "grid_map_msgs/GridMap"


def grid_map(layer: ValueLayer, types: Types, stamp: int) -> Message:
    """Return a value layer as `grid_map_msgs/GridMap`.

    Its layers are `value` and, where it is known, `deviation`, both in the unit of the layer; the
    former alone decides where the map is valid. grid_map does not turn its maps: where the grid of
    the layer is turned, only the pose in the message says so.
    """
    info_class = types.message("grid_map_msgs/GridMapInfo")
    head = header(layer.frame_id, types, stamp)
    info, whole = info_class(), writing_arrays(types.message(GRID_MAP))()
    if hasattr(info, "header"):  # in ROS 1
        info.header = head
    else:
        whole.header = head
    grid = layer.grid
    if grid is not None and layer.cells is not None:
        side = float(grid.resolution)
        info.resolution = side
        info.length_x, info.length_y = side * int(grid.width), side * int(grid.height)
        x, y = grid.origin.apply([[info.length_x / 2, info.length_y / 2]])[0].tolist()
        info.pose.position = point(x, y, types)
        info.pose.orientation = quaternion(grid.origin.yaw, types)
        arrays = {"value": layer.cells, "deviation": layer.deviations}
        known = {name: array for name, array in arrays.items() if array is not None}
        whole.layers, whole.basic_layers = list(known), ["value"]
        whole.data = [_matrix(array, types) for array in known.values()]
    whole.info = info
    return whole


def _matrix(cells: NDArray[np.float32], types: Types) -> Message:
    """Return cells, shape (height, width), as `std_msgs/Float32MultiArray`, column-major."""
    height, width = cells.shape
    dimension = types.message("std_msgs/MultiArrayDimension")
    columns = dimension(label="column_index", size=height, stride=width * height)
    rows = dimension(label="row_index", size=width, stride=width)
    layout = types.message("std_msgs/MultiArrayLayout")(dim=[columns, rows], data_offset=0)
    array_class = writing_arrays(types.message("std_msgs/Float32MultiArray"))
    return array_class(layout=layout, data=numbers(array_class, cells.ravel()[::-1]))
