"""Compiled search for the nearest points around a pixel, and the plane through them.

The cloud is held as three planes, x, y and z, of the image with a margin around it; a place is an
index into a plane, counted row by row. A pixel without a point, and every pixel of the margin,
holds `FAR`: so windows need no clipping, and such a pixel is never among the nearest.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, uint64
from numpy.typing import NDArray

from hypermap.core.arrays import BoolArray, IntArray

FAR = np.float32(1e6)
UNREACHED = np.float32(1e5)  # less than the distance to FAR, more than any real one
TIE = np.float32(1e-5)  # squared distances that differ by a smaller part rank alike

# Windows around a pixel, tried one after the other: rows above and below the pixel, and columns.
# Columns come in whole vector registers: columns / 2 - 1 to the left, columns / 2 to the right.
WINDOWS = np.array([[5, 16], [7, 16], [15, 32], [31, 64]])
MARGIN = 32
LARGEST = 64 * 64  # room for the points of any window

# What lets sums be computed in vector registers; NaN and infinity keep their meaning.
_VECTORS = {"reassoc", "contract", "nsz", "arcp"}


def planes_of(points: NDArray[np.float32], valid: BoolArray) -> NDArray[np.float32]:
    """Return an organised cloud (H, W, 3) as planes with margins, (3, H + 64, W + 64)."""
    height, width = valid.shape
    planes = np.full((3, height + 2 * MARGIN, width + 2 * MARGIN), FAR)
    inner = planes[:, MARGIN : MARGIN + height, MARGIN : MARGIN + width]
    np.copyto(inner, np.moveaxis(points, -1, 0), where=valid)
    return planes


@njit(cache=True)
def fit_planes(
    planes: NDArray[np.float32], places: IntArray, k: int, k_region: int, pitch: float
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
    """Fit a plane to the k points nearest to each of some points.

    Args:
        planes: the cloud with its margins, shape (3, H, W).
        places: where there is a point whose normal is wanted, shape (N,).
        k: how many neighbours, the point itself included.
        k_region: another number of neighbours, up to k.
        pitch: least distance between the rays of neighbouring pixels, per metre of depth.

    Returns:
        Unit normals of either sign, shape (H * W, 3); curvatures from 0 (flat) to 1/3, shape
        (H * W,); and squared distances to the k_region-th nearest point, shape (H * W,). All are
        zero but at the places asked for.
    """
    stride = planes.shape[2]
    x, y, z = planes[0].ravel(), planes[1].ravel(), planes[2].ravel()
    normals = np.zeros((len(x), 3), np.float32)
    curvatures = np.zeros(len(x), np.float32)
    region_radii2 = np.zeros(len(x), np.float32)
    distances2 = np.empty(LARGEST, np.float32)
    for place in places:
        radius2, window = nearest(x, y, z, stride, place, k, pitch, distances2)
        covariance = _covariance(x, y, z, stride, place, window, distances2, radius2)
        nx, ny, nz, curvature = plane_of(covariance)
        normals[place, 0], normals[place, 1], normals[place, 2] = nx, ny, nz
        curvatures[place] = curvature
        region_radii2[place] = _kth_smallest(distances2, _size(window), k_region, radius2)
    return normals, curvatures, region_radii2


@njit(cache=True)
def nearest(x, y, z, stride, place, k, pitch, distances2):  # type: ignore[no-untyped-def]
    """Find the k points nearest to the point at a place.

    Returns:
        The squared distance of the k-th nearest point, and the window that holds them all;
        `distances2` then holds the squared distances of the window's points.
    """
    for window in range(len(WINDOWS)):
        _measure(x, y, z, stride, place, window, distances2)
        reach2 = reach(window, z[place], pitch) ** 2
        radius2 = _kth_smallest(distances2, _size(window), k, reach2)
        if radius2 < reach2:
            break
    return radius2, window


@njit(cache=True)
def reach(window, depth, pitch):  # type: ignore[no-untyped-def]
    """Return how far around its middle point a window holds all points [m].

    No ray outside of the window comes nearer. Only where even the largest window is too small
    are points beyond it missed.
    """
    if window == len(WINDOWS) - 1:
        return UNREACHED
    return np.float32((WINDOWS[window, 0] + 1) * pitch * depth)


@njit(cache=True)
def _size(window):  # type: ignore[no-untyped-def]
    return (2 * WINDOWS[window, 0] + 1) * WINDOWS[window, 1]


@njit(cache=True, fastmath=_VECTORS)
def _measure(x, y, z, stride, place, window, distances2):  # type: ignore[no-untyped-def]
    """Write the squared distances from the point at a place to all points of a window."""
    half, columns = WINDOWS[window]
    x0, y0, z0 = x[place], y[place], z[place]
    for row in range(2 * half + 1):
        # Unsigned: numba then knows that the index is not from the end, and uses vectors.
        start = uint64(place + (row - half) * stride - columns // 2 + 1)
        first = uint64(row * columns)
        for column in range(uint64(columns)):
            dx = x[start + column] - x0
            dy = y[start + column] - y0
            dz = z[start + column] - z0
            distances2[first + column] = dx * dx + dy * dy + dz * dz


@njit(cache=True, fastmath=_VECTORS)
def _count(values, size, limit):  # type: ignore[no-untyped-def]
    count = np.int32(0)  # as wide in a vector register as the values
    for i in range(uint64(size)):
        count = np.int32(count + np.int32(values[i] <= limit))
    return count


@njit(cache=True)
def _kth_smallest(values, size, k, highest):  # type: ignore[no-untyped-def]
    """Return a limit up to which there are k values, or `highest` if there are fewer.

    Where values tie there may be a few more. On a surface the number of points within a radius
    grows with its square, so that interpolation finds the limit in a few steps.
    """
    above, n_above = np.float32(highest), _count(values, size, highest)
    below, n_below = np.float32(0), 0
    step = 0
    while n_above > k and above - below > TIE * above:
        step += 1
        share = 0.5 if step % 4 == 0 else (k - n_below) / (n_above - n_below)
        limit = np.float32(below + share * (above - below))
        n = _count(values, size, limit)
        if n >= k:
            above, n_above = limit, n
        else:
            below, n_below = limit, n
    return above


@njit(cache=True, fastmath=_VECTORS)
def _covariance(x, y, z, stride, place, window, distances2, radius2):  # type: ignore[no-untyped-def]
    """Return the covariance xx, xy, xz, yy, yz, zz of a window's points within a radius."""
    half, columns = WINDOWS[window]
    x0, y0, z0 = x[place], y[place], z[place]
    n = sx = sy = sz = sxx = sxy = sxz = syy = syz = szz = np.float32(0)
    for row in range(2 * half + 1):
        start = uint64(place + (row - half) * stride - columns // 2 + 1)
        first = uint64(row * columns)
        for column in range(uint64(columns)):
            weight = np.float32(distances2[first + column] <= radius2)
            dx = (x[start + column] - x0) * weight
            dy = (y[start + column] - y0) * weight
            dz = (z[start + column] - z0) * weight
            n += weight
            sx += dx
            sy += dy
            sz += dz
            sxx += dx * dx
            sxy += dx * dy
            sxz += dx * dz
            syy += dy * dy
            syz += dy * dz
            szz += dz * dz
    mx, my, mz = sx / n, sy / n, sz / n
    return (
        sxx / n - mx * mx,
        sxy / n - mx * my,
        sxz / n - mx * mz,
        syy / n - my * my,
        syz / n - my * mz,
        szz / n - mz * mz,
    )


@njit(cache=True)
def plane_of(covariance):  # type: ignore[no-untyped-def]
    """Return the normal x, y, z and the curvature of points with a given covariance.

    The smallest eigenvalue comes from the trigonometric solution of the characteristic cubic, the
    normal from the longest cross product of two rows of the covariance less that eigenvalue.

    Source: O. K. Smith, "Eigenvalues of a symmetric 3 x 3 matrix", CACM 4 (4), 1961.
    """
    xx, xy, xz, yy, yz, zz = covariance
    trace = float(xx) + yy + zz
    if trace <= 0:
        return 0.0, 0.0, 1.0, 0.0  # all points are one
    scale = 1 / trace
    xx, xy, xz, yy, yz, zz = xx * scale, xy * scale, xz * scale, yy * scale, yz * scale, zz * scale
    a, b, c = xx - 1 / 3, yy - 1 / 3, zz - 1 / 3
    p = math.sqrt((a * a + b * b + c * c + 2 * (xy * xy + xz * xz + yz * yz)) / 6)
    if p == 0:
        return 0.0, 0.0, 1.0, 1 / 3  # a ball has no normal
    determinant = a * (b * c - yz * yz) - xy * (xy * c - yz * xz) + xz * (xy * yz - b * xz)
    angle = math.acos(min(1.0, max(-1.0, determinant / (2 * p**3)))) / 3
    smallest = 1 / 3 + 2 * p * math.cos(angle + 2 * math.pi / 3)
    xx, yy, zz = xx - smallest, yy - smallest, zz - smallest
    normal, length2 = (0.0, 0.0, 1.0), 0.0
    for x, y, z in (
        (xy * yz - xz * yy, xz * xy - xx * yz, xx * yy - xy * xy),
        (xy * zz - xz * yz, xz * xz - xx * zz, xx * yz - xy * xz),
        (yy * zz - yz * yz, yz * xz - xy * zz, xy * yz - yy * xz),
    ):
        if x * x + y * y + z * z > length2:
            length2 = x * x + y * y + z * z
            normal = (x, y, z)
    if length2 == 0:
        return 0.0, 0.0, 1.0, max(smallest, 0.0)
    length = math.sqrt(length2)
    return normal[0] / length, normal[1] / length, normal[2] / length, max(smallest, 0.0)
