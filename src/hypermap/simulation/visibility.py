"""Which triangle is seen behind each pixel, and which points a lamp does not reach."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hypermap._loops import loop
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
    x, y, z = (triangles[..., axis].astype(np.float64) for axis in range(3))
    p = np.stack([row[0] * x + row[1] * y + row[2] * z + row[3] for row in projection], axis=-1)
    planes = _cross(np.roll(p, -1, axis=1), np.roll(p, -2, axis=1))
    volumes = (p[:, 0] * planes[:, 0]).cumsum(axis=1)[:, -1]
    planes *= np.sign(volumes)[:, np.newaxis, np.newaxis]
    is_before = p[..., 2] > 0
    with np.errstate(all="ignore"):  # what reaches behind the camera may be seen in any pixel
        at = p[..., :2] / p[..., 2:]
    is_whole = is_before.all(axis=1)[:, np.newaxis]
    last = np.array([width, height]) - 1.0
    low = np.where(is_whole, np.clip(np.floor(at.min(axis=1)), 0, last + 1), 0)
    high = np.where(is_whole, np.clip(np.ceil(at.max(axis=1)), -1, last), last)
    ends = np.concatenate([low, high], axis=1).astype(np.int64)
    # Not what is behind the camera, or beside the image, or seen from its edge.
    seen = is_before.any(axis=1) & (low <= high).all(axis=1) & (volumes != 0)
    _draw(np.flatnonzero(seen), ends, planes, np.abs(volumes), depths, found)
    return depths, found


def _cross(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the cross products of vectors, shape (..., 3)."""
    ax, ay, az, bx, by, bz = (v[..., axis] for v in (a, b) for axis in range(3))
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=-1)


@loop()
def _draw(
    seen: IntArray,
    ends: IntArray,
    planes: NDArray[np.float64],
    volumes: NDArray[np.float64],
    depths: NDArray[np.float64],
    found: NDArray[np.int32],
) -> None:
    """Draw triangles where they are nearer than what was found yet.

    Args:
        seen: which of T triangles.
        ends: first column and row, and last column and row of each, shape (T, 4).
        planes: of each, through the camera and two of its corners, shape (T, 3, 3).
        volumes: of each: the product of its depth in a pixel and the sum of the distances from
            its planes there, shape (T,).
        depths: of what was found yet, infinite for nothing, shape (H, W).
        found: which triangle that is, shape (H, W).
    """
    for i in seen:
        plane, volume = planes[i], volumes[i]
        a0, a1, a2 = plane[0, 0], plane[1, 0], plane[2, 0]
        for v in range(ends[i, 1], ends[i, 3] + 1):
            c0 = plane[0, 1] * v + plane[0, 2]
            c1 = plane[1, 1] * v + plane[1, 2]
            c2 = plane[2, 1] * v + plane[2, 2]
            for u in range(ends[i, 0], ends[i, 2] + 1):
                e0, e1, e2 = a0 * u + c0, a1 * u + c1, a2 * u + c2
                if e0 >= 0 and e1 >= 0 and e2 >= 0:
                    whole = e0 + e1 + e2
                    if volume < whole * depths[v, u]:
                        depths[v, u] = volume / whole
                        found[v, u] = i


@dataclass(frozen=True, eq=False)
class Shadows:
    """What stands between a lamp and points, by where it lies on the lamp's picture of the scene.

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
        low: where the cells begin, as x and y per metre below the lamp, shape (2,).
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
