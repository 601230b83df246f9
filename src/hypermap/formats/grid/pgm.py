"""Grids as a PGM image with its YAML: in the three shades of map_saver, or value by value.

Source: ROS' map_server, map_saver.cpp and image_loader.cpp, and nav2's map_io.cpp. In "trinary",
what a cell is likely to hold is rounded to free, occupied or unknown, as old programs know no more.
In "raw", a shade is the cell itself, and what is above 100 is unknown.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hypermap.core.errors import HypermapError
from hypermap.core.occupancy import OCCUPIED, OccupancyLayer
from hypermap.formats.yaml_text import write_yaml

BLACK, GRAY, WHITE = 0, 205, 254
OCCUPIED_THRESH, FREE_THRESH = 0.65, 0.196
_RAW_UNKNOWN = 255

_VALUES = np.arange(-1, OCCUPIED + 1)


def dump_trinary(layer: OccupancyLayer, name: str) -> dict[str, bytes]:
    """Return the files of a grid: NAME.pgm and NAME.yaml.

    Raises:
        HypermapError: If the layer is empty, or a raw map, whose values mean something else.
    """
    shades = np.full(len(_VALUES), GRAY, np.uint8)
    shades[(_VALUES >= 0) & (_VALUES < 100 * FREE_THRESH)] = WHITE
    shades[_VALUES > 100 * OCCUPIED_THRESH] = BLACK
    return _dump(layer, name, shades, {})


def dump_raw(layer: OccupancyLayer, name: str) -> dict[str, bytes]:
    """Return the files of a grid, NAME.pgm and NAME.yaml, with exact values.

    Raises:
        HypermapError: As `dump_trinary`.
    """
    shades = np.where(_VALUES < 0, _RAW_UNKNOWN, _VALUES).astype(np.uint8)
    return _dump(layer, name, shades, {"mode": "raw"})


def _dump(
    layer: OccupancyLayer, name: str, shades: NDArray[np.uint8], more: dict[str, str]
) -> dict[str, bytes]:
    """Return the files of a grid.

    Args:
        layer: the grid.
        name: of the files.
        shades: of the values from -1 on.
        more: what the YAML says besides.
    """
    if layer.grid is None or layer.cells is None:
        raise HypermapError(f"layer {layer.name!r} is empty: there is no grid to save")
    if layer.cells.max() > OCCUPIED:
        raise HypermapError(
            f"layer {layer.name!r} is a raw map, of values up to {layer.cells.max()}: a .pgm has "
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
        **more,
    }
    picture = shades[layer.cells[::-1] + 1]  # row 0 is the lowest
    head = f"P5\n{layer.grid.width} {layer.grid.height}\n255\n".encode()
    return {f"{name}.pgm": head + picture.tobytes(), f"{name}.yaml": write_yaml(described)}


def rounded(layer: OccupancyLayer) -> int:
    """Return how many cells are neither free, occupied nor unknown, and so lose their value."""
    cells = layer.cells
    return 0 if cells is None else int(np.count_nonzero((cells > 0) & (cells < 100)))
