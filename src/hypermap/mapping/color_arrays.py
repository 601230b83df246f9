"""Colors of observations as an array, which is left out if none is known."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hypermap.perception.paint import Rgb

_UNKNOWN = (np.nan, np.nan, np.nan)


def packed_colors(name: str, colors: Sequence[Rgb | None]) -> dict[str, NDArray[Any]]:
    """Return colors as an array of this name, shape (N, 3); no array if all are None."""
    if not any(colors):
        return {}
    rows = [_UNKNOWN if color is None else color for color in colors]
    return {name: np.array(rows, np.float16)}  # which holds each whole number up to 2048


def unpacked_colors(name: str, arrays: Mapping[str, NDArray[Any]], count: int) -> list[Rgb | None]:
    """Return the colors of `packed_colors`; None for all if there is no such array.

    Raises:
        ValueError: If they are not `count` colors.
    """
    found = arrays.get(name)
    if found is None:
        return [None] * count
    return [_color(row, name) for row in found.reshape(count, 3).tolist()]


def _color(row: list[float], name: str) -> Rgb | None:
    if any(map(math.isnan, row)):
        return None
    if not all(0 <= value <= 255 and value % 1 == 0 for value in row):
        raise ValueError(f"{name} must be whole numbers from 0 to 255")
    red, green, blue = map(int, row)
    return red, green, blue
