"""Planes through about the k points nearest to each pixel of an image.

Where the surface is smooth, they come from `smooth_windows`; elsewhere, from the nearest points in
a window around the pixel.
"""

from __future__ import annotations

import math

import numpy as np
from numba import uint64
from numpy.typing import NDArray

from hypermap._loops import loop
from hypermap.core.arrays import BoolArray, IntArray
from hypermap.perception.region_growing.smooth_windows import fit_smooth

UNREACHED2 = np.float32(1e10)  # less than the squared distance to `FAR`, more than any real one

# Windows around a pixel, the first that is large enough counts: the radius from which on it is too
# small [pixels], its rows in chunks of 5 and its columns in blocks of 16, half of them to the left.
WINDOWS = np.array([[5, 2, 1], [8, 3, 1], [13, 5, 2], [16, 7, 2], [32, 13, 4]])

# The radius around a point is good if about k points are within it.
TOO_FEW, TOO_MANY = np.float32(0.8), np.float32(1.25)  # times k
TIE = np.float32(1e-5)  # squared radii within this relative difference are equal
MAX_STEPS = 16  # enough to reach any point of the largest window

# What lets sums be computed in vector registers; NaN and infinity keep their meaning.
_VECTORS = {"reassoc", "contract", "nsz", "arcp"}
_ROWS, _COLUMNS = 5, 16  # of a window at a time, so that the sums stay in registers


def fit_planes(
    planes: NDArray[np.float32], wanted: BoolArray, k: int, focal: tuple[float, float]
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
    """Fit a plane to about the k points nearest to each of some points.

    Args:
        planes: the cloud with its margins, shape (3, H, W).
        wanted: pixels whose normal to compute, not in the margins, shape (H, W).
        k: number of neighbors, including the point; a fifth fewer or a quarter more is fine,
            and on smooth surfaces the nearest odd square number.
        focal: focal lengths along rows and columns [pixels].

    Returns:
        Unit normals of either sign, zero where the points are no plane, shape (3, H, W); curvatures
        from 0 (flat) to 1/3, shape (H, W); and squared radii around the points, shape (H, W). They
        are valid only where wanted.
    """
    fx, fy = map(np.float32, focal)
    half = (0,) * max(round((math.sqrt(k) - 1) / 2), 1)
    normals, curvatures, radii2, rough = fit_smooth(planes, wanted, np.float32(k), half, fx, fy)
    covariances = _covariances(planes, rough, np.float32(k), 1 / max(fx, fy), radii2)
    rough_normals, rough_curvatures = planes_through(covariances)
    _put(rough, rough_normals, rough_curvatures, normals, curvatures)
    return normals, curvatures, radii2


@loop()
def _put(
    places: IntArray,
    some_normals: NDArray[np.float32],
    some_curvatures: NDArray[np.float32],
    normals: NDArray[np.float32],
    curvatures: NDArray[np.float32],
) -> None:
    """Write the normals and curvatures of some places into those of all."""
    at = curvatures.ravel()
    x, y, z = normals[0].ravel(), normals[1].ravel(), normals[2].ravel()
    for i, place in enumerate(places):
        x[place], y[place], z[place] = some_normals[0, i], some_normals[1, i], some_normals[2, i]
        at[place] = some_curvatures[i]


@loop(allocates=True)
def _covariances(
    planes: NDArray[np.float32],
    places: IntArray,
    k: np.float32,
    pitch: np.float32,
    radii2: NDArray[np.float32],
) -> NDArray[np.float32]:
    """Return xx, xy, xz, yy, yz, zz of the points nearest to each of some points, shape (6, N).

    Writes their squared radii into `radii2`, shape (H, W). The pitch is the smallest distance
    between the rays of neighboring pixels, per meter of depth.
    """
    stride = planes.shape[2]
    x, y, z, radii2 = planes[0].ravel(), planes[1].ravel(), planes[2].ravel(), radii2.ravel()
    covariances = np.empty((6, len(places)), np.float32)
    few, many = TOO_FEW * k, TOO_MANY * k
    spread = k / np.float32(np.pi)  # of k points: on a surface that faces the camera
    for i, place in enumerate(places):
        step2 = (pitch * z[place]) ** 2
        radius2 = min(spread * step2, UNREACHED2)
        below, above = np.float32(0), UNREACHED2
        for _ in range(MAX_STEPS):
            window = 0
            while window < len(WINDOWS) - 1 and radius2 >= WINDOWS[window, 0] ** 2 * step2:
                window += 1
            sums = _sums(x, y, z, stride, place, WINDOWS[window, 1], WINDOWS[window, 2], radius2)
            if few <= sums[0] <= many:
                break
            if sums[0] < k:
                below = radius2
            else:
                above = radius2
            if above - below <= TIE * above:
                break
            # On a surface the number of points within a radius grows with its square.
            radius2 *= min(k / sums[0], np.float32(4))
            if not below < radius2 < above:
                radius2 = np.float32(0.5) * (below + above)
        radii2[place] = radius2
        spread = radius2 / step2 * (k / sums[0])
        share = 1 / sums[0]
        mx, my, mz = sums[1] * share, sums[2] * share, sums[3] * share
        covariances[0, i] = sums[4] * share - mx * mx
        covariances[1, i] = sums[5] * share - mx * my
        covariances[2, i] = sums[6] * share - mx * mz
        covariances[3, i] = sums[7] * share - my * my
        covariances[4, i] = sums[8] * share - my * mz
        covariances[5, i] = sums[9] * share - mz * mz
    return covariances


@loop(fastmath=_VECTORS, forceinline=True)
def _sums(x, y, z, stride, place, chunks, blocks, radius2):  # type: ignore[no-untyped-def]
    """Return the sums of 1, x, y, z, xx, xy, xz, yy, yz, zz over a window's points in a radius.

    They are relative to the point at the place.
    """
    x0, y0, z0 = x[place], y[place], z[place]
    n = sx = sy = sz = sxx = sxy = sxz = syy = syz = szz = np.float32(0)
    corner = place - (chunks * _ROWS // 2) * stride - blocks * _COLUMNS // 2
    for chunk in range(chunks):
        for block in range(blocks):
            first = uint64(corner + chunk * _ROWS * stride + block * _COLUMNS)
            for column in range(uint64(_COLUMNS)):
                for row in range(_ROWS):
                    # Unsigned: numba then knows that the index is not from the end.
                    at = first + uint64(row * stride) + column
                    dx, dy, dz = x[at] - x0, y[at] - y0, z[at] - z0
                    weight = np.float32(dx * dx + dy * dy + dz * dz <= radius2)
                    n += weight
                    dx *= weight
                    dy *= weight
                    dz *= weight
                    sx += dx
                    sy += dy
                    sz += dz
                    sxx += dx * dx
                    sxy += dx * dy
                    sxz += dx * dz
                    syy += dy * dy
                    syz += dy * dz
                    szz += dz * dz
    return n, sx, sy, sz, sxx, sxy, sxz, syy, syz, szz


@loop(allocates=True, fastmath=_VECTORS)
def planes_through(covariances):  # type: ignore[no-untyped-def]
    """Return the normals and the curvatures of points with given covariances.

    The smallest eigenvalue comes from Newton's method, which climbs from 0 to the first root of the
    characteristic cubic; the normal is the longest cross product of two rows of the covariance
    less that eigenvalue.

    Args:
        covariances: xx, xy, xz, yy, yz, zz, shape (6, N).

    Returns:
        Unit normals, zero where the points are no plane, shape (3, N); and curvatures, shape (N,).
    """
    one, two, three = np.float32(1), np.float32(2), np.float32(3)
    tiny = np.float32(1e-12)
    count = covariances.shape[1]
    normals = np.empty((3, count), np.float32)
    curvatures = np.empty(count, np.float32)
    for i in range(uint64(count)):
        xx, xy, xz = covariances[0, i], covariances[1, i], covariances[2, i]
        yy, yz, zz = covariances[3, i], covariances[4, i], covariances[5, i]
        scale = one / (xx + yy + zz + np.float32(1e-30))
        xx, xy, xz, yy, yz, zz = (
            xx * scale,
            xy * scale,
            xz * scale,
            yy * scale,
            yz * scale,
            zz * scale,
        )
        minors = xx * yy - xy * xy + xx * zz - xz * xz + yy * zz - yz * yz
        determinant = xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz)
        root = np.float32(0)
        for _ in range(10):  # enough for a triple root, which is found slowest
            value = ((root - one) * root + minors) * root - determinant
            slope = (three * root - two) * root + minors
            root -= value / (slope + tiny)
        xx, yy, zz = xx - root, yy - root, zz - root
        nx, ny, nz = xy * yz - xz * yy, xz * xy - xx * yz, xx * yy - xy * xy
        longest2 = nx * nx + ny * ny + nz * nz
        for x, y, z in (
            (xy * zz - xz * yz, xz * xz - xx * zz, xx * yz - xy * xz),
            (yy * zz - yz * yz, yz * xz - xy * zz, xy * yz - yy * xz),
        ):
            length2 = x * x + y * y + z * z
            is_longer = length2 > longest2
            nx, ny, nz = (
                (x if is_longer else nx),
                (y if is_longer else ny),
                (z if is_longer else nz),
            )
            longest2 = length2 if is_longer else longest2
        scale = one / np.sqrt(longest2 + np.float32(1e-30))
        normals[0, i], normals[1, i], normals[2, i] = nx * scale, ny * scale, nz * scale
        curvatures[i] = root
    return normals, curvatures
