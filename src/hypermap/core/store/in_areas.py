"""The objects that intersect an area."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import BoolArray, IntArray
from hypermap.core.shapes import as_area, box_of
from hypermap.core.store.snapshot import Snapshot

Box = tuple[float, float, float, float]  # x0, y0, x1, y1

_FEW = 12  # fewer shapes are not worth preparing an area for
_MANY = 64  # from so many shapes on, testing their boxes first is worth it


def meeting(now: Snapshot, area: BaseGeometry, code: int | None = None) -> IntArray:
    """Return the rows of the objects that meet an area, in the order of the layer.

    Args:
        now: the objects.
        area: in the layer's frame.
        code: only objects with this name's code; None for all.
    """
    log, box = now.log, box_of(area)
    # For a box, the envelope is a copy like that of `as_area`, in a third of the time.
    asked = as_area(area) if box is None else area.envelope
    near = None if box is None else _near(now, box)
    if near is not None:
        return now.in_order(np.array(_few_meeting(now, asked, near, code), dtype=np.int64))
    if asked.is_empty:
        return np.empty(0, dtype=np.int64)
    rows = log.tree.query(asked)
    rows.sort()
    if now.count > log.first:
        behind = log.written.index.meeting(*asked.bounds, now.count - log.first)
        rows = np.concatenate([rows, behind + log.first])
    if code is not None:
        rows = rows[now.column("codes", rows) == code]
    rows = now.there(rows)
    return now.in_order(rows[_meet(now, asked, box, rows)])


def all_at(now: Snapshot, point_xy: NDArray[np.float64]) -> IntArray:
    """Return the rows of all objects at a point of shape (2,), the smallest first."""
    rows = meeting(now, shapely.Point(point_xy))
    return rows[np.argsort(now.column("areas", rows), kind="stable")]


def _near(now: Snapshot, box: Box) -> list[int] | None:
    """Return the rows whose boxes meet a small box, ascending; None if it is not small."""
    log = now.log
    rows = log.grid.meeting(*box)
    if rows is not None and now.count > log.first:
        behind = log.written.index.meeting(*box, now.count - log.first)
        rows += (behind + log.first).tolist()
    return rows


def _few_meeting(now: Snapshot, area: BaseGeometry, rows: list[int], code: int | None) -> list[int]:
    """Return which of some rows exist, have a name's code, and meet an area."""
    log = now.log
    if now.changes:
        rows = [row for row in rows if log.all_ended[row] > now.changes]
    if code is not None:
        rows = [row for row in rows if log.code(row) == code]
    return [row for row in rows if area.intersects(log.shape(row))]


def _meet(now: Snapshot, area: BaseGeometry, box: Box | None, rows: IntArray) -> BoolArray:
    """Return which rows' shapes meet an area; their boxes do."""
    if len(rows) < (_FEW if box is None else _MANY):
        return np.asarray(shapely.intersects(area, now.column("shapes", rows)))
    shapely.prepare(area)  # a copy that no other thread has
    if box is not None:
        x0, y0, x1, y1 = now.column("boxes", rows).T
        left, low, right, high = box
        meets = (left <= x0) & (x1 <= right) & (low <= y0) & (y1 <= high)
    else:
        meets = rows < now.log.first
        corners = now.log.outlines.first_corners(rows[meets])
        meets[meets] = shapely.intersects_xy(area, corners)
    meets[~meets] = shapely.intersects(area, now.column("shapes", rows[~meets]))
    return np.asarray(meets)
