"""The integer cells that an area covers, as spans in rows.

Source: the scan-line polygon fill of Foley et al., "Computer Graphics: Principles and Practice",
2nd edition, section 3.6, with the boundary included on every side.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import BoolArray, FloatArray, IntArray

_DECIMALS = 6  # of a cell; smaller lengths are ignored
_NOTHING: IntArray = np.empty(0, dtype=np.int32)
_AT_ONCE = 1 << 20  # crossings of edges and rows held in memory at a time


@dataclass(frozen=True)
class _Window:
    """A window of rows and columns; element (r, c) is at (x, y) = (col + c, row + r)."""

    height: int
    width: int
    row: int
    col: int

    def positions(self, rows: FloatArray, x: FloatArray) -> IntArray:
        """Return the elements at integer coordinates, as positions in the flattened window, (N,).

        Points left or right of the window, however far, count as the begin or end of their row.
        """
        places = x - self.col
        np.minimum(np.maximum(places, 0, out=places), self.width, out=places)
        starts = rows - self.row
        starts *= self.width
        places += starts
        return places.astype(np.int32 if self.height * self.width < 2**31 else np.int64)


@dataclass(frozen=True, eq=False)
class Outline:
    """The lines of a part of an area.

    Attributes:
        points: their corners, x and y, shape (N, 2).
        is_edge: whether an edge connects each corner to the next, shape (N - 1,).
        has_inside: whether the inside of the lines belongs to the area.
    """

    points: FloatArray
    is_edge: BoolArray
    has_inside: bool


def outlines(area: BaseGeometry) -> list[Outline]:
    """Return the outlines of the parts of an area; none if it is empty."""
    if isinstance(area, shapely.GeometryCollection) and area.geom_type == "GeometryCollection":
        return [outline for part in area.geoms for outline in outlines(part)]
    lines = area if isinstance(area, shapely.Polygon) else shapely.get_parts(area)
    has_inside = isinstance(area, shapely.Polygon | shapely.MultiPolygon)
    if has_inside:
        lines = shapely.get_rings(lines)
    points, owners = shapely.get_coordinates(lines, return_index=True)
    return [Outline(points, owners[:-1] == owners[1:], has_inside)] if len(points) else []


def covered(area: Sequence[Outline], shape: tuple[int, int], row: int, col: int) -> IntArray:
    """Return which integer points an area covers, as spans; its boundary counts.

    Args:
        area: the outlines of a valid geometry of any type.
        shape: rows and columns of a window; its element (r, c) is at (x, y) =
            (col + c, row + r).
        row: of the first element.
        col: of the first element.

    Returns:
        Begin and end of each span of covered elements, alternating and never descending, as
        positions in the flattened window. Spans may be empty; each is within one row.
    """
    window = _Window(*shape, row, col)
    each = [spans for outline in area for spans in _spans(outline, window) if len(spans)]
    return each[0] if len(each) == 1 else _joined(np.concatenate([_NOTHING, *each]))


def filled(spans: IntArray, count: int) -> BoolArray:
    """Return whether each position from 0 up to, not including, `count` is in a span.

    Args:
        spans: as `covered` returns them.
        count: of positions.

    >>> filled(np.array([1, 3, 5, 6]), 7)
    array([False,  True,  True, False, False,  True, False])
    """
    bounds = np.concatenate([[0], spans, [count]])
    is_inside = np.zeros(len(bounds) - 1, dtype=bool)
    is_inside[1::2] = True
    return np.repeat(is_inside, bounds[1:] - bounds[:-1])


def _joined(spans: IntArray) -> IntArray:
    """Return the same spans without overlaps, sorted."""
    begins, ends = np.sort(spans[::2]), np.sort(spans[1::2])
    # A merged span ends where as many spans have ended as have begun.
    is_apart = begins[1:] >= ends[:-1]
    starts = np.concatenate([begins[:1], begins[1:][is_apart]])
    stops = np.concatenate([ends[:-1][is_apart], ends[-1:]])
    return np.column_stack([starts, stops]).ravel()


def _spans(outline: Outline, window: _Window) -> Iterator[IntArray]:
    """Yield spans that together cover a part of an area, each as `covered` returns them."""
    ends = outline.points[:-1], outline.points[1:]
    edges = np.concatenate([points[outline.is_edge] for points in ends], axis=1)
    rows_of_window = window.row, window.row + window.height
    inside, on_boundary = [_NOTHING], [_level(outline.points, edges, *rows_of_window)]
    for rows, x in _crossings(edges, *rows_of_window):
        below = np.floor(x)
        on_place = np.flatnonzero(x == below)
        on_boundary.append(np.column_stack([rows[on_place], x[on_place], x[on_place]]))
        if outline.has_inside:
            # From after the first crossing to after the second, and so on.
            below += 1
            crossed = window.positions(rows, below)
            crossed.sort()
            inside.append(crossed)
    yield np.concatenate(inside)
    rows, x0, x1 = np.concatenate(on_boundary).T
    if len(rows):
        bounds = window.positions(rows, np.ceil(x0)), window.positions(rows, np.floor(x1) + 1)
        yield _joined(np.column_stack(bounds).ravel())


def _crossings(edges: FloatArray, low: int, high: int) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Yield rows from `low` to before `high` and where edges cross them, upper ends excluded."""
    x0, y0, x1, y1 = edges.T
    first, past = np.clip(np.ceil([np.minimum(y0, y1), np.maximum(y0, y1)]), low, high)
    crossing = np.flatnonzero(first < past)
    first, past = first[crossing], past[crossing]
    x0, y0, x1, y1 = edges[crossing].T
    slope = (x1 - x0) / (y1 - y0)
    is_much = (past - first).sum() > _AT_ONCE
    step = max(1, _AT_ONCE // len(crossing) if is_much else high - low)
    for begin in range(low, high, step):
        starts, stops = np.clip([first, past], begin, begin + step)
        counts = (stops - starts).astype(np.intp)
        rows = np.repeat(starts - (np.cumsum(counts) - counts), counts)
        rows += np.arange(len(rows))
        x = rows - np.repeat(y0, counts)
        x *= np.repeat(slope, counts)
        x += np.repeat(x0, counts)
        yield rows, np.round(x, _DECIMALS, out=x)


def _level(points: FloatArray, edges: FloatArray, low: int, high: int) -> FloatArray:
    """Return what crossings miss: level edges, and corners, on rows.

    Returns:
        Row, least x and greatest x, shape (N, 3).
    """
    y = points[:, 1]
    corners = points[(y == np.floor(y)) & (y >= low) & (y < high)]
    if not len(corners):
        return np.empty((0, 3))
    y = edges[:, 1]
    level = edges[(y == edges[:, 3]) & (y == np.floor(y)) & (y >= low) & (y < high)]
    lines = np.column_stack([level[:, 1], np.sort(level[:, ::2], axis=1)])
    return np.concatenate([corners[:, [1, 0, 0]], lines])
