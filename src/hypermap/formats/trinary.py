"""Grids as map_saver writes them: a PGM picture of black, white and grey, and its YAML.

Source: ROS' map_server, map_saver.cpp and its documentation of "trinary". What a cell is
likely to hold is rounded to free, occupied or unknown, as old programs know no more.
"""

from __future__ import annotations

import numpy as np

from hypermap.core.errors import HypermapError
from hypermap.core.occupancy import OccupancyLayer
from hypermap.formats.yaml_text import write_yaml

BLACK, GREY, WHITE = 0, 205, 254
OCCUPIED_THRESH, FREE_THRESH = 0.65, 0.196


def dump_trinary(layer: OccupancyLayer, name: str) -> dict[str, bytes]:
    """Return the files of a grid: NAME.pgm and NAME.yaml.

    Raises:
        HypermapError: If the layer is empty, or a raw map, whose values mean something else.
    """
    if layer.grid is None or layer.cells is None:
        raise HypermapError(f"layer {layer.name!r} is empty: there is no grid to save")
    if layer.cells.max() > 100:
        raise HypermapError(
            f"layer {layer.name!r} is a raw map, of values up to {layer.cells.max()}: a .pgm holds "
            "only free, occupied and unknown; save it as .yaml"
        )
    origin = layer.grid.origin
    described = {
        "image": f"{name}.pgm",
        "resolution": layer.grid.resolution,
        "origin": [origin.x, origin.y, origin.yaw],
        "negate": 0,
        "occupied_thresh": OCCUPIED_THRESH,
        "free_thresh": FREE_THRESH,
    }
    values = np.arange(-1, 101)
    shades = np.full(len(values), GREY, np.uint8)
    shades[(values >= 0) & (values < 100 * FREE_THRESH)] = WHITE
    shades[values > 100 * OCCUPIED_THRESH] = BLACK
    picture = shades[layer.cells[::-1] + 1]  # row 0 is the lowest
    head = f"P5\n{layer.grid.width} {layer.grid.height}\n255\n".encode()
    return {f"{name}.pgm": head + picture.tobytes(), f"{name}.yaml": write_yaml(described)}


def rounded(layer: OccupancyLayer) -> int:
    """Return how many cells of a grid lose what they say between free and occupied."""
    cells = layer.cells
    return 0 if cells is None else int(np.count_nonzero((cells > 0) & (cells < 100)))
