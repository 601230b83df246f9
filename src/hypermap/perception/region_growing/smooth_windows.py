"""Planes through small windows of an image: compiled, and accurate on smooth surfaces.

There the k nearest points are about those of a square window, and depth is an affine function of
the pixel, up to errors far below the noise. So a few sums over the window give the plane.
"""

from __future__ import annotations

import numpy as np
from numba import uint64

from hypermap._loops import loop
from hypermap.perception.region_growing.padded import FAR, MARGIN

# A window shows a smooth surface if the root mean square distance of its points from their plane
# is at most this part of the radius of the k nearest: then these are about the window's points.
SMOOTH = 0.3
FACING = 0.4  # smallest cosine between the plane's normal and the ray; below, windows are too wide

# Unsigned: numba then knows that an index is not from the end, and loops use vector registers.
_BLOCK = uint64(64)  # pixels of a row processed at a time
_SIDE = uint64(16)  # pixels to each side that their windows may extend
_WIDTH = uint64(int(_BLOCK) + 2 * int(_SIDE))  # numpy 1 adds them to a float
_STEP = uint64(16)  # pixels of a row searched at a time for the next block
_TWO, _THREE, _FOUR = uint64(2), uint64(3), uint64(4)
# NaN and infinity keep their meaning.
_VECTORS = {"reassoc", "contract", "nsz", "arcp"}


@loop(allocates=True)
def fit_smooth(planes, wanted, k, half, fx, fy):  # type: ignore[no-untyped-def]
    """Do the same as `normals.fit_planes`, but only where the surface is smooth.

    Args:
        planes: the cloud with its margins, shape (3, H, W).
        wanted: pixels whose normal to compute, not in the margins, shape (H, W).
        k: how many points the radius should contain.
        half: as many items, up to 16, as windows have rows above and below their center, and
            columns to each side; the compiler unrolls loops over a tuple, as it knows the length.
        fx: focal length along rows [pixels].
        fy: focal length along columns [pixels].

    Returns:
        The result of `fit_planes`, not valid where the surface is not smooth, and the places
        where it is not, int32, increasing, shape (N,).
    """
    shape, stride = wanted.shape, wanted.shape[1]
    x, y, z, is_wanted = planes[0].ravel(), planes[1].ravel(), planes[2].ravel(), wanted.ravel()
    normals = np.empty((3, len(z)), np.float32)
    curvatures, radii2 = np.empty(len(z), np.float32), np.empty(len(z), np.float32)
    rough = np.empty(len(z), np.int32)
    count = uint64(0)
    columns, sums = np.empty(_THREE * _WIDTH, np.float32), np.empty(_FOUR * _BLOCK, np.float32)
    found, is_rough = np.empty((5, _BLOCK), np.float32), np.empty(_BLOCK, np.bool_)
    for row in range(MARGIN, shape[0] - MARGIN):
        start, end = uint64(row * stride + MARGIN), uint64((row + 1) * stride - MARGIN)
        while start < end:
            if not _any(is_wanted, start):
                start += _STEP
                continue
            middle = _depth_of(z, start)
            _sum_columns(z, middle, start - _SIDE, uint64(stride), half, columns)
            _sum_windows(columns, half, sums)
            _fit_windows(x, y, z, start, k, half, fx, fy, middle, sums, found.ravel(), is_rough)
            for axis in range(3):
                _copy(found[axis], normals[axis], start)
            _copy(found[3], curvatures, start)
            _copy(found[4], radii2, start)
            is_any = False
            for i in range(_BLOCK):
                is_rough[i] &= is_wanted[start + i]
                is_any |= is_rough[i]
            if is_any:
                for i in range(_BLOCK):
                    rough[count] = start + i
                    count += uint64(is_rough[i])
            start += _BLOCK
    normals = normals.reshape((3, *shape))
    return normals, curvatures.reshape(shape), radii2.reshape(shape), rough[:count].copy()


@loop()
def _any(is_wanted, start):  # type: ignore[no-untyped-def]
    """Return whether any of some pixels is wanted; unlike `any`, vectorized."""
    found = False
    for i in range(_STEP):
        found |= is_wanted[start + i]
    return found


@loop()
def _depth_of(z, start):  # type: ignore[no-untyped-def]
    """Return the depth of some point of a block; 0 if there is none."""
    for i in range(_BLOCK):
        if z[start + i] < FAR:
            return z[start + i]
    return np.float32(0)


@loop()
def _copy(found, out, start):  # type: ignore[no-untyped-def]
    """Write the values of a block into those of all pixels."""
    for i in range(uint64(len(found))):
        out[start + i] = found[i]


@loop(fastmath=_VECTORS, forceinline=True)
def _sum_columns(z, middle, first, stride, half, columns):  # type: ignore[no-untyped-def]
    """Sum up z, v z and zz over the columns of windows, with v and z relative to the middle.

    Args:
        z: of the cloud, with its margins.
        middle: a depth near those of the points, so that the squares stay precise.
        first: place of the first column's middle.
        stride: places from row to row.
        half: as in `fit_smooth`.
        columns: receives the sums, shape (3 * _WIDTH,).
    """
    for i in range(_WIDTH):
        at = first + i
        depth = z[at] - middle
        sum_z, sum_vz, sum_zz = depth, np.float32(0), depth * depth
        for row in range(len(half)):
            step = uint64(row + 1) * stride
            upper, lower = z[at - step] - middle, z[at + step] - middle
            sum_z += upper + lower
            sum_vz += np.float32(row + 1) * (lower - upper)
            sum_zz += upper * upper + lower * lower
        columns[i] = sum_z
        columns[i + _WIDTH] = sum_vz
        columns[i + _TWO * _WIDTH] = sum_zz


@loop(fastmath=_VECTORS, forceinline=True)
def _sum_windows(columns, half, sums):  # type: ignore[no-untyped-def]
    """Sum up z, u z, v z and zz over the windows around a block, with u from the middle.

    Args:
        columns: z, v z and zz of columns, shape (3 * _WIDTH,).
        half: as in `fit_smooth`.
        sums: receives the sums, shape (4 * _BLOCK,).
    """
    for i in range(_BLOCK):
        z, vz, zz = i + _SIDE, i + _SIDE + _WIDTH, i + _SIDE + _TWO * _WIDTH
        sum_z, sum_uz, sum_vz, sum_zz = columns[z], np.float32(0), columns[vz], columns[zz]
        for column in range(len(half)):
            step = uint64(column + 1)
            left, right = columns[z - step], columns[z + step]
            sum_z += left + right
            sum_uz += np.float32(column + 1) * (right - left)
            sum_vz += columns[vz - step] + columns[vz + step]
            sum_zz += columns[zz - step] + columns[zz + step]
        sums[i] = sum_z
        sums[i + _BLOCK] = sum_uz
        sums[i + _TWO * _BLOCK] = sum_vz
        sums[i + _THREE * _BLOCK] = sum_zz


@loop(fastmath=_VECTORS, forceinline=True)
def _fit_windows(x, y, z, start, k, half, fx, fy, middle, sums, found, is_rough):  # type: ignore[no-untyped-def]
    """Fit planes z = a u + b v + c to the square windows around a block of pixels.

    Args:
        x: of the cloud, with its margins.
        y: of the same.
        z: of the same.
        start: the first pixel's place.
        k: how many points the radius should contain.
        half: as in `fit_smooth`.
        fx: focal length along rows [pixels].
        fy: focal length along columns [pixels].
        middle: the depth that others are relative to.
        sums: of z, u z, v z and zz over the windows, shape (4 * _BLOCK,).
        found: receives normals, curvatures and squared radii, shape (5 * _BLOCK,).
        is_rough: receives whether the surface is not smooth, shape (_BLOCK,).
    """
    one, n = np.float32(1), np.float32((2 * len(half) + 1) ** 2)
    squares = n * np.float32(len(half) * (len(half) + 1) / 3)  # of u, or of v
    reach = k / (np.float32(np.pi) * fx * fy)
    for i in range(_BLOCK):
        place = start + i
        mean = sums[i] / n
        a, b = sums[i + _BLOCK] / squares, sums[i + _TWO * _BLOCK] / squares
        error = sums[i + _THREE * _BLOCK] / n - mean * mean - (a * a + b * b) * (squares / n)
        depth, nx, ny = mean + middle, a * fx, b * fy
        nz = -depth - (nx * x[place] + ny * y[place]) / z[place]
        length2 = nx * nx + ny * ny + nz * nz
        length = np.sqrt(length2)
        scale = one / length
        radius2 = reach * depth * length
        across = depth * scale  # cosine between the normal and the ray
        error = max(error, np.float32(0)) * across * across  # perpendicular to the plane
        is_rough[i] = not (
            (error <= np.float32(SMOOTH**2) * radius2)
            & (across >= np.float32(FACING))
            & (depth * n < FAR)  # no pixel without a point
        )
        found[i] = nx * scale
        found[i + _BLOCK] = ny * scale
        found[i + _TWO * _BLOCK] = nz * scale
        found[i + _THREE * _BLOCK] = error / (error + np.float32(0.5) * radius2)
        found[i + _FOUR * _BLOCK] = radius2
