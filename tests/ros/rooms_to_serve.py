"""A flat with two rooms and a door between them, to serve."""

from __future__ import annotations

import math

import numpy as np
import shapely

from hypermap.core.frames import FrameTree, Pose2D, Transform
from hypermap.core.grid import GridGeometry
from hypermap.core.hypermap import Hypermap
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.rooms import Door, Room, Rooms, with_rooms

# (x, y) in the frame `turned` is (10 - y, x) in the map.
TURNED = Transform("map", "turned", Pose2D(10.0, 0.0, math.pi / 2))


def flat() -> Hypermap:
    """Return rooms of 4 x 4 m, with a door of 0.9 m at the upper end of the wall, and two cups."""
    cells = np.full((100, 180), 100, dtype=np.int8)
    cells[10:90, 8:88] = cells[10:90, 92:172] = cells[70:88, 88:92] = 0
    grid = OccupancyLayer("occupancy", "map", GridGeometry(180, 100, 0.05), cells)
    cups = [
        SemanticObject("cup", shapely.box(x - 0.1, y - 0.1, x + 0.1, y + 0.1), number)
        for number, (x, y) in enumerate([(4.0, 1.5), (7.5, 4.0)])
    ]
    boxes = (0.4, 0.5, 4.5, 4.5), (4.5, 0.5, 8.6, 4.5)
    rooms = [
        Room(number, name, shapely.box(*box), kind, 1.0 if kind else 0.0)
        for number, (name, kind, box) in enumerate(
            zip(("Emma's place", "office"), ("kitchen", "office"), boxes, strict=True)
        )
    ]
    door = Door((0, 1), shapely.LineString([(4.5, 3.5), (4.5, 4.4)]), 0.9)
    hypermap = Hypermap([grid, SemanticLayer("things", "map", cups)], FrameTree([TURNED]))
    return with_rooms(hypermap, Rooms("map", tuple(rooms), (door,)))
