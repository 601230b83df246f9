"""Labels of cells as polygons that share their edges."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray

from hypermap.core.arrays import BoolArray, IntArray, ObjectArray


def cell_outlines(labels: NDArray[np.int32]) -> tuple[ObjectArray, IntArray]:
    """Return the polygons of connected cells of one label, with holes; labels of 0 have none.

    Args:
        labels: shape (height, width).

    Returns:
        Polygons in units of cells, where cell (row, col) reaches from (col, row) to
        (col + 1, row + 1), and the label of each. Cells that touch at a corner alone are not
        connected. Neighbors have the same corners along the edges that they share.
    """
    around = np.pad(labels, 1)
    level = (around[:-1] != around[1:])[:, 1:-1]  # edges along x, at the lower side of each row
    upright = (around[:, :-1] != around[:, 1:])[1:-1]
    # A run of edges ends where edges across it meet it.
    height, width = labels.shape
    meets_upright = np.zeros((height + 1, width + 1), dtype=bool)
    meets_upright[:-1] |= upright
    meets_upright[1:] |= upright
    meets_level = np.zeros((height + 1, width + 1), dtype=bool)
    meets_level[:, :-1] |= level
    meets_level[:, 1:] |= level
    along_y = _runs(upright.T, meets_level.T)[:, :, ::-1]
    runs = np.concatenate([_runs(level, meets_upright), along_y]).astype(np.float64)
    if not len(runs):
        return np.empty(0, dtype=object), np.empty(0, dtype=np.int64)
    lines: ObjectArray = np.asarray(shapely.linestrings(runs))
    faces = shapely.get_parts(shapely.polygonize(lines))
    inside = np.floor(shapely.get_coordinates(shapely.point_on_surface(faces))).astype(np.int64)
    found = labels[inside[:, 1], inside[:, 0]].astype(np.int64)
    return faces[found > 0], found[found > 0]


def _runs(edges: BoolArray, crossings: BoolArray) -> IntArray:
    """Return the ends (x, y) of runs of edges along x, shape (N, 2, 2)."""
    padded = np.pad(edges, ((0, 0), (1, 1)))
    after, before = padded[:, 1:], padded[:, :-1]
    ys, begins = np.nonzero(after & ~(before & ~crossings))
    _, ends = np.nonzero(before & ~(after & ~crossings))  # in the same order
    return np.stack([np.stack([begins, ys], axis=1), np.stack([ends, ys], axis=1)], axis=1)
