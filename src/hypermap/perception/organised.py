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
    LARGEST,
    MARGIN,
    WINDOWS,
    fit_planes,
    nearest,
    planes_of,
    reach,
)

# What a pixel is to a growing region.
NOTHING, FREE, FOREIGN = 0, 1, 2


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
    planes = planes_of(points, valid)
    places = [_places(pixels, camera, planes.shape[2]) for pixels in objects]
    wanted = np.zeros(planes[0].size, dtype=np.bool_)
    for own in places:
        wanted[own] = True
    normals, curvatures, radii2 = fit_planes(
        planes, np.flatnonzero(wanted), config.normal_neighbors, config.region_neighbors, pitch
    )
    spreads = curvatures <= config.curvature_threshold
    cosine = np.cos(np.radians(config.smoothness_deg))
    state_of_others = np.where(planes[2].ravel() < FAR, FOREIGN, NOTHING).astype(np.uint8)
    regions = []
    for own in places:
        state = state_of_others.copy()
        state[own] = FREE
        seeds = own[np.argsort(curvatures[own], kind="stable")]
        k = config.region_neighbors
        region_of = _flood(planes, state, seeds, normals, spreads, radii2, k, cosine, pitch)
        regions.append(region_of[own])
    return regions


def _places(pixels: IntArray, camera: Camera, stride: int) -> IntArray:
    """Return where pixels lie in a plane with margins."""
    row, column = np.divmod(pixels, camera.width)
    return (row + MARGIN) * stride + column + MARGIN


def _pitch(camera: Camera) -> float:
    """Return the least distance from a point to the rays one pixel away, per metre of depth.

    The rays of one column lie in a plane; a point at depth z, one column beside it, is
    z / fx / sqrt(1 + a^2) away, where a is the plane's slope. Rows likewise.
    """
    K = camera.K
    pitch = np.inf
    for f, c, size in ((K[0, 0], K[0, 2], camera.width), (K[1, 1], K[1, 2], camera.height)):
        steepest = max(abs(c), abs(size - 1 - c)) / f
        pitch = min(pitch, 1 / (f * np.hypot(1, steepest)))
    return float(pitch)


@njit(cache=True)
def _flood(  # type: ignore[no-untyped-def]
    planes, state, seeds, normals, spreads, radii2, k, cosine, pitch
):
    """Grow one region after the other, from the flattest point that is still free."""
    stride = planes.shape[2]
    x, y, z = planes[0].ravel(), planes[1].ravel(), planes[2].ravel()
    own_z = np.where(state == FREE, z, FAR)
    region_of = np.full(len(z), -1, np.int32)
    queue = np.empty(len(seeds), np.int64)
    distances2 = np.empty(LARGEST, np.float32)
    region = 0
    for seed in seeds:
        if state[seed] != FREE:
            continue
        region_of[seed] = region
        state[seed] = NOTHING
        queue[0] = seed
        head, tail = 0, 1
        while head < tail:
            place = queue[head]
            head += 1
            radius2 = radii2[place]
            window = _window_of(radius2, z[place], pitch)
            states = _states_around(state, stride, place, window)
            if states & FOREIGN:  # so the object's own neighbours lie farther away
                radius2, window = nearest(x, y, own_z, stride, place, k, pitch, distances2)
            elif states == NOTHING:
                continue
            half, columns = WINDOWS[window]
            for row in range(-half, half + 1):
                start = place + row * stride - columns // 2 + 1
                for other in range(start, start + columns):
                    if state[other] != FREE:
                        continue
                    dx, dy, dz = x[other] - x[place], y[other] - y[place], z[other] - z[place]
                    if dx * dx + dy * dy + dz * dz > radius2:
                        continue
                    dot = np.float32(0)
                    for axis in range(3):
                        dot += normals[place, axis] * normals[other, axis]
                    if abs(dot) < cosine:
                        continue
                    region_of[other] = region
                    state[other] = NOTHING
                    if spreads[other]:
                        queue[tail] = other
                        tail += 1
        region += 1
    return region_of


@njit(cache=True)
def _window_of(radius2, depth, pitch):  # type: ignore[no-untyped-def]
    """Return the smallest window that holds all points within a squared radius."""
    for window in range(len(WINDOWS)):
        if radius2 < reach(window, depth, pitch) ** 2:
            break
    return window


@njit(cache=True)
def _states_around(state, stride, place, window):  # type: ignore[no-untyped-def]
    """Return all states in a window, or-ed."""
    half, columns = WINDOWS[window]
    found = np.uint8(0)
    for row in range(-half, half + 1):
        start = uint64(place + row * stride - columns // 2 + 1)
        for column in range(uint64(columns)):
            found |= state[start + column]
    return found
