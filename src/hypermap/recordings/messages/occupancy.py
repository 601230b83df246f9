"""Occupancy layers from `nav_msgs/OccupancyGrid`."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hypermap.core.errors import FormatError
from hypermap.core.frames import Pose2D
from hypermap.core.grid import GridGeometry
from hypermap.core.occupancy import OCCUPIED, UNKNOWN, OccupancyLayer
from hypermap.recordings.messages.header import clean_frame

_MAX_TILT = 1e-3  # rad


def occupancy_of_grid(message: Any, name: str = "occupancy") -> OccupancyLayer:
    """Return the layer of an occupancy grid message.

    Raises:
        FormatError: If the grid is empty, tilted, or its numbers are out of range.
    """
    info = message.info
    cells = np.asarray(message.data, dtype=np.int8)
    if len(cells) != info.width * info.height:
        raise FormatError(f"the map of {info.width} x {info.height} cells has {len(cells)} numbers")
    if len(cells) and not (cells.min() >= UNKNOWN and cells.max() <= OCCUPIED):
        raise FormatError(
            f"the map's cells must be -1 to 100, found {cells.min()} to {cells.max()}"
        )
    q = info.origin.orientation
    if not any((q.x, q.y, q.z, q.w)):
        yaw = 0.0  # some programs leave the orientation out
    elif math.hypot(q.x, q.y) > _MAX_TILT * math.hypot(q.x, q.y, q.z, q.w):
        raise FormatError("the map's origin is tilted out of the plane")
    else:
        yaw = 2 * math.atan2(q.z, q.w)
    try:
        origin = Pose2D(
            info.origin.position.x, info.origin.position.y, math.remainder(yaw, math.tau)
        )
        # The message has float32: take the shortest decimal number that rounds to it.
        resolution = float(str(np.float32(info.resolution)))
        grid = GridGeometry(int(info.width), int(info.height), resolution, origin)
    except ValueError as error:
        raise FormatError(f"the map's geometry is wrong: {error}") from None
    frame_id = clean_frame(message.header.frame_id) or "map"
    return OccupancyLayer(name, frame_id, grid, cells.reshape(grid.shape).copy())
