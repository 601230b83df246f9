"""Which triangle is seen behind each pixel, and which points a lamp does not reach."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hypermap._loops import inner_loop, loop
from hypermap.core.arrays import IntArray

_CELLS = 256  # of the lamp's grid, per side
_LEVEL = 0.05  # of the lamp's height: what reaches so close to it is in no cell, but tried always


def nearest_triangles(
    triangles: NDArray[np.float32], projection: NDArray[np.float64], height: int, width: int
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Return the depth of the nearest triangle on the ray of each pixel, and which it is.

    Every triangle is drawn where it covers pixels' centers, and keeps those where it is nearest.
    Its corners p0, p1, p2, projected without division by their depth, and the ray (u, v, 1) decide
    both: the ray meets the triangle if it lies on the inner side of the three planes pi x pj
    through the camera, and so no triangle has to be cut at the camera's plane. Triangles that share
    an edge leave no gap, as the plane of one is exactly that of the other, turned over. [Olano and
    Greer, Triangle scan conversion using 2D homogeneous coordinates, 1997]

    Args:
        triangles: corners [m], shape (T, 3, 3).
        projection: K times camera_T_map, shape (3, 4).
        height: of the image [pixels].
        width: of the image [pixels].

    Returns:
        Depths along the optical axis [m], infinite where there is nothing, and rows of
        `triangles`, -1 where there is nothing; shapes (H, W).
    """
    depths = np.full((height, width), np.inf)
    found = np.full((height, width), -1, dtype=np.int32)
    p, planes = np.empty((3, 3)), np.empty((3, 3))
    _draw(triangles, projection, p, planes, depths, found)
    return depths, found


@loop()
def _draw(
    triangles: NDArray[np.float32],
    projection: NDArray[np.float64],
    p: NDArray[np.float64],
    planes: NDArray[np.float64],
    depths: NDArray[np.float64],
    found: NDArray[np.int32],
) -> None:
    """Do what `nearest_triangles` says, where no depth was found yet.

    Corners and planes of a triangle need room, shapes (3, 3).
    """
    height, width = depths.shape
    for i in range(len(triangles)):
        _project(triangles[i], projection, p)
        if p[0, 2] <= 0 and p[1, 2] <= 0 and p[2, 2] <= 0:
            continue  # behind the camera
        left, right, top, bottom = _bounds(p, width, height)
        if left > right or top > bottom:
            continue
        volume = _edge_planes(p, planes)
        if volume == 0:
            continue  # seen from its edge
        for v in range(top, bottom + 1):
            begin, end = _span(planes, v, left, right)
            if begin > end:
                continue
            c0 = planes[0, 1] * v + planes[0, 2]
            c1 = planes[1, 1] * v + planes[1, 2]
            c2 = planes[2, 1] * v + planes[2, 2]
            for u in range(int(begin), int(end) + 1):
                e0 = planes[0, 0] * u + c0
                e1 = planes[1, 0] * u + c1
                e2 = planes[2, 0] * u + c2
                if e0 >= 0 and e1 >= 0 and e2 >= 0:
                    whole = e0 + e1 + e2
                    if volume < whole * depths[v, u]:
                        depths[v, u] = volume / whole
                        found[v, u] = i


@inner_loop()
def _project(
    triangle: NDArray[np.float32], projection: NDArray[np.float64], p: NDArray[np.float64]
) -> None:
    """Project the corners of a triangle into `p`, without division by their depth."""
    for corner in range(3):
        x, y, z = triangle[corner, 0], triangle[corner, 1], triangle[corner, 2]
        for k in range(3):
            row = projection[k]
            p[corner, k] = row[0] * x + row[1] * y + row[2] * z + row[3]


@inner_loop()
def _bounds(p: NDArray[np.float64], width: int, height: int) -> tuple[int, int, int, int]:
    """Return the first and last column and row that a triangle may cover; all if it is cut."""
    left, right, top, bottom = 0, width - 1, 0, height - 1
    if p[0, 2] > 0 and p[1, 2] > 0 and p[2, 2] > 0:
        u0, u1, u2 = p[0, 0] / p[0, 2], p[1, 0] / p[1, 2], p[2, 0] / p[2, 2]
        v0, v1, v2 = p[0, 1] / p[0, 2], p[1, 1] / p[1, 2], p[2, 1] / p[2, 2]
        left = int(max(0.0, np.floor(min(u0, u1, u2))))
        right = int(min(width - 1.0, np.ceil(max(u0, u1, u2))))
        top = int(max(0.0, np.floor(min(v0, v1, v2))))
        bottom = int(min(height - 1.0, np.ceil(max(v0, v1, v2))))
    return left, right, top, bottom


@inner_loop()
def _edge_planes(p: NDArray[np.float64], planes: NDArray[np.float64]) -> float:
    """Fill in the planes pi x pj, positive inside, and return the volume that they span."""
    for k in range(3):
        a, b = p[(k + 1) % 3], p[(k + 2) % 3]
        planes[k, 0] = a[1] * b[2] - a[2] * b[1]
        planes[k, 1] = a[2] * b[0] - a[0] * b[2]
        planes[k, 2] = a[0] * b[1] - a[1] * b[0]
    volume: float = p[0, 0] * planes[0, 0] + p[0, 1] * planes[0, 1] + p[0, 2] * planes[0, 2]
    sign = 1.0 if volume > 0 else -1.0
    for k in range(3):
        for axis in range(3):
            planes[k, axis] *= sign
    return volume * sign


@inner_loop()
def _span(planes: NDArray[np.float64], v: int, left: int, right: int) -> tuple[float, float]:
    """Return the first and last pixel of a row between the edges, plus or minus a pixel."""
    begin, end = float(left), float(right)
    for k in range(3):
        slope, start = planes[k, 0], planes[k, 1] * v + planes[k, 2]
        if slope > 0:
            begin = max(begin, np.floor(-start / slope) - 1)
        elif slope < 0:
            end = min(end, np.ceil(-start / slope) + 1)
        elif start < 0:
            end = -1.0
    return begin, end


@dataclass(frozen=True, eq=False)
class Shadows:
    """What is between a lamp and points, by its place in the lamp's picture of the scene.

    The picture looks straight down and is divided in cells; each lists the triangles that may be
    seen there. What reaches up to the lamp is on no such picture and is tried for every point.

    Attributes:
        lamp: where it hangs [m], shape (3,).
        planes: of each triangle, through the lamp and two of its corners; the inner side is
            positive, shape (T, 3, 3).
        volumes: of each triangle: what a direction's three products with the planes add up to if
            it ends on the triangle, shape (T,).
        starts: where the list of each cell begins in `members`, row-major, and where the last one
            ends, shape (_CELLS ** 2 + 1,).
        members: triangles by cell.
        high: triangles that are tried for every point.
        low: where the cells begin, as x and y per meter below the lamp, shape (2,).
        size: of a cell, likewise, shape (2,).
    """

    lamp: NDArray[np.float64]
    planes: NDArray[np.float64]
    volumes: NDArray[np.float64]
    starts: IntArray
    members: IntArray
    high: IntArray
    low: NDArray[np.float64]
    size: NDArray[np.float64]

    @classmethod
    def of(cls, triangles: NDArray[np.float32], lamp: NDArray[np.float32]) -> Shadows:
        """Return the shadows that triangles cast, shape (T, 3, 3)."""
        p = triangles.astype(np.float64) - lamp
        planes = np.cross(np.roll(p, -1, axis=1), np.roll(p, -2, axis=1))
        volumes = np.einsum("ij,ij->i", p[:, 0], planes[:, 0])
        planes *= np.sign(volumes)[:, np.newaxis, np.newaxis]

        is_below = p[..., 2].max(axis=1) < -_LEVEL * float(lamp[2])
        below = np.flatnonzero(is_below & (volumes != 0))
        seen = p[below, :, :2] / -p[below, :, 2:]
        corners = seen.reshape(-1, 2)
        low = corners.min(axis=0, initial=np.inf) if len(corners) else np.zeros(2)
        high = corners.max(axis=0, initial=-np.inf) if len(corners) else np.ones(2)
        size = np.maximum(high - low, 1e-6) / (_CELLS - 1)
        first = ((seen.min(axis=1) - low) // size).astype(np.int64)
        counts = ((seen.max(axis=1) - low) // size).astype(np.int64) - first + 1
        cells, members = _rectangles(first, counts)
        order = np.argsort(cells, kind="stable")
        return cls(
            lamp.astype(np.float64),
            planes,
            np.abs(volumes),
            np.searchsorted(cells[order], np.arange(_CELLS**2 + 1)),
            below[members[order]],
            np.flatnonzero(~is_below & (volumes != 0)),
            low,
            size,
        )

    def cover(self, points: NDArray[np.float32]) -> NDArray[np.bool_]:
        """Return which points something hides from the lamp, shape (N,); points: shape (N, 3)."""
        covered = np.zeros(len(points), dtype=bool)
        _cover(
            covered,
            points,
            self.lamp,
            self.planes,
            self.volumes,
            self.starts,
            self.members,
            self.high,
            self.low,
            self.size,
        )
        return covered


def _rectangles(first: IntArray, counts: IntArray) -> tuple[IntArray, IntArray]:
    """Return the cells of rectangles of cells, and which rectangle each is of."""
    totals = counts[:, 0] * counts[:, 1]
    owners = np.repeat(np.arange(len(totals)), totals)
    places = np.arange(totals.sum()) - np.repeat(np.cumsum(totals) - totals, totals)
    rows, columns = np.divmod(places, counts[owners, 0])
    return (first[owners, 1] + rows) * _CELLS + first[owners, 0] + columns, owners


@loop()
def _cover(covered, points, lamp, planes, volumes, starts, members, high, low, size):  # type: ignore[no-untyped-def]
    for i in range(len(points)):
        dx, dy, dz = points[i, 0] - lamp[0], points[i, 1] - lamp[1], points[i, 2] - lamp[2]
        begin, end = 0, 0
        if dz < 0:
            column = np.floor((dx / -dz - low[0]) / size[0])
            row = np.floor((dy / -dz - low[1]) / size[1])
            if 0 <= column < _CELLS and 0 <= row < _CELLS:
                cell = int(row) * _CELLS + int(column)
                begin, end = starts[cell], starts[cell + 1]
        for k in range(end - begin + len(high)):
            j = members[begin + k] if k < end - begin else high[k - (end - begin)]
            e0 = planes[j, 0, 0] * dx + planes[j, 0, 1] * dy + planes[j, 0, 2] * dz
            e1 = planes[j, 1, 0] * dx + planes[j, 1, 1] * dy + planes[j, 1, 2] * dz
            e2 = planes[j, 2, 0] * dx + planes[j, 2, 1] * dy + planes[j, 2, 2] * dz
            if e0 >= 0 and e1 >= 0 and e2 >= 0 and e0 + e1 + e2 > volumes[j]:
                covered[i] = True
                break
