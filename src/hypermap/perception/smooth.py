"""Planes through small windows of an image: compiled, and good where a surface is smooth.

There the k nearest points are about those of a square window, and depth is an affine function of
the pixel but for what is far below the noise. So a few sums over the window give the plane.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, uint64

from hypermap.perception.padded import FAR, MARGIN

# A window shows a smooth surface if its points lie from their plane by at most this part of the
# radius of the k nearest, in the root mean square: then these are about the window's points.
SMOOTH = 0.3
FACING = 0.4  # least cosine between the plane's normal and the ray; else the window is too wide

_BLOCK = 64  # pixels of a row that are done together
# What lets loops use vector registers; NaN and infinity keep their meaning.
_VECTORS = {"reassoc", "contract", "nsz", "arcp"}


@njit(cache=True, error_model="numpy")
def fit_smooth(planes, wanted, k, fx, fy):  # type: ignore[no-untyped-def]
    """Do what `normals.fit_planes` does, but only where the surface is smooth.

    Its windows hold the odd square number of points next to k.

    Returns:
        What `fit_planes` returns, without a meaning where the surface is not smooth, and the places
        where it is not, int32, increasing, shape (N,).
    """
    half = max(round((math.sqrt(k) - 1) / 2), 1)
    shape, stride = wanted.shape, wanted.shape[1]
    x, y, z, is_wanted = planes[0].ravel(), planes[1].ravel(), planes[2].ravel(), wanted.ravel()
    normals = np.empty((3, len(z)), np.float32)
    curvatures, radii2 = np.empty(len(z), np.float32), np.empty(len(z), np.float32)
    rough = np.empty(len(z), np.int32)
    count = 0
    columns, sums = np.empty(6 * _BLOCK, np.float32), np.empty(4 * _BLOCK, np.float32)
    found = np.empty(6 * _BLOCK, np.float32)
    for row in range(MARGIN, shape[0] - MARGIN):
        for start in range(row * stride + MARGIN, (row + 1) * stride - MARGIN, _BLOCK):
            is_any = False  # `any` would not look at many at once
            for i in range(uint64(_BLOCK)):
                is_any |= is_wanted[uint64(start) + i]
            if not is_any:
                continue
            _fit_windows(x, y, z, stride, start, k, half, fx, fy, columns, sums, found)
            end = start + _BLOCK
            for axis in range(3):
                normals[axis, start:end] = found[axis * _BLOCK : (axis + 1) * _BLOCK]
            curvatures[start:end] = found[3 * _BLOCK : 4 * _BLOCK]
            radii2[start:end] = found[4 * _BLOCK : 5 * _BLOCK]
            for i in range(_BLOCK):
                rough[count] = start + i
                count += is_wanted[start + i] & (found[i + 5 * _BLOCK] == 0)
    normals = normals.reshape((3, *shape))
    return normals, curvatures.reshape(shape), radii2.reshape(shape), rough[:count].copy()


@njit(cache=True, error_model="numpy", fastmath=_VECTORS)
def _fit_windows(x, y, z, stride, start, k, half, fx, fy, columns, sums, found):  # type: ignore[no-untyped-def]
    """Fit planes z = a u + b v + c to the square windows around a block of pixels.

    Args:
        x: of the cloud, with its margins.
        y: of the same.
        z: of the same.
        stride: places from row to row.
        start: the first pixel's place.
        k: how many points the radius is meant to hold.
        half: rows and columns of a window above, below and beside its middle.
        fx: focal length along rows [pixels].
        fy: focal length along columns [pixels].
        columns: room for sums of columns, shape (6 * _BLOCK,).
        sums: room for sums of windows, shape (4 * _BLOCK,).
        found: receives the normals, the curvature, the squared radius, and 1 where the surface is
            smooth, else 0, shape (6 * _BLOCK,).
    """
    one, n = np.float32(1), np.float32((2 * half + 1) ** 2)
    middle = np.float32(0)  # depths are counted from there, so that their squares stay precise
    for i in range(_BLOCK):
        if z[start + i] < FAR:
            middle = z[start + i]
            break
    # Of the windows' columns: z, v z and zz, from the middle outwards.
    first = uint64(start - half)
    width = uint64(_BLOCK + 2 * half)
    for i in range(width):
        depth = z[first + i] - middle
        columns[i] = depth
        columns[i + 2 * _BLOCK] = 0
        columns[i + 4 * _BLOCK] = depth * depth
    for row in range(1, half + 1):
        above, below = first - uint64(row * stride), first + uint64(row * stride)
        v = np.float32(row)
        for i in range(width):
            upper, lower = z[above + i] - middle, z[below + i] - middle
            columns[i] += upper + lower
            columns[i + 2 * _BLOCK] += v * (lower - upper)
            columns[i + 4 * _BLOCK] += upper * upper + lower * lower
    # Of the windows: z, u z, v z and zz.
    for i in range(uint64(_BLOCK)):
        column = i + uint64(half)
        sums[i] = columns[column]
        sums[i + _BLOCK] = 0
        sums[i + 2 * _BLOCK] = columns[column + 2 * _BLOCK]
        sums[i + 3 * _BLOCK] = columns[column + 4 * _BLOCK]
    for step in range(1, half + 1):
        u = np.float32(step)
        for i in range(uint64(_BLOCK)):
            left, right = i + uint64(half - step), i + uint64(half + step)
            sums[i] += columns[left] + columns[right]
            sums[i + _BLOCK] += u * (columns[right] - columns[left])
            sums[i + 2 * _BLOCK] += columns[left + 2 * _BLOCK] + columns[right + 2 * _BLOCK]
            sums[i + 3 * _BLOCK] += columns[left + 4 * _BLOCK] + columns[right + 4 * _BLOCK]
    squares = n * np.float32(half * (half + 1) / 3)  # of u, or of v
    reach = k / (np.float32(np.pi) * fx * fy)
    for i in range(uint64(_BLOCK)):
        place = uint64(start) + i
        mean = sums[i] / n
        a, b = sums[i + _BLOCK] / squares, sums[i + 2 * _BLOCK] / squares
        error = sums[i + 3 * _BLOCK] / n - mean * mean - (a * a + b * b) * (squares / n)
        depth, nx, ny = mean + middle, a * fx, b * fy
        nz = -depth - (nx * x[place] + ny * y[place]) / z[place]
        length2 = nx * nx + ny * ny + nz * nz
        length = np.sqrt(length2)
        radius2 = reach * depth * length
        error = max(error, np.float32(0)) * depth * depth / length2  # at right angles to the plane
        is_smooth = (
            (error <= np.float32(SMOOTH**2) * radius2)
            & (depth >= np.float32(FACING) * length)
            & (depth * n < FAR)  # no pixel without a point
        )
        scale = one / length
        found[i] = nx * scale
        found[i + _BLOCK] = ny * scale
        found[i + 2 * _BLOCK] = nz * scale
        found[i + 3 * _BLOCK] = error / (error + np.float32(0.5) * radius2)
        found[i + 4 * _BLOCK] = radius2
        found[i + 5 * _BLOCK] = one if is_smooth else np.float32(0)
