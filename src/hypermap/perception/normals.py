"""Compiled search for the nearest points around a pixel, and the plane through them.

The cloud is held as three planes, x, y and z, of the image with a margin around it, each laid out
as one row-major vector. A pixel without a point, and every pixel of the margin, holds `FAR`:
so windows need no clipping, and such a pixel is never among the nearest.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, uint64
from numpy.typing import NDArray

from hypermap.core.arrays import BoolArray, IntArray

FAR = np.float32(1e6)
UNREACHED = np.float32(1e11)  # less than the squared distance to FAR, more than any real one

# Windows around a pixel, tried one after the other: rows above and below the pixel, and columns.
# Columns come in whole vector registers: columns / 2 - 1 to the left, columns / 2 to the right.
WINDOWS = np.array([[5, 16], [7, 16], [15, 32], [31, 64]])
MARGIN = 32

# What lets sums be computed in vector registers; NaN and infinity keep their meaning.
_VECTORS = {"reassoc", "contract", "nsz", "arcp"}


def planes_of(points: NDArray[np.float32], valid: BoolArray) -> NDArray[np.float32]:
    """Return an organised cloud (H, W, 3) as planes with margins, (3, H + 64, W + 64)."""
    height, width = valid.shape
    planes = np.full((3, height + 2 * MARGIN, width + 2 * MARGIN), FAR)
    inner = planes[:, MARGIN : MARGIN + height, MARGIN : MARGIN + width]
    np.copyto(inner, np.moveaxis(points, -1, 0), where=valid)
    return planes


@njit(cache=True)  # type: ignore[untyped-decorator]
def fit_planes(
    planes: NDArray[np.float32], at: IntArray, k: int, pitch: float
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
    """Fit a plane to the k points nearest to each of some points.

    Args:
        planes: the cloud, see the head of the module.
        at: indices into the raveled planes, of pixels that hold a point, shape (N,).
        k: how many neighbours, the point itself included.
        pitch: least distance between the rays of neighbouring pixels, per metre of depth.

    Returns:
        Unit normals of either sign, shape (N, 3); curvatures from 0 (flat) to 1/3, shape (N,);
        and squared distances to the k-th nearest point, shape (N,).
    """
    normals = np.empty((len(at), 3), np.float32)
    curvatures = np.empty(len(at), np.float32)
    radii2 = np.empty(len(at), np.float32)
    stride = planes.shape[2]
    x, y, z = planes[0].ravel(), planes[1].ravel(), planes[2].ravel()
    distances2 = np.empty((2 * MARGIN) ** 2, np.float32)
    for i in range(len(at)):
        radius2, window = nearest(x, y, z, stride, at[i], k, pitch, distances2)
        moments = _moments(x, y, z, stride, at[i], window, distances2, radius2)
        nx, ny, nz, curvature = plane_of_moments(moments)
        normals[i, 0], normals[i, 1], normals[i, 2] = nx, ny, nz
        curvatures[i] = curvature
        radii2[i] = radius2
    return normals, curvatures, radii2


@njit(cache=True)  # type: ignore[untyped-decorator]
def nearest(x, y, z, stride, at, k, pitch, distances2):  # type: ignore[no-untyped-def]
    """Find the k points nearest to a pixel's point.

    A window is large enough if no ray outside of it comes nearer than the k-th nearest point
    inside. Only where even the largest window is too small may points beyond it be missed.

    Returns:
        The squared distance of the k-th nearest point, and the window that holds them all;
        `distances2` then holds the squared distance of each of the window's points.
    """
    for window in range(len(WINDOWS)):
        _measure(x, y, z, stride, at, window, distances2)
        count = (2 * WINDOWS[window, 0] + 1) * WINDOWS[window, 1]
        last = window == len(WINDOWS) - 1
        reach2 = UNREACHED if last else reach(z[at], pitch, window) ** 2
        radius2 = _kth_smallest(distances2, count, k, reach2)
        if radius2 < reach2 or last:
            break
    return radius2, window


@njit(cache=True)  # type: ignore[untyped-decorator]
def reach(depth: float, pitch: float, window: int) -> float:
    """Return how far a window certainly holds all points around a pixel [m]."""
    return np.float32((WINDOWS[window, 0] + 1) * pitch * depth)


@njit(cache=True, fastmath=_VECTORS)  # type: ignore[untyped-decorator]
def _measure(x, y, z, stride, at, window, distances2):  # type: ignore[no-untyped-def]
    """Write the squared distances from a pixel's point to all points of a window."""
    half, columns = WINDOWS[window]
    x0, y0, z0 = x[at], y[at], z[at]
    for row in range(2 * half + 1):
        # Unsigned: numba then knows that the index is not from the end, and uses vectors.
        start = uint64(at + (row - half) * stride - columns // 2 + 1)
        out = uint64(row * columns)
        for column in range(uint64(columns)):
            dx = x[start + column] - x0
            dy = y[start + column] - y0
            dz = z[start + column] - z0
            distances2[out + column] = dx * dx + dy * dy + dz * dz


@njit(cache=True, fastmath=_VECTORS)  # type: ignore[untyped-decorator]
def _count(values: NDArray[np.float32], count: int, limit: float) -> int:
    total = 0
    for i in range(uint64(count)):
        total += values[i] <= limit
    return total


@njit(cache=True)  # type: ignore[untyped-decorator]
def _kth_smallest(values: NDArray[np.float32], count: int, k: int, highest: float) -> float:
    """Return a limit below which there are k values, or `highest` if there are fewer.

    Where values tie there may be a few more. On a surface the number of points within a radius
    grows with its square, so that interpolation finds the limit in a few steps.
    """
    above, n_above = np.float32(highest), _count(values, count, highest)
    if n_above < k:
        return above
    below, n_below = np.float32(0), 0
    for step in range(48):
        if n_above == k:
            break
        share = np.float32(0.5 if step % 3 == 2 else (k - n_below) / (n_above - n_below))
        limit = below + share * (above - below)
        if not below < limit < above:
            limit = np.float32(0.5) * (below + above)
        n = _count(values, count, limit)
        if n >= k:
            above, n_above = limit, n
        else:
            below, n_below = limit, n
    return above


@njit(cache=True, fastmath=_VECTORS)  # type: ignore[untyped-decorator]
def _moments(x, y, z, stride, at, window, distances2, radius2):  # type: ignore[no-untyped-def]
    """Return the covariance xx, xy, xz, yy, yz, zz of a window's points within a radius."""
    half, columns = WINDOWS[window]
    x0, y0, z0 = x[at], y[at], z[at]
    zero = np.float32(0)
    n = sx = sy = sz = sxx = sxy = sxz = syy = syz = szz = zero
    for row in range(2 * half + 1):
        start = uint64(at + (row - half) * stride - columns // 2 + 1)
        inside = uint64(row * columns)
        for column in range(uint64(columns)):
            near = distances2[inside + column] <= radius2
            dx = x[start + column] - x0 if near else zero
            dy = y[start + column] - y0 if near else zero
            dz = z[start + column] - z0 if near else zero
            n += np.float32(near)
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


@njit(cache=True)  # type: ignore[untyped-decorator]
def plane_of_moments(moments):  # type: ignore[no-untyped-def]
    """Return the normal x, y, z and the curvature of points with a given covariance.

    The smallest eigenvalue comes from the trigonometric solution of the characteristic cubic, the
    normal from the longest cross product of two rows of the covariance less that eigenvalue.

    Source: O. K. Smith, "Eigenvalues of a symmetric 3 x 3 matrix", CACM 4 (4), 1961.
    """
    xx, xy, xz, yy, yz, zz = moments
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
