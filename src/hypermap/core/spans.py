"""Which whole numbers an area covers, row by row: an area as spans of cells.

Source: the scan-line polygon fill of Foley et al., "Computer Graphics: Principles and Practice",
2nd edition, section 3.6, with the boundary counted in on every side.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import BoolArray, IntArray

_POLYGONS = (3, 6)  # shapely's type numbers of what has an inside
_DECIMALS = 6  # lengths shorter than that of the last one do not count
_AT_ONCE = 1 << 20  # crossings of edges and rows that are held in memory together

Spans = tuple[IntArray, IntArray, IntArray]


def covered(area: BaseGeometry, shape: tuple[int, int], row: int, col: int) -> BoolArray:
    """Return which whole-numbered places an area covers; its boundary counts.

    Args:
        area: a valid geometry of any type.
        shape: rows and columns of the answer; its element (r, c) is about the place (x, y) =
            (col + c, row + r).
        row: of the first element.
        col: of the first element.
    """
    height, width = shape
    begins, ends = [], []
    for rows, first, last in _spans(area, (row, row + height), (col, col + width)):
        begin, end = np.clip(first - col, 0, width), np.clip(last - col + 1, 0, width)
        is_filled = end > begin
        begins.append(((rows - row) * width + begin)[is_filled])
        ends.append(((rows - row) * width + end)[is_filled])
    none: IntArray = np.empty(0, dtype=np.int64)
    bounds = _joined(np.concatenate([none, *begins]), np.concatenate([none, *ends]))
    lengths = np.diff(bounds, prepend=0, append=height * width)  # of outside, inside, outside ...
    return np.repeat(np.arange(len(lengths)) % 2 == 1, lengths).reshape(shape)


def _joined(begins: IntArray, ends: IntArray) -> IntArray:
    """Return begin, end, begin, end ... of spans, sorted; those that overlap are one."""
    order = np.argsort(begins)
    begins, ends = begins[order], np.maximum.accumulate(ends[order])
    is_apart = begins[1:] > ends[:-1]
    starts = np.concatenate([begins[:1], begins[1:][is_apart]])
    stops = np.concatenate([ends[:-1][is_apart], ends[-1:]])
    return np.column_stack([starts, stops]).ravel()


def _spans(
    area: BaseGeometry, rows_within: tuple[int, int], cols_within: tuple[int, int]
) -> Iterator[Spans]:
    """Yield rows, first and last columns of what an area covers in some rows.

    Args:
        area: a valid geometry.
        rows_within: the first row, and the one after the last.
        cols_within: likewise; spans may end anywhere outside.
    """
    low, high = rows_within
    for part in _parts(area):
        edges = _edges(part)
        has_inside = shapely.get_type_id(part) in _POLYGONS
        step = max(1, _AT_ONCE // max(1, len(edges)))
        for begin in range(low, high, step):
            rows, x = _crossings(edges, (begin, min(begin + step, high)), cols_within)
            if has_inside:  # between the first and the second crossing, and so on
                yield rows[::2], _ceil(x[::2]), _floor(x[1::2])
            else:
                yield rows, _ceil(x), _floor(x)
        yield _level(part, edges, low, high)


def _parts(area: BaseGeometry) -> list[BaseGeometry]:
    """Return the parts of a collection, at any depth; what is none is its own part."""
    if isinstance(area, shapely.GeometryCollection) and area.geom_type == "GeometryCollection":
        return [small for part in area.geoms for small in _parts(part)]
    return [area]


def _edges(part: BaseGeometry) -> NDArray[np.float64]:
    """Return the edges of a geometry as x, y of the lower and then of the upper end, (N, 4)."""
    lines = shapely.get_parts(shapely.boundary(part) if part.area > 0 else part)
    points, owners = shapely.get_coordinates(lines, return_index=True)
    is_edge = owners[:-1] == owners[1:]
    edges = np.hstack([points[:-1][is_edge], points[1:][is_edge]])
    is_downwards = edges[:, 1] > edges[:, 3]
    edges[is_downwards] = edges[is_downwards][:, [2, 3, 0, 1]]
    return edges


def _crossings(
    edges: NDArray[np.float64], rows_within: tuple[int, int], cols_within: tuple[int, int]
) -> tuple[IntArray, NDArray[np.float64]]:
    """Return where edges cross rows, sorted by row and then by x; not at their upper ends."""
    (low, high), (left, right) = rows_within, cols_within
    first = np.clip(np.ceil(edges[:, 1]), low, high).astype(np.int64)
    counts = np.clip(np.ceil(edges[:, 3]), low, high).astype(np.int64) - first
    crossing = np.flatnonzero(counts)
    edges, first, counts = edges[crossing], first[crossing], counts[crossing]
    slope = (edges[:, 2] - edges[:, 0]) / (edges[:, 3] - edges[:, 1])
    steps = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    rows = np.repeat(first, counts) + steps
    x0, y0, slope = (np.repeat(values, counts) for values in (edges[:, 0], edges[:, 1], slope))
    x = np.clip(x0 + (rows - y0) * slope, left - 1, right)
    order = np.argsort(rows * (right - left + 2) + x)  # much faster than by two keys
    return rows[order], x[order]


def _level(part: BaseGeometry, edges: NDArray[np.float64], low: int, high: int) -> Spans:
    """Return what crossings leave out: level edges, upper ends and points that lie on a row."""
    points = shapely.get_coordinates(part)
    x = np.concatenate([edges[:, [0, 2]], np.repeat(points[:, :1], 2, axis=1)])
    y = np.concatenate([edges[:, 3], points[:, 1]])
    is_level = np.concatenate([edges[:, 1] == edges[:, 3], np.ones(len(points), dtype=bool)])
    chosen = is_level & (y == np.floor(y)) & (y >= low) & (y < high)
    return y[chosen].astype(np.int64), _ceil(x[chosen].min(axis=1)), _floor(x[chosen].max(axis=1))


def _ceil(x: NDArray[np.float64]) -> IntArray:
    return np.ceil(np.round(x, _DECIMALS)).astype(np.int64)


def _floor(x: NDArray[np.float64]) -> IntArray:
    return np.floor(np.round(x, _DECIMALS)).astype(np.int64)
