"""The fast method: the same normals and regions, with neighbours looked up in the image."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numba import njit, uint64
from numpy.typing import NDArray

from hypermap.core.arrays import BoolArray, IntArray
from hypermap.perception.config import PerceptionConfig
from hypermap.perception.frame import Camera
from hypermap.perception.normals import (
    FAR,
    MARGIN,
    WINDOWS,
    fit_planes,
    nearest,
    planes_of,
    reach,
)

SMALL = 1  # the window of WINDOWS that holds the neighbours of nearly all points
OUTSIDE, FREE, FOREIGN = 0, 1, 2  # what a pixel is to a growing region


def grow_regions(
    points: NDArray[np.float32],
    valid: BoolArray,
    camera: Camera,
    objects: Sequence[IntArray],
    config: PerceptionConfig,
) -> list[IntArray]:
    """Return the region of each pixel of each object.

    Does the same as `unorganised.grow_regions`, whose arguments it shares. The neighbours are the
    same too, unless some lie more than 31 pixels away or tie for the last place.
    """
    if not objects:
        return []
    pitch = _pitch(camera)
    cloud = planes_of(points, valid)
    wanted = np.unique(np.concatenate(objects))
    row, column = np.divmod(wanted, camera.width)
    at = (row + MARGIN) * cloud.shape[2] + column + MARGIN
    normals, curvatures, radii2 = fit_planes(cloud, at, config.normal_neighbors, pitch)
    if config.region_neighbors > config.normal_neighbors:
        radii2[:] = np.inf  # says nothing of where the region's neighbours lie
    regions = []
    for pixels in objects:
        own = np.searchsorted(wanted, pixels)
        row, column = np.divmod(pixels, camera.width)
        top, left = row.min(), column.min()
        window = (
            slice(top, row.max() + 1 + 2 * MARGIN),
            slice(left, column.max() + 1 + 2 * MARGIN),
        )
        crop = np.ascontiguousarray(cloud[(slice(None), *window)])
        at = (row - top + MARGIN) * crop.shape[2] + column - left + MARGIN
        state = np.where(crop[2] < FAR, FOREIGN, OUTSIDE).astype(np.uint8)
        state.flat[at] = FREE
        crop[:, state != FREE] = FAR
        index_of = np.full(state.shape, -1, np.int32)
        index_of.flat[at] = np.arange(len(at))
        regions.append(
            _flood(
                crop,
                state.ravel(),
                index_of.ravel(),
                at,
                np.argsort(curvatures[own], kind="stable"),
                normals[own],
                radii2[own],
                curvatures[own] <= config.curvature_threshold,
                config.region_neighbors,
                np.float32(np.cos(np.radians(config.smoothness_deg))),
                pitch,
            )
        )
    return regions


def _pitch(camera: Camera) -> float:
    """Return the least distance from a point to the rays one pixel away, per metre of depth.

    The rays of one column lie in a plane; a point at depth z, one column beside it, is
    z / fx / sqrt(1 + a^2) away, where a is the plane's slope. Rows likewise.
    """
    K = camera.K
    pitch = np.inf
    for f, c, size in ((K[0, 0], K[0, 2], camera.width), (K[1, 1], K[1, 2], camera.height)):
        steepest = max(abs(0 - c), abs(size - 1 - c)) / f
        pitch = min(pitch, 1 / (f * np.hypot(1, steepest)))
    return float(pitch)


@njit(cache=True)  # type: ignore[untyped-decorator]
def _flood(  # type: ignore[no-untyped-def]
    planes, state, index_of, at, seeds, normals, radii2, spreads, k, cosine, pitch
):
    """Grow one region after the other, from the flattest point that is still free."""
    region_of = np.full(len(at), -1)
    queue = np.empty(len(at), np.int64)
    stride = planes.shape[2]
    x, y, z = planes[0].ravel(), planes[1].ravel(), planes[2].ravel()
    distances2 = np.empty((2 * MARGIN) ** 2, np.float32)
    region = 0
    for seed in seeds:
        if region_of[seed] >= 0:
            continue
        region_of[seed] = region
        state[at[seed]] = OUTSIDE
        queue[0] = seed
        head, tail = 0, 1
        while head < tail:
            point = queue[head]
            head += 1
            pixel = at[point]
            if radii2[point] < reach(z[pixel], pitch, SMALL) ** 2 and _is_done(
                state, stride, pixel
            ):
                continue  # all its neighbours have been taken
            radius2, window = nearest(x, y, z, stride, pixel, k, pitch, distances2)
            half, columns = WINDOWS[window]
            for i in range((2 * half + 1) * columns):
                if distances2[i] > radius2:
                    continue
                other_pixel = (
                    pixel + (i // columns - half) * stride + i % columns - columns // 2 + 1
                )
                if state[other_pixel] != FREE:
                    continue
                other = index_of[other_pixel]
                dot = (
                    normals[point, 0] * normals[other, 0]
                    + normals[point, 1] * normals[other, 1]
                    + normals[point, 2] * normals[other, 2]
                )
                if abs(dot) >= cosine:
                    region_of[other] = region
                    state[other_pixel] = OUTSIDE
                    if spreads[other]:
                        queue[tail] = other
                        tail += 1
        region += 1
    return region_of


@njit(cache=True)  # type: ignore[untyped-decorator]
def _is_done(state: NDArray[np.uint8], stride: int, pixel: int) -> bool:
    """Return whether no point around a pixel is free, or foreign and so not counted."""
    half, columns = WINDOWS[SMALL]
    found = np.uint8(0)
    for row in range(-half, half + 1):
        start = uint64(pixel + row * stride - columns // 2 + 1)
        for column in range(uint64(columns)):
            found |= state[start + column]
    return found == 0
