"""A part of an organized cloud as planes with margins, so that windows need no clipping.

The planes are x, y and z; a place is a row-major index into a plane. A pixel without a
point, and every pixel outside the image, has the value `FAR`, and so is near no other.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hypermap._loops import loop
from hypermap.core.arrays import BoolArray
from hypermap.perception.projection import Rows, fill_row

FAR = np.float32(1e6)
MARGIN = 32  # rows and columns on each side


@loop(allocates=True)
def planes_of(
    rows: Rows, valid: BoolArray, top: int, left: int, bottom: int, right: int
) -> NDArray[np.float32]:
    """Return the points of a part of an image as planes with margins.

    Args:
        rows: the image's points, as `rows_of` returns them.
        valid: which of its pixels have a point, shape (H, W).
        top: first row.
        left: first column.
        bottom: the row after the last.
        right: the column after the last.

    Returns:
        Float32, shape (3, bottom - top + 64, right - left + 64).
    """
    height, width = bottom - top + 2 * MARGIN, right - left + 2 * MARGIN
    first, last = max(left - MARGIN, 0), min(right + MARGIN, valid.shape[1])
    start, end = first - left + MARGIN, last - left + MARGIN
    planes = np.empty((3, height, width), np.float32)
    points = np.empty((3, valid.shape[1]), np.float32)
    for row in range(height):
        from_row = row + top - MARGIN
        if not 0 <= from_row < valid.shape[0]:
            planes[:, row] = FAR
            continue
        fill_row(rows, from_row, points)
        is_valid = valid[from_row, first:last]
        for axis in range(3):
            plane, some = planes[axis, row], points[axis, first:last]
            plane[:start] = FAR
            plane[end:] = FAR
            inner = plane[start:end]
            for column in range(len(some)):
                inner[column] = some[column] if is_valid[column] else FAR
    return planes
