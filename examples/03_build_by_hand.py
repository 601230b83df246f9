"""Build a map from arrays and shapes: writes kitchen.hmap and kitchen.geojson.

The semantic layer has a frame of its own, turned against the grid's; questions are asked in either.
"""

import math
from pathlib import Path

import numpy as np
import shapely

from hypermap import (
    FrameTree,
    GridGeometry,
    Hypermap,
    OccupancyLayer,
    Pose2D,
    SemanticLayer,
    SemanticObject,
    Transform,
    save_map,
    to_geojson,
)

cells = np.zeros((40, 60), dtype=np.int8)
cells[[0, -1], :] = cells[:, [0, -1]] = 100  # walls all around
grid = GridGeometry(width=60, height=40, resolution=0.05, origin=Pose2D(x=-1.5, y=-1.0))

objects = SemanticLayer(
    "objects",
    "kitchen",
    [
        SemanticObject("table", shapely.box(-0.6, -0.4, 0.6, 0.4)),
        SemanticObject("cup", shapely.Point(0.2, 0.1).buffer(0.04), tags=("mug",), confidence=(1,)),
    ],
)
frames = FrameTree([Transform("map", "kitchen", Pose2D(x=0.5, yaw=math.radians(30)))])
kitchen = Hypermap([OccupancyLayer("occupancy", "map", grid, cells), objects], frames)

print("at the kitchen's origin:", kitchen.label_at("objects", [0, 0], frame_id="kitchen")[0])
print("the cup in the base frame:", kitchen.find("objects", "cup").round(3)[0])

save_map(kitchen, "kitchen.hmap")
Path("kitchen.geojson").write_text(to_geojson(objects), encoding="utf-8")
print("wrote kitchen.hmap and kitchen.geojson")
