"""The areas that frames have seen, with rounded points."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap._loops import loop
from hypermap.core.arrays import as_objects
from hypermap.mapping.prepared_polygon import PreparedPolygon
from hypermap.perception.depth_view import ground_ring
from hypermap.perception.observation import Observation

_STEPS = 4096  # per meter; points are rounded to such steps, and take a quarter of the space


def seen_areas(
    observations: Sequence[Observation], abstain: Literal["hidden", "outside"]
) -> list[PreparedPolygon]:
    """Return the area that each frame has seen.

    Args:
        observations: the frames.
        abstain: as in `evidence_from`.
    """
    return _prepared([_seen_area(each, abstain) for each in observations])


def _seen_area(
    each: Observation, abstain: Literal["hidden", "outside"]
) -> PreparedPolygon | BaseGeometry:
    """Return an area that is rounded already, or one that is not."""
    view = each.view
    if abstain != "hidden" or view is None or not view.is_level:
        return each.visible_area
    ring = ground_ring(view)
    if ring is not None and len(ring) and _round_ground(ring, view.map_T_camera, _STEPS):
        return PreparedPolygon.of_ring(ring)
    return view.ground


def _prepared(areas: Sequence[PreparedPolygon | BaseGeometry]) -> list[PreparedPolygon]:
    """Return areas, of which geometries are rounded, too, unless that makes them invalid."""
    exact = as_objects(area for area in areas if not isinstance(area, PreparedPolygon))
    rounded = shapely.transform(exact, lambda xy: np.round(xy * _STEPS) / _STEPS)
    others = iter(PreparedPolygon.all_of(list(np.where(shapely.is_valid(rounded), rounded, exact))))
    return [area if isinstance(area, PreparedPolygon) else next(others) for area in areas]


@loop()
def _round_ground(ring: NDArray[np.float64], map_T_camera: NDArray[np.float64], steps: int) -> bool:
    """Round a ring of `ground_ring`, and return whether it is surely valid, as nearly all are.

    Seen from the camera, the ends of the rays and the circle must still turn one way, column by
    column, by less than half a turn; and the edges between the ends must pass outside of the
    circle. Then none crosses another.

    Args:
        ring: rounded in place [m], shape (2 W + 1, 2).
        map_T_camera: of its view, shape (4, 4).
        steps: per meter.
    """
    for p in range(len(ring)):
        for axis in range(2):
            ring[p, axis] = np.rint(ring[p, axis] * steps) / steps
    # Differences of rounded numbers, and their cross products, are exact.
    x, y = np.rint(map_T_camera[0, 3] * steps) / steps, np.rint(map_T_camera[1, 3] * steps) / steps
    last, radius_2 = len(ring) // 2 - 1, 0.0
    for p in range(last + 1, len(ring) - 1):
        radius_2 = max(radius_2, (ring[p, 0] - x) ** 2 + (ring[p, 1] - y) ** 2)
    x0, y0 = ring[0, 0] - x, ring[0, 1] - y
    side = np.sign(x0 * (ring[last, 1] - y) - y0 * (ring[last, 0] - x))
    is_valid = side != 0
    for col in range(last):
        here, back = col + 1, 2 * last - col
        ax, ay, bx, by = ring[col, 0] - x, ring[col, 1] - y, ring[here, 0] - x, ring[here, 1] - y
        cx, cy = ring[back + 1, 0] - x, ring[back + 1, 1] - y
        dx, dy = ring[back, 0] - x, ring[back, 1] - y
        turn = side * (ax * by - ay * bx)
        is_valid &= turn > 0 and side * (cx * dy - cy * dx) > 0
        is_valid &= side * (ax * dy - ay * dx) > 0 and side * (cx * by - cy * bx) > 0
        is_valid &= side * (x0 * by - y0 * bx) > 0 and side * (x0 * dy - y0 * dx) > 0
        # The nearest point of the edge is one of its ends, or below the camera.
        ex, ey = bx - ax, by - ay
        is_valid &= min(ax * ax + ay * ay, bx * bx + by * by) > radius_2
        ends_nearest = (ax * ex + ay * ey) * (bx * ex + by * ey) >= 0
        is_valid &= ends_nearest or turn * turn > radius_2 * (ex * ex + ey * ey)
    return bool(is_valid)
