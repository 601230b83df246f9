"""The fast method: nearly the same regions, with neighbours looked up in the image."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numba import njit, uint64
from numpy.typing import NDArray

from hypermap.core.arrays import BoolArray, IntArray
from hypermap.perception.config import PerceptionConfig
from hypermap.perception.frame import Camera
from hypermap.perception.normals import MARGIN, fit_planes, planes_of

# Neighbours are looked for in as many rows below a pixel, in twice as many columns around it.
SEARCH = 4
# Here neighbourhood is mutual, in PCL it is not: that loses about as many neighbours as a third
# more brings in.
MUTUAL = 4 / 3

NOTHING = -1  # the parent of a place that is not of the object


def grow_regions(
    points: NDArray[np.float32],
    valid: BoolArray,
    camera: Camera,
    objects: Sequence[IntArray],
    config: PerceptionConfig,
) -> list[IntArray]:
    """Return the region of each pixel of each object.

    Does about the same as `unorganised.grow_regions`, whose arguments it shares. Two points join
    if each is among the other's neighbours and their normals agree, and regions are what hangs
    together so. A point above the curvature threshold joins one region, but not two with each
    other.
    """
    if not objects:
        return []
    planes = planes_of(points, valid)
    stride, size = planes.shape[2], planes[0].size
    places = [_places(pixels, camera.width, stride) for pixels in objects]
    wanted = _union(places, size)
    fitted, curvatures, radii2 = fit_planes(planes, wanted, config.normal_neighbors, _pitch(camera))
    share = np.float32(MUTUAL * config.region_neighbors / config.normal_neighbors)
    normals, reach2 = _spread_out(wanted, size, fitted, radii2 * share)
    reach2[wanted[curvatures > config.curvature_threshold]] *= -1
    cosine = np.float32(np.cos(np.radians(config.smoothness_deg)))
    return [_join(planes, own, normals, reach2, cosine) for own in places]


def _pitch(camera: Camera) -> float:
    """Return the distance between neighbouring points of a surface that faces the camera at 1 m."""
    return float(1 / max(camera.K[0, 0], camera.K[1, 1]))


@njit(cache=True)
def _places(pixels, width, stride):  # type: ignore[no-untyped-def]
    """Return where pixels lie in a plane with margins."""
    places = np.empty(len(pixels), np.int64)
    for i, pixel in enumerate(pixels):
        row = pixel // width
        places[i] = (row + MARGIN) * stride + pixel - row * width + MARGIN
    return places


def _union(parts: Sequence[IntArray], size: int) -> IntArray:
    """Return the numbers below a size that are in any of some parts, increasing."""
    if len(parts) == 1:
        return parts[0]
    is_in = np.zeros(size, dtype=np.bool_)
    for part in parts:
        is_in[part] = True
    return np.flatnonzero(is_in)


@njit(cache=True)
def _spread_out(places, size, normals, reach2):  # type: ignore[no-untyped-def]
    """Return the values of some places as planes; those of the others mean nothing."""
    normal_planes, reach2_plane = np.empty((3, size), np.float32), np.empty(size, np.float32)
    for i, place in enumerate(places):
        for axis in range(3):
            normal_planes[axis, place] = normals[axis, i]
        reach2_plane[place] = reach2[i]
    return normal_planes, reach2_plane


@njit(cache=True)
def _join(planes, places, normals, reach2, cosine):  # type: ignore[no-untyped-def]
    """Return the region of each of some places: a number, the same for all that hang together.

    Regions are trees: each place has a parent in the same region, and a root is its own parent.
    First what lies side by side joins, which is nearly all; then, at the borders of these
    regions only, what lies farther apart.
    """
    stride = planes.shape[2]
    x, y, z = planes[0].ravel(), planes[1].ravel(), planes[2].ravel()
    parent = np.full(len(x), NOTHING, np.int32)
    for place in places:
        parent[place] = place
    for place in places:
        for other in (place - 1, place - stride):
            if parent[other] == parent[place]:
                continue
            if _joins(x, y, z, normals, reach2, parent, place, other, cosine):
                _link(parent, place, other)
    for place in places:
        parent[place] = _root(parent, place)
    for place in places:
        for row in range(SEARCH + 1):
            # In its own row what lies to the right, else twice as many columns around it.
            start = place + 1 if row == 0 else place + row * stride - SEARCH
            columns = SEARCH if row == 0 else 2 * SEARCH
            if not _has_others(parent, place, start):
                continue
            for other in range(start, start + columns):
                if _joins(x, y, z, normals, reach2, parent, place, other, cosine):
                    _link(parent, place, other)
    numbers = np.empty(len(x), np.int32)  # of the regions, at their roots
    count = 0
    for place in places:
        if parent[place] == place:
            numbers[place] = count
            count += 1
    regions = np.empty(len(places), np.int64)
    for i, place in enumerate(places):
        is_bent = reach2[place] < 0
        home = _home(x, y, z, normals, reach2, parent, place, stride, cosine) if is_bent else place
        regions[i] = numbers[_root(parent, home)]
    return regions


@njit(cache=True)
def _joins(x, y, z, normals, reach2, parent, one, other, cosine):  # type: ignore[no-untyped-def]
    """Return whether a place joins one of another region: both are near, their normals agree."""
    nx, ny, nz = normals[0], normals[1], normals[2]
    dx, dy, dz = x[other] - x[one], y[other] - y[one], z[other] - z[one]
    distance2 = dx * dx + dy * dy + dz * dz
    dot = nx[other] * nx[one] + ny[other] * ny[one] + nz[other] * nz[one]
    return (
        (parent[other] != NOTHING)
        & (parent[other] != parent[one])
        & (distance2 <= reach2[one])
        & (distance2 <= reach2[other])
        & (abs(dot) >= cosine)
    )


@njit(cache=True)
def _home(x, y, z, normals, reach2, parent, place, stride, cosine):  # type: ignore[no-untyped-def]
    """Return which of the pixels around takes a place that is bent too much to join by itself."""
    reach2[place] *= -1
    home = place
    for row in range(-1, 2):
        for other in range(place + row * stride - 1, place + row * stride + 2):
            if reach2[other] >= 0 and _joins(
                x, y, z, normals, reach2, parent, place, other, cosine
            ):
                home = other
    reach2[place] *= -1
    return home


@njit(cache=True)
def _has_others(parent, place, start):  # type: ignore[no-untyped-def]
    """Return whether some places in a row are of the object, but not known to be of a region."""
    own, found = parent[place], False
    for column in range(uint64(2 * SEARCH)):
        other = parent[uint64(start) + column]
        found |= (other != own) & (other != NOTHING)
    return found


@njit(cache=True)
def _root(parent, place):  # type: ignore[no-untyped-def]
    """Return the root of a place's region; the way there is half as long the next time."""
    while parent[place] != place:
        parent[place] = parent[parent[place]]
        place = parent[place]
    return place


@njit(cache=True)
def _link(parent, one, other):  # type: ignore[no-untyped-def]
    """Make two regions one."""
    root, other_root = _root(parent, one), _root(parent, other)
    if root < other_root:
        parent[other_root] = root
    else:
        parent[root] = other_root
