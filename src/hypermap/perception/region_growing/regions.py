"""Compiled search for connected components in an image of points with normals."""

from __future__ import annotations

import numpy as np
from numba import uint64
from numpy.typing import NDArray

from hypermap._loops import loop
from hypermap.core.arrays import BoolArray, IntArray

# Neighbors are searched in as many rows below a pixel, and in as many columns to each side.
SEARCH = 4

NOTHING = -1  # the label of a place outside the object
TOGETHER = 8  # places of a row tested at a time

Planes = tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]  # x, y, z


@loop(allocates=True)
def join(
    planes: NDArray[np.float32],
    places: NDArray[np.int32],
    part: IntArray,
    normals: NDArray[np.float32],
    reach2: NDArray[np.float32],
    cosine: np.float32,
    labels: NDArray[np.int32],
) -> NDArray[np.int32]:
    """Return the region of each of some places: a number, the same for all connected ones.

    Each place gets a label, and the labels of a region form a tree: a label has a parent
    in the same region, and a root is its own parent. First, adjacent places join, which is
    nearly all of them; then, where labels meet, places farther apart.

    Args:
        planes: the cloud with its margins, shape (3, H, W).
        places: of the object, increasing, shape (N,).
        part: the first row and column of the object, and those after the last, shape (4,).
        normals: of the points there, shape (3, H, W).
        reach2: squared distances, negative where there is no point or high curvature, (H * W,).
        cosine: smallest cosine of the angle between normals that agree.
        labels: `NOTHING` everywhere, also afterward, shape (H * W,).
    """
    stride = planes.shape[2]
    cloud = planes[0].ravel(), planes[1].ravel(), planes[2].ravel()
    axes = normals[0].ravel(), normals[1].ravel(), normals[2].ravel()
    top, left, bottom, right = part
    first, last, width = top * stride + left, (bottom - 1) * stride + left, right - left
    parent = np.empty(len(places), np.int32)
    for place in places:
        labels[place] = 0
    count = len(places) - len(places)  # 0, but not a literal, for which numba would compile again
    for row in range(first, last + 1, stride):
        with_left = _all_joins(cloud, axes, reach2, row, row - 1, width, cosine)
        with_above = _all_joins(cloud, axes, reach2, row, row - stride, width, cosine)
        count = _label_row(with_left, with_above, row, stride, labels, parent, count)
    for label in range(count):
        parent[label] = parent[parent[label]]  # the root: parents have the smaller numbers
    for place in places:
        labels[place] = parent[labels[place]]

    for row in range(first, last + 1, stride):
        for place in range(row, row + width, TOGETHER):
            if _is_border(labels, place, stride):
                _join_far(cloud, axes, reach2, place, stride, cosine, labels, parent)

    regions = np.empty(len(places), np.int32)
    for i, place in enumerate(places):
        is_bent = reach2[place] < 0
        home = _home(cloud, axes, reach2, place, stride, cosine, labels) if is_bent else place
        regions[i] = _root(parent, np.int64(labels[home]))
    for place in places:
        labels[place] = NOTHING
    return regions


@loop()
def _label_row(
    with_left: BoolArray,
    with_above: BoolArray,
    row: int,
    stride: int,
    labels: NDArray[np.int32],
    parent: NDArray[np.int32],
    count: int,
) -> int:
    """Label a row's places of the object: those that join the left or upper one get its label.

    Args:
        with_left: which of the places join those on their left, shape (width,).
        with_above: which join those above them, shape (width,).
        row: the first place.
        stride: places from row to row.
        labels: of all places; those of the row are set.
        parent: of the labels.
        count: how many labels there are.

    Returns:
        The new number of labels.
    """
    label = NOTHING
    for i in range(len(with_left)):
        place = row + i
        if labels[place] == NOTHING:
            label = NOTHING
            continue
        if not with_left[i]:
            label = NOTHING
        above = labels[place - stride]
        if with_above[i] and above != NOTHING and above != label:
            if label == NOTHING:
                label = above
            else:
                _link(parent, np.int64(label), np.int64(above))
        if label == NOTHING:
            label = count
            parent[count] = count
            count += 1
        labels[place] = label
    return count


@loop()
def _joins(
    cloud: Planes,
    axes: Planes,
    reach2: NDArray[np.float32],
    one: np.uint64,
    other: np.uint64,
    cosine: np.float32,
) -> bool:
    """Return whether two places of an object join: they are near, and their normals agree."""
    (x, y, z), (nx, ny, nz) = cloud, axes
    dx, dy, dz = x[other] - x[one], y[other] - y[one], z[other] - z[one]
    distance2 = dx * dx + dy * dy + dz * dz
    dot = nx[other] * nx[one] + ny[other] * ny[one] + nz[other] * nz[one]
    near = (distance2 <= reach2[one]) & (distance2 <= reach2[other])
    return bool(near & (abs(dot) >= cosine))


@loop(allocates=True)
def _all_joins(cloud, axes, reach2, start, other, width, cosine):  # type: ignore[no-untyped-def]
    """Return which of the places of a row join those in another row, shape (width,)."""
    joins = np.empty(width, np.bool_)
    for i in range(uint64(width)):
        joins[i] = _joins(cloud, axes, reach2, uint64(start) + i, uint64(other) + i, cosine)
    return joins


@loop()
def _is_border(labels, place, stride):  # type: ignore[no-untyped-def]
    """Return whether there are several labels where some places of a row may join others."""
    largest, smallest = np.int32(NOTHING), np.uint32(NOTHING)  # unsigned, the largest number
    for column in range(uint64(TOGETHER + 2 * SEARCH)):
        for row in range(uint64(SEARCH + 1)):
            label = labels[uint64(place - SEARCH) + row * uint64(stride) + column]
            largest = max(largest, label)
            smallest = min(smallest, np.uint32(label))
    return largest > np.int64(smallest)


@loop()
def _join_far(
    cloud: Planes,
    axes: Planes,
    reach2: NDArray[np.float32],
    start: int,
    stride: int,
    cosine: np.float32,
    labels: NDArray[np.int32],
    parent: NDArray[np.int32],
) -> None:
    """Join some places of a row with those below and on the right, as far as `SEARCH`."""
    for row in range(SEARCH + 1):
        for column in range(1 if row == 0 else 1 - SEARCH, SEARCH + 1):
            apart = row * stride + column
            if not _any_joins(cloud, axes, reach2, start, apart, cosine, labels):
                continue
            for place in range(start, start + TOGETHER):
                other = place + apart
                if labels[place] != NOTHING and labels[other] != NOTHING:
                    is_new = _root(parent, np.int64(labels[place])) != _root(
                        parent, np.int64(labels[other])
                    )
                    if is_new and _joins(
                        cloud, axes, reach2, np.uint64(place), np.uint64(other), cosine
                    ):
                        _link(parent, np.int64(labels[place]), np.int64(labels[other]))


@loop()
def _any_joins(cloud, axes, reach2, start, apart, cosine, labels):  # type: ignore[no-untyped-def]
    """Return whether any of some places of a row joins the one `apart` away, with another label.

    The same test as in `_join_far`, without a branch, so that it is vectorized.
    """
    found = False
    for i in range(uint64(TOGETHER)):
        one, other = uint64(start) + i, uint64(start + apart) + i
        label, other_label = labels[one], labels[other]
        is_other = (label != other_label) & (label != NOTHING) & (other_label != NOTHING)
        found |= is_other & _joins(cloud, axes, reach2, one, other, cosine)
    return found


@loop()
def _home(
    cloud: Planes,
    axes: Planes,
    reach2: NDArray[np.float32],
    place: int,
    stride: int,
    cosine: np.float32,
    labels: NDArray[np.int32],
) -> int:
    """Return the neighboring pixel whose region takes a place of too high curvature.

    The place itself if there is none.
    """
    reach2[place] *= -1
    home = place
    for row in range(-1, 2):
        for other in range(place + row * stride - 1, place + row * stride + 2):
            is_other = other != place and labels[other] != NOTHING
            if is_other and _joins(cloud, axes, reach2, np.uint64(place), np.uint64(other), cosine):
                home = other
    reach2[place] *= -1
    return home


@loop()
def _root(parent: NDArray[np.int32], label: np.int64) -> np.int64:
    """Return the root of a label's region, with path halving."""
    while parent[label] != label:
        parent[label] = parent[parent[label]]
        label = np.int64(parent[label])
    return label


@loop()
def _link(parent: NDArray[np.int32], one: np.int64, other: np.int64) -> None:
    """Merge two regions."""
    root, other_root = _root(parent, one), _root(parent, other)
    parent[max(root, other_root)] = min(root, other_root)
