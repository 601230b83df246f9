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
_NOTHING: IntArray = np.empty(0, dtype=np.int64)
_AT_ONCE = 1 << 20  # crossings of edges and rows that are held in memory together


def covered(area: BaseGeometry, shape: tuple[int, int], row: int, col: int) -> IntArray:
    """Return which whole-numbered places an area covers, as spans; its boundary counts.

    Args:
        area: a valid geometry of any type.
        shape: rows and columns of a window; its element (r, c) is about the place (x, y) =
            (col + c, row + r).
        row: of the first element.
        col: of the first element.

    Returns:
        Where spans of covered elements begin and end, in turns and never descending, as positions
        in the flattened window.
    """
    each = [spans for spans in _spans(area, shape, row, col) if len(spans)]
    return each[0] if len(each) == 1 else _joined(np.concatenate([_NOTHING, *each]))


def filled(spans: IntArray, first: int, last: int) -> BoolArray:
    """Return whether each position from `first` to before `last` lies in a span.

    Args:
        spans: as `covered` returns them.
        first: a position.
        last: the one after the last.

    >>> filled(np.array([1, 3, 5, 9]), 2, 7)
    array([ True, False, False,  True,  True])
    """
    before, after = np.searchsorted(spans, [first, last]).tolist()
    bounds = np.concatenate([[first], spans[before:after], [last]])
    is_inside = np.zeros(len(bounds) - 1, dtype=bool)
    is_inside[1 - before % 2 :: 2] = True
    return np.repeat(is_inside, bounds[1:] - bounds[:-1])


def _joined(spans: IntArray) -> IntArray:
    """Return the same spans without overlaps, sorted."""
    begins, ends = np.sort(spans[::2]), np.sort(spans[1::2])
    # All spans that began have ended where the next one begins only after as many ends.
    is_apart = begins[1:] > ends[:-1]
    starts = np.concatenate([begins[:1], begins[1:][is_apart]])
    stops = np.concatenate([ends[:-1][is_apart], ends[-1:]])
    return np.column_stack([starts, stops]).ravel()


def _spans(area: BaseGeometry, shape: tuple[int, int], row: int, col: int) -> Iterator[IntArray]:
    """Yield spans that an area covers in a window, by parts; each as `covered` returns them."""
    height, width = shape
    for part in _parts(area):
        edges = _edges(part)
        has_inside = shapely.get_type_id(part) in _POLYGONS
        step = max(1, _AT_ONCE // max(1, len(edges)))
        of_rows = [_NOTHING]
        for begin in range(row, row + height, step):
            rows, x = _crossings(edges, begin, min(begin + step, row + height))
            places = _places(rows - row, x, width, col)
            if not has_inside:
                places = np.repeat(places, 2)
            places.sort()
            # From the first crossing to the second, and so on; two spans that meet in a position
            # overlap there.
            of_rows.append(np.maximum.accumulate(_from_to(places)))
        yield np.concatenate(of_rows)
        rows, x = _level(part, edges, row, row + height)
        if len(rows):
            yield _joined(_from_to(_places(np.repeat(rows - row, 2), x.ravel(), width, col)))


def _places(rows: IntArray, x: NDArray[np.float64], width: int, col: int) -> IntArray:
    """Return where points lie among the positions of a flattened window, twice.

    Even numbers lie on positions, odd ones between two, and off the window those before its first
    or after its last column. So they sort as the points do, as fast as whole numbers.
    """
    x = np.clip(np.round(x, _DECIMALS) - col, -0.5, width - 0.5)
    floor = np.floor(x)
    places: IntArray = 2 * (rows * width + floor.astype(np.int64)) + (x != floor)
    return places


def _from_to(places: IntArray) -> IntArray:
    """Return the spans from each even one of some places to the next, both included."""
    spans = places + 1
    spans[1::2] += 1
    return spans >> 1


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
    edges: NDArray[np.float64], low: int, high: int
) -> tuple[IntArray, NDArray[np.float64]]:
    """Return rows from `low` to before `high` and where edges cross them, not at upper ends."""
    first = np.clip(np.ceil(edges[:, 1]), low, high).astype(np.int64)
    counts = np.clip(np.ceil(edges[:, 3]), low, high).astype(np.int64) - first
    crossing = np.flatnonzero(counts)
    edges, first, counts = edges[crossing], first[crossing], counts[crossing]
    slope = (edges[:, 2] - edges[:, 0]) / (edges[:, 3] - edges[:, 1])
    steps = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    rows = np.repeat(first, counts) + steps
    x0, y0, slope = (np.repeat(values, counts) for values in (edges[:, 0], edges[:, 1], slope))
    return rows, x0 + (rows - y0) * slope


def _level(
    part: BaseGeometry, edges: NDArray[np.float64], low: int, high: int
) -> tuple[IntArray, NDArray[np.float64]]:
    """Return what crossings leave out: level edges, upper ends and points that lie on a row.

    Returns:
        Rows, shape (N,), and the least and the greatest x, shape (N, 2).
    """
    points = shapely.get_coordinates(part)
    x = np.concatenate([edges[:, [0, 2]], np.repeat(points[:, :1], 2, axis=1)])
    y = np.concatenate([edges[:, 3], points[:, 1]])
    is_level = np.concatenate([edges[:, 1] == edges[:, 3], np.ones(len(points), dtype=bool)])
    chosen = is_level & (y == np.floor(y)) & (y >= low) & (y < high)
    return y[chosen].astype(np.int64), np.sort(x[chosen], axis=1)
