"""Free space as runs of cells and corners of walls, as `geodesic` walks over it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hypermap.core.arrays import BoolArray


class Strips(NamedTuple):
    """Free space, row by row; lengths are in cells, and cell (row, col) ends at (col + 1, row + 1).

    Attributes:
        begins: where each run of free cells begins, int32, shape (N,), by rows.
        ends: where it ends.
        rows: place of the first run of each row, int64, shape (height + 1,).
        xs: of each corner that a path may turn around, which one of four cells blocks, int32,
            shape (M,), by lines y = 0, 1 ...
        ys: y of each corner, int32.
        sides: on which side of the corner the blocked cell is, along x, -1 or 1, int8.
        levels: likewise along y.
        lines: place of the first corner on each line, int64, shape (height + 2,).
    """

    begins: NDArray[np.int32]
    ends: NDArray[np.int32]
    rows: NDArray[np.int64]
    xs: NDArray[np.int32]
    ys: NDArray[np.int32]
    sides: NDArray[np.int8]
    levels: NDArray[np.int8]
    lines: NDArray[np.int64]


def strips_of(free: BoolArray) -> Strips:
    """Return free cells, shape (height, width), as strips; what is off the grid is blocked."""
    height = len(free)
    around = np.pad(~free, 1, constant_values=True)
    rows, cols = np.nonzero(around[1:-1, 1:] != around[1:-1, :-1])
    row_starts = np.searchsorted(rows[::2], np.arange(height + 1))
    number = around.view(np.uint8)
    count = number[:-1, :-1] + number[:-1, 1:] + number[1:, :-1] + number[1:, 1:]
    ys, xs = np.nonzero(count == 1)
    above = around[ys + 1, xs] | around[ys + 1, xs + 1]
    right = around[ys, xs + 1] | around[ys + 1, xs + 1]
    return Strips(
        cols[::2].astype(np.int32),
        cols[1::2].astype(np.int32),
        row_starts.astype(np.int64),
        xs.astype(np.int32),
        ys.astype(np.int32),
        np.where(right, 1, -1).astype(np.int8),
        np.where(above, 1, -1).astype(np.int8),
        np.searchsorted(ys, np.arange(height + 2)).astype(np.int64),
    )
