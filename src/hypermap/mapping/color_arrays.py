"""Colors of observations as an array, which is left out if none is known."""

from __future__ import annotations

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
    is_known = ~np.isnan(found).reshape(count, 3).all(axis=1)
    known = found[is_known]
    if not ((known >= 0) & (known <= 255) & (known % 1 == 0)).all():
        raise ValueError(f"{name} must be whole numbers from 0 to 255")
    rows = zip(is_known.tolist(), np.nan_to_num(found).astype(int).tolist(), strict=True)
    return [(red, green, blue) if is_one else None for is_one, (red, green, blue) in rows]
