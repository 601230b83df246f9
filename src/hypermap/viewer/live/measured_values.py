"""The numbers of a value layer, from which the page writes values and draws contours."""

from __future__ import annotations

import base64
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hypermap.core.frames import Pose2D
from hypermap.core.value_layer import ValueLayer

MOST_CELLS = 4_000_000
"""How many cells are sent; of a larger grid, every second or third along a side."""

_STEPS = 65534  # between the least and the largest number
_UNKNOWN = 65535


def describe_values(layer: ValueLayer, base_T_layer: Pose2D) -> dict[str, Any] | None:
    """Return values and standard deviations of a layer as `MeasuredValues` of the page.

    Numbers are whole ones of 16 bits, little-endian, in Base64, by rows from the grid's origin:
    `low` plus so many times `step`; 65535 where nothing is known.

    Args:
        layer: None is returned while it is empty.
        base_T_layer: pose of its frame in the base frame.
    """
    if layer.grid is None or layer.cells is None:
        return None
    every = math.ceil(math.sqrt(layer.cells.size / MOST_CELLS))
    cells = layer.cells[::every, ::every]
    origin = base_T_layer @ layer.grid.origin
    deviations = layer.deviations
    return {
        "quantity": layer.quantity,
        "unit": layer.unit,
        "decimals": layer.decimals,
        "grid": {
            "x": origin.x,
            "y": origin.y,
            "yaw": origin.yaw,
            "resolution": layer.grid.resolution * every,
            "width": cells.shape[1],
            "height": cells.shape[0],
        },
        "values": _packed(cells),
        "deviations": None if deviations is None else _packed(deviations[::every, ::every]),
    }


def _packed(numbers: NDArray[np.float32]) -> dict[str, Any]:
    known = np.isfinite(numbers)
    low, high = (numbers[known].min(), numbers[known].max()) if known.any() else (0.0, 0.0)
    low, step = float(low), (float(high) - float(low)) / _STEPS
    whole = np.full(numbers.shape, _UNKNOWN, dtype="<u2")
    whole[known] = np.rint((numbers[known].astype(np.float64) - low) / step) if step else 0
    return {"low": low, "step": step, "numbers": base64.b64encode(whole.tobytes()).decode("ascii")}
