"""The planes of an image: joined blocks of pixels, and the pixels on these planes.

A plane is d = a u + b v + c of the disparity d, with u and v relative to the principal point.
Sums over pixels have ten entries: n, u, v, uu, uv, vv, d, ud, vd, dd.

Source: Feng, Taguchi, Kamat, "Fast plane extraction in organized point clouds using agglomerative
hierarchical clustering", ICRA 2014, for planes from blocks of pixels.
"""

from __future__ import annotations

import math

import numpy as np
from numba import uint64
from numpy.typing import NDArray

from hypermap._loops import inner_loop, loop
from hypermap.core.arrays import BoolArray, IntArray
from hypermap.perception.config import PerceptionConfig
from hypermap.perception.frame import Camera

BLOCK = 0.03  # side of a block as a share of the focal length: 8 pixels of a 320 x 240 Kinect
MIN_FILL = 0.6  # share of a block's pixels that must have a point
MIN_BLOCKS = 3  # fewer are part of something round or small

# How far from a plane, in standard deviations of the noise:
FLAT = 1.5  # root mean square of a block's pixels from its own plane
LEVEL = 2.0  # mean of a block from the plane that it joins
ON_PLANE = 3.0  # a pixel from the plane that it joins

UNFIT = -1


def find_planes(
    disparity: NDArray[np.float32], camera: Camera, config: PerceptionConfig
) -> tuple[NDArray[np.int32], int]:
    """Return the plane of each pixel, and how many planes there are.

    Args:
        disparity: 1 / depth [1/m], 0 where there is no point, shape (H, W).
        camera: intrinsics.
        config: noise and thresholds.

    Returns:
        The plane of each pixel, -1 for none, shape (H, W); and the number of planes.
    """
    K, noise = camera.K, config.depth_noise
    center, focal = (K[0, 2], K[1, 2]), (K[0, 0], K[1, 1])
    side = max(round(BLOCK * min(focal)), 4)
    cosine = math.cos(math.radians(config.smoothness_deg))
    h, w = disparity.shape[0] // side, disparity.shape[1] // side
    sums, columns = np.zeros((h, w, 10)), np.empty((6, w * side))
    _sum_blocks(disparity, center, side, columns, sums)
    planes, flatness = np.zeros((h, w, 3)), np.full((h, w), np.inf)
    _fit_blocks(sums, MIN_FILL * side * side, FLAT * noise, planes, flatness)
    seeds, is_free = np.argsort(flatness, axis=None, kind="stable"), flatness < np.inf
    blocks, found = np.full((h, w), UNFIT), np.empty((h * w, 3))
    queue, total = np.empty(h * w, np.int64), np.empty(10)
    scratch = is_free, queue, total
    count = _join_blocks(sums, planes, seeds, focal, cosine, LEVEL * noise, *scratch, blocks, found)
    around = np.full((h + 2, w + 2), UNFIT)
    around[1:-1, 1:-1] = blocks
    neighbors = around[1:-1, :-2], around[1:-1, 2:], around[:-2, 1:-1], around[2:, 1:-1]
    borders = np.stack([other != blocks for other in neighbors], axis=-1)
    labels = np.full(disparity.shape, UNFIT, np.int32)
    places = np.empty((disparity.size, 2), np.int32)
    _spread(disparity, blocks, found, center, side, ON_PLANE * noise, borders, places, labels)
    return labels, count


@loop()
def _sum_blocks(
    disparity: NDArray[np.float32],
    center: tuple[float, float],
    side: int,
    columns: NDArray[np.float64],
    sums: NDArray[np.float64],
) -> None:
    """Add up the sums, initially zero, over each block of pixels, shape (h, w, 10).

    The sums n, v, vv, d, vd, dd over each column of a row of blocks need a buffer, (6, w * side).
    """
    h, w = sums.shape[:2]
    for row in range(h):
        for entry in range(6):
            for x in range(columns.shape[1]):
                columns[entry, x] = 0
        for y in range(row * side, row * side + side):
            _add_row(columns, disparity[y], y - center[1])
        for col in range(w):
            block = sums[row, col]
            for x in range(col * side, col * side + side):
                u, n = x - center[0], columns[0, x]
                block[0] += n
                block[1] += u * n
                block[2] += columns[1, x]
                block[3] += u * u * n
                block[4] += u * columns[1, x]
                block[5] += columns[2, x]
                block[6] += columns[3, x]
                block[7] += u * columns[3, x]
                block[8] += columns[4, x]
                block[9] += columns[5, x]


@inner_loop()
def _add_row(columns: NDArray[np.float64], disparity: NDArray[np.float32], v: float) -> None:
    """Add a row of the image to the sums of its columns, in a loop without branches."""
    for x in range(columns.shape[1]):
        d = np.float64(disparity[x])
        n = 1.0 if d > 0 else 0.0
        columns[0, x] += n
        columns[1, x] += n * v
        columns[2, x] += n * (v * v)
        columns[3, x] += d
        columns[4, x] += v * d
        columns[5, x] += d * d


@loop()
def _fit_blocks(
    sums: NDArray[np.float64],
    fewest: float,
    tolerance: float,
    planes: NDArray[np.float64],
    flatness: NDArray[np.float64],
) -> None:
    """Fit a plane to each block that has enough points.

    Args:
        sums: of the blocks, shape (h, w, 10).
        fewest: points of a block.
        tolerance: largest root mean square distance from the plane.
        planes: zeros; receives the blocks' a, b, c, shape (h, w, 3).
        flatness: infinite; receives these distances where there is a plane, shape (h, w).
    """
    h, w = sums.shape[:2]
    for row in range(h):
        for col in range(w):
            if sums[row, col, 0] >= fewest:
                distance = _fit(sums[row, col], planes[row, col])
                if distance < tolerance:
                    flatness[row, col] = distance


@inner_loop()
def _fit(sums: NDArray[np.float64], plane: NDArray[np.float64]) -> float:
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


@inner_loop()
def _cosine(
    one: NDArray[np.float64], other: NDArray[np.float64], focal: tuple[float, float]
) -> float:
    """Return the cosine between the normals of two planes, (a fx, b fy, c) each."""
    fx2, fy2 = focal[0] ** 2, focal[1] ** 2
    dot = one[0] * other[0] * fx2 + one[1] * other[1] * fy2 + one[2] * other[2]
    length2 = one[0] ** 2 * fx2 + one[1] ** 2 * fy2 + one[2] ** 2
    other2 = other[0] ** 2 * fx2 + other[1] ** 2 * fy2 + other[2] ** 2
    return float(dot / math.sqrt(max(length2 * other2, 1e-30)))


@loop()
def _join_blocks(
    sums: NDArray[np.float64],
    planes: NDArray[np.float64],
    seeds: IntArray,
    focal: tuple[float, float],
    cosine: float,
    tolerance: float,
    is_free: BoolArray,
    queue: IntArray,
    total: NDArray[np.float64],
    plane_of: IntArray,
    found: NDArray[np.float64],
) -> int:
    """Grow planes over neighboring blocks, flattest first; each block refines its plane.

    Args:
        sums: of the blocks, shape (h, w, 10).
        planes: of the blocks, shape (h, w, 3).
        seeds: all blocks by flatness, shape (h * w,).
        focal: focal lengths [pixels].
        cosine: smallest cosine between the normals of a block and the plane that it joins.
        tolerance: largest distance of the block's mean from that plane.
        is_free: which blocks are a plane and not yet joined; changed, shape (h, w).
        queue: buffer for all blocks, shape (h * w,).
        total: buffer for sums, shape (10,).
        plane_of: -1; receives the plane of each block, shape (h, w).
        found: receives these planes, shape (h * w, 3).

    Returns:
        How many planes there are.
    """
    h, w = plane_of.shape
    count = 0
    for seed in seeds:
        row, col = seed // w, seed % w
        if not is_free[row, col]:
            continue
        is_free[row, col] = False
        plane = found[count]
        for i in range(10):
            total[i] = sums[row, col, i]
        for i in range(3):
            plane[i] = planes[row, col, i]
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
                for i in range(10):
                    total[i] += block[i]
                _fit(total, plane)
        if tail >= MIN_BLOCKS:
            for k in range(tail):
                plane_of[queue[k] // w, queue[k] % w] = count
            count += 1
    return count


@loop()
def _spread(
    disparity: NDArray[np.float32],
    blocks: IntArray,
    planes: NDArray[np.float64],
    center: tuple[float, float],
    side: int,
    tolerance: float,
    borders: BoolArray,
    queue: NDArray[np.int32],
    labels: NDArray[np.int32],
) -> None:
    """Label with its plane, else -1, each pixel of its blocks and all connected ones.

    Borders say whether the blocks to the left and right, above and below are of another
    plane, shape (h, w, 4). The queue is a buffer for row and column of all pixels, (H * W, 2).
    """
    height, width = disparity.shape
    _label_blocks(disparity, blocks, planes, center, side, tolerance, labels)
    head, tail = 0, 0
    for row in range(blocks.shape[0]):
        for col in range(blocks.shape[1]):
            k = blocks[row, col]
            if k == UNFIT:
                continue
            # The pixels inside its blocks are already labeled.
            left, right = borders[row, col, 0], borders[row, col, 1]
            above, below = borders[row, col, 2], borders[row, col, 3]
            for y in range(side):
                is_whole = (above and y == 0) or (below and y == side - 1)
                for x in range(0, side, 1 if is_whole else side - 1):
                    at_y, at_x = row * side + y, col * side + x
                    is_end = is_whole or (left if x == 0 else right)
                    if is_end and labels[at_y, at_x] == k:
                        queue[tail, 0], queue[tail, 1] = at_y, at_x
                        tail += 1
    while head < tail:
        row, col = queue[head, 0], queue[head, 1]
        head += 1
        k = labels[row, col]
        for step in range(4):
            y, x = row + (step == 0) - (step == 1), col + (step == 2) - (step == 3)
            if not (0 <= y < height and 0 <= x < width) or labels[y, x] != UNFIT:
                continue
            u, v = x - center[0], y - center[1]
            if _is_on(disparity[y, x], planes[k, 0], planes[k, 1], planes[k, 2], u, v, tolerance):
                labels[y, x] = k
                queue[tail, 0], queue[tail, 1] = y, x
                tail += 1


@inner_loop()
def _label_blocks(disparity, blocks, planes, center, side, tolerance, labels):  # type: ignore[no-untyped-def]
    """Label each pixel that is on the plane of its block."""
    unfit = np.int32(UNFIT)
    for y in range(blocks.shape[0] * side):
        v = y - center[1]
        for col in range(blocks.shape[1]):
            k = np.int32(blocks[y // side, col])
            if k == unfit:
                continue
            a, b, c = planes[k, 0], planes[k, 1], planes[k, 2]
            for x in range(uint64(col * side), uint64(col * side + side)):  # without branches
                u = np.float64(x) - center[0]
                labels[y, x] = k if _is_on(disparity[y, x], a, b, c, u, v, tolerance) else unfit


@inner_loop()
def _is_on(d: float, a: float, b: float, c: float, u: float, v: float, tolerance: float) -> bool:
    return (d > 0) & (abs(d - (a * u + b * v + c)) < tolerance)
