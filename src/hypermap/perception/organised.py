"""The fast method: nearly the same regions, with neighbours looked up in the image."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numba import njit, uint64
from numpy.typing import NDArray

from hypermap.core.arrays import BoolArray, IntArray
from hypermap.perception.config import PerceptionConfig
from hypermap.perception.frame import Camera
from hypermap.perception.normals import fit_planes
from hypermap.perception.padded import MARGIN, planes_of

# Neighbours are looked for in as many rows below a pixel, in twice as many columns around it.
SEARCH = 4
# Here neighbourhood is mutual, in PCL it is not: that loses about as many neighbours as a third
# more brings in.
MUTUAL = 4 / 3

NOTHING = -1  # the label of a place that is not of the object
TOGETHER = 2 * SEARCH  # so many pixels of a row are looked at together

Planes = tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]  # x, y, z


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
    extents = np.array([_extent(pixels, camera.width) for pixels in objects])
    top, left = extents[:, :2].min(axis=0)
    bottom, right = extents[:, 2:].max(axis=0)
    planes = planes_of(points, valid, top, left, bottom, right)
    size, stride = planes[0].size, planes.shape[2]
    places = [_places(pixels, camera.width, top, left, stride) for pixels in objects]
    wanted = np.zeros(size, dtype=np.bool_)
    for own in places:
        wanted[own] = True
    k = config.normal_neighbors
    focal = camera.K[0, 0], camera.K[1, 1]
    normals, curvatures, radii2 = fit_planes(planes, wanted.reshape(-1, stride), k, focal)
    share = np.float32(MUTUAL * config.region_neighbors / k)
    reach2 = radii2.ravel()
    _set_reach(reach2, wanted, curvatures.ravel(), share, config.curvature_threshold)
    cosine = np.float32(np.cos(np.radians(config.smoothness_deg)))
    labels = np.full(size, NOTHING, np.int32)
    return [_join(planes, own, normals, reach2, cosine, labels) for own in places]


@njit(cache=True)
def _extent(pixels: IntArray, width: int) -> tuple[int, int, int, int]:
    """Return the first row and column of increasing pixels, and those behind the last."""
    top = pixels[0] // width
    left, right, row_start = width, 0, top * width
    for pixel in pixels:
        while pixel - row_start >= width:
            row_start += width
        left, right = min(left, pixel - row_start), max(right, pixel - row_start + 1)
    return top, left, row_start // width + 1, right


@njit(cache=True)
def _places(pixels: IntArray, width: int, top: int, left: int, stride: int) -> IntArray:
    """Return where pixels lie in a plane with margins."""
    places = np.empty(len(pixels), np.int64)
    row = pixels[0] // width
    for i, pixel in enumerate(pixels):
        while pixel - row * width >= width:
            row += 1
        places[i] = (row - top + MARGIN) * stride + pixel - row * width - left + MARGIN
    return places


@njit(cache=True)
def _set_reach(
    radii2: NDArray[np.float32],
    wanted: BoolArray,
    curvatures: NDArray[np.float32],
    share: np.float32,
    threshold: float,
) -> None:
    """Make squared radii the squared reach of the points, negative where they are bent."""
    for place in range(len(wanted)):
        if wanted[place]:
            radii2[place] *= -share if curvatures[place] > threshold else share


@njit(cache=True)
def _join(
    planes: NDArray[np.float32],
    places: IntArray,
    normals: NDArray[np.float32],
    reach2: NDArray[np.float32],
    cosine: np.float32,
    labels: NDArray[np.int32],
) -> IntArray:
    """Return the region of each of some places: a number, the same for all that hang together.

    Each place gets a label, and labels are linked to a tree for each region: a label has a parent
    in the same region, and a root is its own parent. First what lies side by side joins, which is
    nearly all; then, where labels meet, what lies farther apart.

    Args:
        planes: the cloud with its margins, shape (3, H, W).
        places: of the object, increasing, shape (N,).
        normals: of the points there, shape (3, H, W).
        reach2: squared distances, negative where a point is bent, shape (H * W,).
        cosine: least cosine of the angle between normals that agree.
        labels: `NOTHING` everywhere, and left so, shape (H * W,).
    """
    stride = planes.shape[2]
    cloud = planes[0].ravel(), planes[1].ravel(), planes[2].ravel()
    axes = normals[0].ravel(), normals[1].ravel(), normals[2].ravel()
    parent = np.empty(len(places), np.int32)
    count = 0
    for place in places:
        label, above = labels[place - 1], labels[place - stride]
        if label != NOTHING and not _joins(cloud, axes, reach2, place, place - 1, cosine):
            label = NOTHING
        is_new = above != NOTHING and above != label
        if is_new and _joins(cloud, axes, reach2, place, place - stride, cosine):
            if label == NOTHING:
                label = above
            else:
                _link(parent, label, above)
        if label == NOTHING:
            label = count
            parent[count] = count
            count += 1
        labels[place] = label
    for label in range(count):
        parent[label] = parent[parent[label]]  # the root: parents have the smaller numbers
    for place in places:
        labels[place] = parent[labels[place]]

    looked_to, is_border = -1, False
    for place in places:
        if place >= looked_to:
            looked_to = place + TOGETHER
            is_border = False
            for row in range(SEARCH + 1):
                start = place + row * stride - SEARCH
                is_border |= _has_others(labels, place, start)
                is_border |= _has_others(labels, place, start + TOGETHER)
        if is_border and _any_joins(cloud, axes, reach2, place, stride, cosine, labels):
            _join_far(cloud, axes, reach2, place, stride, cosine, labels, parent)

    regions = np.empty(len(places), np.int64)
    for i, place in enumerate(places):
        is_bent = reach2[place] < 0
        home = _home(cloud, axes, reach2, place, stride, cosine, labels) if is_bent else place
        regions[i] = _root(parent, labels[home])
    labels[places] = NOTHING
    return regions


@njit(cache=True)
def _joins(
    cloud: Planes,
    axes: Planes,
    reach2: NDArray[np.float32],
    one: int,
    other: int,
    cosine: np.float32,
) -> bool:
    """Return whether two places of an object join: both are near, and their normals agree."""
    (x, y, z), (nx, ny, nz) = cloud, axes
    dx, dy, dz = x[other] - x[one], y[other] - y[one], z[other] - z[one]
    distance2 = dx * dx + dy * dy + dz * dz
    dot = nx[other] * nx[one] + ny[other] * ny[one] + nz[other] * nz[one]
    near = (distance2 <= reach2[one]) & (distance2 <= reach2[other])
    return bool(near & (abs(dot) >= cosine))


@njit(cache=True)
def _has_others(labels, place, start):  # type: ignore[no-untyped-def]
    """Return whether places of the object in a row have another label."""
    own, found = labels[place], False
    for column in range(uint64(TOGETHER)):
        other = labels[uint64(start) + column]
        found |= (other != own) & (other != NOTHING)
    return found


@njit(cache=True)
def _any_joins(cloud, axes, reach2, place, stride, cosine, labels):  # type: ignore[no-untyped-def]
    """Return whether a place joins any below or beside it that has another label.

    It is the same question as in `_join_far`, without a branch, so that it is asked of eight
    columns at once.
    """
    own, found = labels[place], False
    for column in range(uint64(2 * SEARCH)):
        for row in range(SEARCH + 1):
            other = uint64(place + row * stride - SEARCH + 1) + column
            is_other = (labels[other] != own) & (labels[other] != NOTHING)
            found |= is_other & _joins(cloud, axes, reach2, place, other, cosine)
    return found


@njit(cache=True)
def _join_far(
    cloud: Planes,
    axes: Planes,
    reach2: NDArray[np.float32],
    place: int,
    stride: int,
    cosine: np.float32,
    labels: NDArray[np.int32],
    parent: NDArray[np.int32],
) -> None:
    """Join a place with those below and beside it, as far as `SEARCH`."""
    for row in range(SEARCH + 1):
        for column in range(1 - SEARCH, SEARCH + 1):
            other = place + row * stride + column
            if labels[other] != NOTHING and _joins(cloud, axes, reach2, place, other, cosine):
                _link(parent, labels[place], labels[other])


@njit(cache=True)
def _home(
    cloud: Planes,
    axes: Planes,
    reach2: NDArray[np.float32],
    place: int,
    stride: int,
    cosine: np.float32,
    labels: NDArray[np.int32],
) -> int:
    """Return which of the pixels around takes a place that is bent too much to join by itself."""
    reach2[place] *= -1
    home = place
    for row in range(-1, 2):
        for other in range(place + row * stride - 1, place + row * stride + 2):
            if labels[other] != NOTHING and _joins(cloud, axes, reach2, place, other, cosine):
                home = other
    reach2[place] *= -1
    return home


@njit(cache=True)
def _root(parent: NDArray[np.int32], label: int) -> int:
    """Return the root of a label's region; the way there is half as long the next time."""
    while parent[label] != label:
        parent[label] = parent[parent[label]]
        label = parent[label]
    return label


@njit(cache=True)
def _link(parent: NDArray[np.int32], one: int, other: int) -> None:
    """Make two regions one."""
    root, other_root = _root(parent, one), _root(parent, other)
    parent[max(root, other_root)] = min(root, other_root)
