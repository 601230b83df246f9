"""An image cut into surfaces: planes first, then whatever else hangs together.

All is done in disparity, 1 / depth [1/m], because there a plane is an affine function of the pixel
and the noise of a depth camera, which grows with the square of the depth, is the same everywhere.
Sums over pixels have ten entries: n, u, v, uu, uv, vv, d, ud, vd, dd.

Source: planes from blocks of pixels after Feng, Taguchi, Kamat, "Fast plane extraction in
organized point clouds using agglomerative hierarchical clustering", ICRA 2014.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from hypermap.core.arrays import BoolArray, IntArray
from hypermap.perception.config import PerceptionConfig
from hypermap.perception.frame import Camera

BLOCK = 0.03  # side of a block as a share of the focal length: 8 pixels of a 320 x 240 Kinect
MIN_FILL = 0.6  # share of a block's pixels that must hold a point
MIN_BLOCKS = 3  # fewer are no plane, but part of something round or small

# How far from a plane, in standard deviations of the noise:
FLAT = 1.5  # the pixels of a block may lie from its own plane, in the mean square
LEVEL = 2.0  # the mean of a block may lie from the plane that it joins
ON_PLANE = 3.0  # a pixel may lie from the plane that it joins
SAME = 4.0  # two pixels may lie from each other beyond `max_gap`: the noise of both

LOST = 4  # pixels without depth across which two regions still border on each other

UNFIT = -1


@dataclass(frozen=True, eq=False)
class Surfaces:
    """The surfaces of an image; the first `planes` of them are planes.

    Attributes:
        labels: the surface of each pixel, -1 where there is no point, int32, shape (H, W).
        disparity: 1 / depth [1/m], 0 where there is no point, float32, shape (H, W).
        sizes: pixels of each surface, shape (N,).
        own_border: the share of each surface's border at a jump in depth where it is the nearer
            side, 1 if there is no such border, shape (N,). A wall seen between the legs of a
            chair ends only where something stands before it, and so has 0.
        planes: how many of them are planes.
    """

    labels: NDArray[np.int32]
    disparity: NDArray[np.float32]
    sizes: IntArray
    own_border: NDArray[np.float64]
    planes: int


def find_surfaces(
    points: NDArray[np.float32], valid: BoolArray, camera: Camera, config: PerceptionConfig
) -> Surfaces:
    """Return the surfaces of an image.

    Args:
        points: organised cloud in the optical frame [m], shape (H, W, 3).
        valid: which of its pixels hold a point, shape (H, W).
        camera: intrinsics.
        config: noise and thresholds.
    """
    disparity = _disparity(points, valid)
    K, noise = camera.K, config.depth_noise
    center, focal = (K[0, 2], K[1, 2]), (K[0, 0], K[1, 1])
    side = max(round(BLOCK * min(focal)), 4)
    cosine = math.cos(math.radians(config.smoothness_deg))

    sums, planes, flatness = _fit_blocks(disparity, center, side, FLAT * noise)
    blocks, planes = _join_blocks(sums, planes, flatness, focal, cosine, LEVEL * noise)
    labels = _spread(disparity, blocks, planes, center, side, ON_PLANE * noise)
    count = _label_rest(disparity, labels, len(planes), config.max_gap, SAME * noise)
    near, far = _borders(disparity, labels, count, config.max_gap, SAME * noise)
    ends = near + far
    return Surfaces(
        labels=labels,
        disparity=disparity,
        sizes=_sizes(labels, count),
        own_border=np.divide(near, ends, out=np.ones(count), where=ends > 0),
        planes=len(planes),
    )


@njit(cache=True, error_model="numpy")
def _disparity(points, valid):  # type: ignore[no-untyped-def]
    disparity = np.empty(valid.shape, np.float32)
    for row in range(valid.shape[0]):
        z, is_valid, inverse = points[row, :, 2], valid[row], disparity[row]
        for col in range(len(z)):
            inverse[col] = np.float32(1) / z[col] if is_valid[col] else np.float32(0)
    return disparity


@njit(cache=True)
def _sizes(labels, count):  # type: ignore[no-untyped-def]
    """Return how many pixels each surface has, shape (count,)."""
    sizes = np.zeros(count + 1, np.int64)  # the last one of what is no surface, -1
    for row in range(labels.shape[0]):
        for col in range(labels.shape[1]):
            sizes[labels[row, col]] += 1
    return sizes[:count]


@njit(cache=True)
def _fit_blocks(disparity, center, side, tolerance):  # type: ignore[no-untyped-def]
    """Fit a plane to each block of pixels.

    Returns:
        The blocks' sums, shape (h, w, 10); their planes a, b, c, shape (h, w, 3); and their root
        mean square distances from these, infinite where that is no plane, shape (h, w).
    """
    h, w = disparity.shape[0] // side, disparity.shape[1] // side
    sums = np.zeros((h, w, 10))
    planes = np.zeros((h, w, 3))
    flatness = np.full((h, w), np.inf)
    for row in range(h):
        for col in range(w):
            block = sums[row, col]
            for y in range(row * side, row * side + side):
                for x in range(col * side, col * side + side):
                    d = np.float64(disparity[y, x])
                    if d > 0:
                        u, v = x - center[0], y - center[1]
                        block[0] += 1
                        block[1] += u
                        block[2] += v
                        block[3] += u * u
                        block[4] += u * v
                        block[5] += v * v
                        block[6] += d
                        block[7] += u * d
                        block[8] += v * d
                        block[9] += d * d
            if block[0] >= MIN_FILL * side * side:
                distance = _fit(block, planes[row, col])
                if distance < tolerance:
                    flatness[row, col] = distance
    return sums, planes, flatness


@njit(cache=True)
def _fit(sums, plane):  # type: ignore[no-untyped-def]
    """Write the a, b, c of d = a u + b v + c; return the root mean square distance from it."""
    n = sums[0]
    u, v, d = sums[1] / n, sums[2] / n, sums[6] / n
    uu, uv, vv = sums[3] / n - u * u, sums[4] / n - u * v, sums[5] / n - v * v
    ud, vd, dd = sums[7] / n - u * d, sums[8] / n - v * d, sums[9] / n - d * d
    determinant = uu * vv - uv * uv
    if determinant <= 1e-6 * (uu + vv) ** 2:  # pixels on one line
        return np.inf
    a, b = (ud * vv - vd * uv) / determinant, (vd * uu - ud * uv) / determinant
    plane[0], plane[1], plane[2] = a, b, d - a * u - b * v
    return math.sqrt(max(dd - a * ud - b * vd, 0.0))


@njit(cache=True)
def _cosine(one, other, focal):  # type: ignore[no-untyped-def]
    """Return the cosine between the normals of two planes, (a fx, b fy, c) each."""
    fx2, fy2 = focal[0] ** 2, focal[1] ** 2
    dot = one[0] * other[0] * fx2 + one[1] * other[1] * fy2 + one[2] * other[2]
    length2 = one[0] ** 2 * fx2 + one[1] ** 2 * fy2 + one[2] ** 2
    other2 = other[0] ** 2 * fx2 + other[1] ** 2 * fy2 + other[2] ** 2
    return dot / math.sqrt(max(length2 * other2, 1e-30))


@njit(cache=True)
def _join_blocks(sums, planes, flatness, focal, cosine, tolerance):  # type: ignore[no-untyped-def]
    """Grow planes over neighbouring blocks, from the flattest on; each block refines its plane.

    Returns:
        The plane of each block, -1 for none, shape (h, w); and the planes, shape (N, 3).
    """
    h, w = flatness.shape
    plane_of = np.full((h, w), UNFIT)
    is_free = np.isfinite(flatness)
    found = np.empty((h * w, 3))
    count = 0
    queue = np.empty(h * w, np.int64)
    for seed in np.argsort(flatness.ravel()):
        if not is_free[seed // w, seed % w]:
            continue
        is_free[seed // w, seed % w] = False
        total, plane = sums[seed // w, seed % w].copy(), planes[seed // w, seed % w].copy()
        queue[0] = seed
        head, tail = 0, 1
        while head < tail:
            row, col = queue[head] // w, queue[head] % w
            head += 1
            for step in range(4):
                y, x = row + (step == 0) - (step == 1), col + (step == 2) - (step == 3)
                if not (0 <= y < h and 0 <= x < w and is_free[y, x]):
                    continue
                block = sums[y, x]
                expected = (plane[0] * block[1] + plane[1] * block[2]) / block[0] + plane[2]
                if abs(block[6] / block[0] - expected) > tolerance:
                    continue
                if _cosine(plane, planes[y, x], focal) < cosine:
                    continue
                is_free[y, x] = False
                queue[tail] = y * w + x
                tail += 1
                total += block
                _fit(total, plane)
        if tail >= MIN_BLOCKS:
            for block_index in queue[:tail]:
                plane_of[block_index // w, block_index % w] = count
            found[count] = plane
            count += 1
    return plane_of, found[:count].copy()


@njit(cache=True)
def _spread(disparity, blocks, planes, center, side, tolerance):  # type: ignore[no-untyped-def]
    """Return the plane of each pixel: those of its blocks, and on from there to all that touch."""
    height, width = disparity.shape
    labels = np.full((height, width), UNFIT, np.int32)
    queue = np.empty((height * width, 2), np.int32)
    head, tail = 0, 0
    for row in range(blocks.shape[0]):
        for col in range(blocks.shape[1]):
            k = blocks[row, col]
            if k == UNFIT:
                continue
            top, left = row * side, col * side
            bottom, right = top + side, left + side
            for y in range(top, bottom):
                for x in range(left, right):
                    if _is_on(disparity[y, x], planes[k], x, y, center, tolerance):
                        labels[y, x] = k
            # Inside of the block its plane has been everywhere already.
            for y in range(top, bottom):
                inner = side - 1 if top < y < bottom - 1 else 1
                for x in range(left, right, inner):
                    if labels[y, x] == k:
                        queue[tail, 0], queue[tail, 1] = y, x
                        tail += 1
    while head < tail:
        row, col = queue[head, 0], queue[head, 1]
        head += 1
        k = labels[row, col]
        for step in range(4):
            y, x = row + (step == 0) - (step == 1), col + (step == 2) - (step == 3)
            if not (0 <= y < height and 0 <= x < width) or labels[y, x] != UNFIT:
                continue
            if _is_on(disparity[y, x], planes[k], x, y, center, tolerance):
                labels[y, x] = k
                queue[tail, 0], queue[tail, 1] = y, x
                tail += 1
    return labels


@njit(cache=True)
def _is_on(d, plane, x, y, center, tolerance):  # type: ignore[no-untyped-def]
    expected = plane[0] * (x - center[0]) + plane[1] * (y - center[1]) + plane[2]
    return d > 0 and abs(d - expected) < tolerance


@njit(cache=True)
def _is_near(one, other, max_gap, tolerance):  # type: ignore[no-untyped-def]
    """Return whether two depths, given as disparities, differ by less than gap and noise."""
    return abs(one - other) < max_gap * one * other + tolerance


@njit(cache=True)
def _label_rest(disparity, labels, first, max_gap, tolerance):  # type: ignore[no-untyped-def]
    """Label what lies on no plane by what hangs together, from `first` on; return the next label.

    Neighbours may be two pixels apart, as edges often lose one.
    """
    height, width = disparity.shape
    queue = np.empty((height * width, 2), np.int32)
    label = first
    for seed_row in range(height):
        for seed_col in range(width):
            if labels[seed_row, seed_col] != UNFIT or disparity[seed_row, seed_col] == 0:
                continue
            labels[seed_row, seed_col] = label
            queue[0, 0], queue[0, 1] = seed_row, seed_col
            head, tail = 0, 1
            while head < tail:
                row, col = queue[head, 0], queue[head, 1]
                head += 1
                for y in range(max(row - 2, 0), min(row + 3, height)):
                    for x in range(max(col - 2, 0), min(col + 3, width)):
                        if labels[y, x] != UNFIT or disparity[y, x] == 0:
                            continue
                        if _is_near(disparity[row, col], disparity[y, x], max_gap, tolerance):
                            labels[y, x] = label
                            queue[tail, 0], queue[tail, 1] = y, x
                            tail += 1
            label += 1
    return label


@njit(cache=True)
def _borders(disparity, labels, count, max_gap, tolerance):  # type: ignore[no-untyped-def]
    """Return how often each surface ends before something farther, and behind something nearer.

    Where there is no depth for more than `LOST` pixels, things are too far away to be measured.
    """
    near, far = np.zeros(count), np.zeros(count)
    height, width = disparity.shape
    for axis in range(2):
        for i in range(height if axis == 0 else width):
            last, last_label, last_d = -1 - LOST, UNFIT, np.float32(0)
            for j in range(width if axis == 0 else height):
                y, x = (i, j) if axis == 0 else (j, i)
                d, label = disparity[y, x], labels[y, x]
                if d == 0:
                    if last_label != UNFIT and j - last == LOST + 1:
                        near[last_label] += 1
                    continue
                if j - last > LOST:
                    if j > LOST:
                        near[label] += 1
                elif label != last_label and not _is_near(d, last_d, max_gap, tolerance):
                    near[label if d > last_d else last_label] += 1
                    far[last_label if d > last_d else label] += 1
                last, last_label, last_d = j, label, d
    return near, far
