"""The objects with a name or id, in an area or anywhere, and the nearest of them."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import IntArray
from hypermap.core.store.in_areas import meeting
from hypermap.core.store.snapshot import NOWHERE, Snapshot

_NO_NAME = -1  # no row has this code
_MANY = 64  # from more shapes on, testing their boxes first is worth it
_ROUNDING = 1 + 1e-9  # more than rounding can change a distance


def having_any(now: Snapshot, names: Iterable[str], area: BaseGeometry | None) -> IntArray:
    """Return the rows of objects with one of some names, in an area or anywhere, in order."""
    each = [having(now, name, area) for name in dict.fromkeys(names)]
    if len(each) == 1:
        return each[0]
    return now.in_order(np.sort(np.concatenate([np.empty(0, dtype=np.int64), *each])))


def having(now: Snapshot, what: str | float, area: BaseGeometry | None = None) -> IntArray:
    """Return the rows of the objects with a name or id, in an area or anywhere, in order."""
    if area is not None and isinstance(what, str):
        return meeting(now, area, now.log.codes.get(what, _NO_NAME))
    if isinstance(what, str):
        return now.in_order(now.there(_rows_of_name(now, what)))
    row = now.row_of_id(int(what)) if what == what // 1 else NOWHERE
    rows = np.array([row] if row >= 0 else [], dtype=np.int64)
    return rows if area is None else np.intersect1d(rows, meeting(now, area))


def _rows_of_name(now: Snapshot, name: str) -> IntArray:
    code = now.log.codes.get(name, _NO_NAME)
    rows, first = now.log.table_rows_of(code), now.log.first
    if now.count == first:
        return rows
    behind = np.flatnonzero(now.log.written.codes[: now.count - first] == code)
    return np.concatenate([rows, behind + first])


def nearest(
    now: Snapshot, what: str | float, point_xy: NDArray[np.float64], k: int
) -> tuple[IntArray, NDArray[np.float64]]:
    """Return the k rows with a name or id that are nearest to a point of shape (2,).

    Returns:
        Rows and distances [m], both of shape (K,), nearest first, ties by the distance
        to the centroid.
    """
    rows = having(now, what)
    if len(rows) > max(k, _MANY):
        rows = _candidates(now, rows, point_xy, k)
    distances = _distances(now, rows, point_xy)
    away = now.column("centroids", rows) - point_xy
    to_centroids = np.hypot(away[:, 0], away[:, 1])
    order = np.lexsort((to_centroids, distances))[:k]
    return rows[order], distances[order]


def _candidates(now: Snapshot, rows: IntArray, point_xy: NDArray[np.float64], k: int) -> IntArray:
    """Return the rows, of more than k, that may be among the k nearest.

    Their boxes are no farther than the farthest of the k shapes whose boxes are the nearest.
    """
    x, y = point_xy
    x0, y0, x1, y1 = now.column("boxes", rows).T
    to_boxes = np.hypot(
        np.maximum(0, np.maximum(x0 - x, x - x1)), np.maximum(0, np.maximum(y0 - y, y - y1))
    )
    first = rows[np.argpartition(to_boxes, k - 1)[:k]]
    farthest = _distances(now, first, point_xy).max()
    return np.asarray(rows[to_boxes <= farthest * _ROUNDING])


def _distances(now: Snapshot, rows: IntArray, point_xy: NDArray[np.float64]) -> NDArray[np.float64]:
    shapes, point = now.column("shapes", rows), shapely.points(point_xy)
    with np.errstate(all="ignore"):  # GEOS divides by the lengths of edges without length
        return np.asarray(shapely.distance(shapes, point))
