"""Compiled search for the nearest points around a pixel, and the plane through them.

The cloud is held as three planes, x, y and z, of the image with a margin around it; a place is an
index into a plane, counted row by row. A pixel without a point, and every pixel of the margin,
holds `FAR`: so windows need no clipping, and such a pixel is never among the nearest.
"""

from __future__ import annotations

import numpy as np
from numba import njit, uint64
from numpy.typing import NDArray

from hypermap.core.arrays import BoolArray, IntArray

FAR = np.float32(1e6)
UNREACHED2 = np.float32(1e10)  # less than the squared distance to FAR, more than any real one

# Windows around a pixel, the first that is large enough counts: rows above and below the pixel,
# and columns in blocks of 16, half of them to the left.
WINDOWS = np.array([[4, 1], [7, 1], [10, 2], [16, 2], [31, 4]])
MARGIN = 32

# The radius around a point is good if about k points lie within; on the way from one pixel to the
# next it seldom has to change.
TOO_FEW, TOO_MANY = np.float32(0.93), np.float32(1.09)  # times k
# Of two pixels side by side on one surface, which share nearly all neighbours, the second has the
# plane of the first: if their squared distance is at most this part of the squared radius.
SAME_PLANE = np.float32(0.3)
TIE = np.float32(1e-5)  # squared radii that differ by a smaller part are one
MAX_STEPS = 16  # enough to reach any point of the largest window

# What lets sums be computed in vector registers; NaN and infinity keep their meaning.
_VECTORS = {"reassoc", "contract", "nsz", "arcp"}
_ROWS = 3  # at a time, so that their sums stay in registers; divides the rows of each window


def planes_of(points: NDArray[np.float32], valid: BoolArray) -> NDArray[np.float32]:
    """Return an organised cloud (H, W, 3) as planes with margins, (3, H + 64, W + 64)."""
    height, width = valid.shape
    planes = np.full((3, height + 2 * MARGIN, width + 2 * MARGIN), FAR)
    inner = planes[:, MARGIN : MARGIN + height, MARGIN : MARGIN + width]
    np.copyto(inner, np.moveaxis(points, -1, 0), where=valid)
    return planes


def fit_planes(
    planes: NDArray[np.float32], places: IntArray, k: int, pitch: float
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
    """Fit a plane to about the k points nearest to each of some points.

    Args:
        planes: the cloud with its margins, shape (3, H, W).
        places: where there is a point whose normal is wanted, increasing, shape (N,).
        k: how many neighbours, the point itself included; up to 7 % fewer or 9 % more will do, and
            those of the pixel to the left where both are on one surface.
        pitch: least distance between the rays of neighbouring pixels, per metre of depth.

    Returns:
        Unit normals of either sign, zero where the points are no plane, shape (3, N); curvatures
        from 0 (flat) to 1/3, shape (N,); and squared radii around the points, shape (N,).
    """
    covariances, radii2 = _covariances(planes, places, np.float32(k), np.float32(pitch))
    normals, curvatures = planes_through(covariances)
    return normals, curvatures, radii2


@njit(cache=True, error_model="numpy")
def _covariances(planes, places, k, pitch):  # type: ignore[no-untyped-def]
    """Return xx, xy, xz, yy, yz, zz of the nearest points, shape (6, N), and their radii2 (N,)."""
    stride = planes.shape[2]
    x, y, z = planes[0].ravel(), planes[1].ravel(), planes[2].ravel()
    covariances = np.empty((6, len(places)), np.float32)
    radii2 = np.empty(len(places), np.float32)
    few, many = TOO_FEW * k, TOO_MANY * k
    radius2, last, is_shared = np.float32(0), -1, True
    for i, place in enumerate(places):
        is_shared = (
            not is_shared
            and place == last + 1
            and (x[place] - x[last]) ** 2 + (y[place] - y[last]) ** 2 + (z[place] - z[last]) ** 2
            <= SAME_PLANE * radius2
        )
        if is_shared:
            covariances[:, i] = covariances[:, i - 1]
            radii2[i] = radius2
            last = place
            continue
        step2 = (pitch * z[place]) ** 2
        if place != last + 1:
            radius2 = np.float32(k / np.pi) * step2  # as on a surface that faces the camera
        last = place
        below, above = np.float32(0), UNREACHED2
        for _ in range(MAX_STEPS):
            window = 0
            while window < len(WINDOWS) - 1 and radius2 >= (WINDOWS[window, 0] + 1) ** 2 * step2:
                window += 1
            sums = _sums(x, y, z, stride, place, window, radius2)
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
        radii2[i] = radius2
        share = 1 / sums[0]
        mx, my, mz = sums[1] * share, sums[2] * share, sums[3] * share
        covariances[0, i] = sums[4] * share - mx * mx
        covariances[1, i] = sums[5] * share - mx * my
        covariances[2, i] = sums[6] * share - mx * mz
        covariances[3, i] = sums[7] * share - my * my
        covariances[4, i] = sums[8] * share - my * mz
        covariances[5, i] = sums[9] * share - mz * mz
    return covariances, radii2


@njit(cache=True, error_model="numpy", fastmath=_VECTORS)
def _sums(x, y, z, stride, place, window, radius2):  # type: ignore[no-untyped-def]
    """Return the sums of 1, x, y, z, xx, xy, xz, yy, yz, zz over a window's points in a radius.

    They are counted from the point at the place.
    """
    half, blocks = WINDOWS[window]
    x0, y0, z0 = x[place], y[place], z[place]
    n = sx = sy = sz = sxx = sxy = sxz = syy = syz = szz = np.float32(0)
    for rows in range(-half, half + 1, _ROWS):
        for block in range(blocks):
            first = place + rows * stride + 16 * block - 8 * blocks + 1
            for column in range(uint64(16)):
                for row in range(_ROWS):
                    # Unsigned: numba then knows that the index is not from the end.
                    at = uint64(first + row * stride) + column
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


@njit(cache=True, error_model="numpy", fastmath=_VECTORS)
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
        for _ in range(6):
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
