"""Which surfaces belong to a detected object: those that its box encloses.

An object ends where its box ends, and the background continues past it. A surface in several boxes
belongs to the smallest: the cup to its own box, not to that of the table below it. But what hides
the middle of an object is not a part of it: an object fills its box from end to end. A box that
encloses nothing may still cut its object out of a larger surface.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hypermap._loops import loop
from hypermap.core.arrays import BoolArray, IntArray
from hypermap.perception.config import PerceptionConfig
from hypermap.perception.frame import Camera
from hypermap.perception.pieces import MIN_FIT, cut_piece
from hypermap.perception.surfaces import Surfaces, find_surfaces

SPECK = 8  # smaller surfaces, in pixels, are noise at the edges of others
FLAT_SHARE = 0.8  # of a box that shows only one plane
MAIN_SHARE = 0.1  # of the pixels of the largest surface: a main part of an object
BETTER = 0.2  # more intersection over union with the box: surfaces that fit it clearly better
WHOLE = 0.8  # intersection over union with the box of surfaces that are all of an object
SOLID = 0.3  # of the pixels in its box: what an object fills that is as deep as it is wide
DEEP = 0.65  # of its box's larger side between the parts of such an object, a bowl's front and back
FILLING = 0.5  # intersection over union with the box of surfaces that surely are an object's
MUCH = 0.1  # of what is measured in a box, that is beyond `max_depth`
SCATTERED = 0.05  # of the pixels in a box: what is less may be the noise of other surfaces


def cut_out(
    depth: NDArray[np.float32],
    valid: BoolArray,
    camera: Camera,
    objects: Sequence[IntArray],
    farther: Sequence[IntArray],
    boxes: NDArray[np.float32],
    config: PerceptionConfig,
) -> list[IntArray]:
    """Return the pixels of each detected object, without the background in its box.

    Args:
        depth: along the optical axis [m], shape (H, W).
        valid: which of its pixels have a point, shape (H, W).
        camera: intrinsics.
        objects: row-major indices of the valid pixels in each detection's box or mask.
        farther: those of its other pixels that are measured beyond `max_depth`.
        boxes: xmin, ymin, xmax, ymax of the same detections [pixels], shape (N, 4).
        config: noise and thresholds.

    Returns:
        For each detection, increasing row-major indices, a subset of its own; may be empty.
    """
    surfaces = find_surfaces(depth, valid, camera, config)
    inside = [_Inside(surfaces, pixels) for pixels in objects]
    is_thing = (surfaces.own_border >= config.min_own_border) & (surfaces.sizes >= SPECK)
    least_inside = np.where(is_thing, config.min_inside * surfaces.sizes, np.inf)
    by_size = sorted(range(len(objects)), key=lambda number: -len(objects[number]))
    encloses = np.array([one.sizes >= least_inside for one in inside])
    owner = _owners(encloses, inside, farther, boxes, by_size, camera, config)
    measured = [len(pixels) + len(more) for pixels, more in zip(objects, farther, strict=True)]
    cut, scattered, is_again = [], [], []
    for number, (pixels, box) in enumerate(zip(objects, boxes, strict=True)):
        is_chosen = np.zeros(len(owner), dtype=bool)
        if (own := np.flatnonzero(owner == number)).size:
            is_chosen[_together(own, inside[number], box, camera, config)] = True
        else:
            is_chosen[_flat(inside[number], len(farther[number]), surfaces.planes)] = True
        found = np.empty(len(pixels), np.int64)
        found = found[: _choose(surfaces.labels.ravel(), pixels, is_chosen, found)]
        whole = _if_fitting(found, box, measured[number], valid.shape, config.min_fit)
        is_little = len(whole) < SCATTERED * len(pixels)  # then it is the object if no piece is
        cut.append(whole[:0] if is_little else whole)
        scattered.append(whole if is_little else whole[:0])
        is_again.append(len(cut[number]) < len(found))  # then a piece must fit, too
    for place, number in enumerate(by_size if config.max_cut > 0 else ()):
        box = boxes[number]
        if len(cut[number]) > 0 or (is_again[number] and _at_border(box, camera)):
            continue
        is_free = is_thing & ~np.isin(owner, by_size[place:])  # from the smaller boxes
        sizes = np.where(is_free, inside[number].sizes, 0)
        label = int(np.argmax(sizes))
        if sizes[label] >= SPECK:
            fit = _iou(inside[number].extents[[label]], box)[0]
            at = surfaces, label, objects[number], len(farther[number])
            piece = cut_piece(*at, fit, box, camera, config)
            least = MIN_FIT if is_again[number] else config.min_fit
            cut[number] = piece = _if_fitting(piece, box, measured[number], valid.shape, least)
            for larger in by_size[:place]:
                for kept in (cut, scattered):
                    kept[larger] = np.setdiff1d(kept[larger], piece, assume_unique=True)
    return [one if len(one) else other for one, other in zip(cut, scattered, strict=True)]


def _owners(
    encloses: BoolArray,
    inside: Sequence[_Inside],
    farther: Sequence[IntArray],
    boxes: NDArray[np.float32],
    by_size: Sequence[int],
    camera: Camera,
    config: PerceptionConfig,
) -> IntArray:
    """Return the box to which each surface belongs, -1 for none, shape (S,).

    A surface in several boxes belongs to the smallest: the cup not to the table below it. But the
    smaller box may be that of a thing beyond `max_depth`, and also show a part of a chair in front.
    So a box does not get what others enclose, too, if that does not fill it, but what is beyond
    does.

    Args:
        encloses: which box encloses which surface, shape (N, S).
        inside: the part of each surface in each box.
        farther: row-major indices of the pixels in each box beyond `max_depth`, increasing.
        boxes: xmin, ymin, xmax, ymax [pixels], shape (N, 4).
        by_size: the boxes, the largest first.
        camera: intrinsics.
        config: how far apart parts of an object may be.
    """
    owner = np.full(encloses.shape[1], -1)
    is_shared = np.count_nonzero(encloses, axis=0) > 1
    for number in reversed(by_size):
        own, shown, box = encloses[number] & (owner < 0), inside[number], boxes[number]
        more = farther[number]
        if len(more) >= MUCH * (len(more) + shown.sizes.sum()) and (own & is_shared).any():
            parts = _together(np.flatnonzero(own), shown, box, camera, config)
            extent = _extent(shown.extents[parts], np.ones((1, len(parts)), bool))
            fit = _iou(extent, box)[0]
            if fit < FILLING and _iou(_extent_of(more, camera.width), box)[0] > fit + BETTER:
                own &= ~is_shared
        owner[own] = number
    return owner


def _extent_of(pixels: IntArray, width: int) -> IntArray:
    """Return the extent of row-major, increasing indices of pixels, shape (1, 4)."""
    columns = pixels % width
    left, right = columns.min(), columns.max() + 1
    return np.array([[left, pixels[0] // width, right, pixels[-1] // width + 1]])


def _if_fitting(
    found: IntArray,
    box: NDArray[np.float32],
    measured: int,
    shape: tuple[int, ...],
    least: float,
) -> IntArray:
    """Return what was found in a box if its extent fills enough of it; nothing if not.

    What fills a small part of a box is in front of or behind the thing that the detector saw,
    unless little of that thing is measured.

    Args:
        found: row-major indices of pixels, increasing.
        box: xmin, ymin, xmax, ymax [pixels], shape (4,).
        measured: how many pixels in the box or mask have a depth.
        shape: of the image.
        least: share of the box that is enough.
    """
    height, width = shape
    left, top, right, bottom = box.tolist()
    area = (min(right, width) - max(left, 0)) * (min(bottom, height) - max(top, 0))
    if len(found) == 0 or len(found) >= least * area or 2 * measured < area:
        return found
    columns = found % width
    rows = found[-1] // width + 1 - found[0] // width
    extent = rows * (columns.max() + 1 - columns.min())
    return found if extent >= least * area else found[:0]


def _at_border(box: NDArray[np.float32], camera: Camera) -> bool:
    """Return whether a box ends at the border of an image, beyond which its thing may continue."""
    left, top, right, bottom = box.tolist()
    return bool(min(left, top, camera.width - right, camera.height - bottom) <= 1)


class _Inside:
    """The part of each surface in a box.

    Attributes:
        sizes: pixels of each, shape (N,).
        extents: xmin, ymin, xmax, ymax of these [pixels], shape (N, 4).
        depths: the depth of their mean disparity [m], infinite for none, shape (N,).
    """

    def __init__(self, surfaces: Surfaces, pixels: IntArray) -> None:
        count = len(surfaces.sizes)
        flat_labels, flat_disparity = surfaces.labels.ravel(), surfaces.disparity.ravel()
        width = surfaces.labels.shape[1]
        self.sizes, self.extents = np.zeros(count, np.int64), np.zeros((count, 4), np.int64)
        sums = np.zeros(count)
        _measure(flat_labels, flat_disparity, width, pixels, self.sizes, self.extents, sums)
        self.depths = np.divide(self.sizes, sums, out=np.full(count, np.inf), where=sums > 0)


def _together(
    own: IntArray,
    inside: _Inside,
    box: NDArray[np.float32],
    camera: Camera,
    config: PerceptionConfig,
) -> IntArray:
    """Return the surface that fits the box best, and the others at about the same depth.

    A solid object may be as deep as it is wide: parts farther apart are one, as front and back of a
    bowl, if only together they fill the box. Those at another depth are the object instead if
    together they fit the box clearly better, as the two ends of a thing whose middle is hidden.
    Nearer ones must also be the larger part of it.
    """
    extents, sizes, depths = inside.extents[own], inside.sizes[own], inside.depths[own]
    width, height = (box[2] - box[0]) / camera.K[0, 0], (box[3] - box[1]) / camera.K[1, 1]
    size = max(width, height)
    max_offset = config.max_offset * size
    main = np.argmax(_iou(extents, box))
    usual = np.abs(depths - depths[main]) <= max_offset * depths[main]
    if usual.all():
        return own
    fit = _iou(_extent(extents, usual[np.newaxis]), box)[0]
    deep = np.abs(depths - depths[main]) <= DEEP * size * depths[main]
    if (
        sizes[deep & ~usual].sum() >= MAIN_SHARE * sizes[usual].sum()
        and sizes[deep].sum() >= SOLID * inside.sizes.sum()
        and _iou(_extent(extents, deep[np.newaxis]), box)[0] > max(fit + BETTER, WHOLE)
        and not _at_border(box, camera)
    ):
        return np.asarray(own[deep])
    mains = depths[sizes >= MAIN_SHARE * sizes.max(), np.newaxis]
    others = np.abs(depths - mains) <= max_offset * mains
    is_likely = (mains[:, 0] > depths[main]) | (others @ sizes > sizes[usual].sum())
    if fit + BETTER < 1 and is_likely.any():
        others = others[is_likely]
        fits = _iou(_extent(extents, others), box)
        best = np.argmax(fits)
        if fits[best] > fit + BETTER:
            return np.asarray(own[others[best]])
    return np.asarray(own[usual])


def _extent(extents: IntArray, together: BoolArray) -> IntArray:
    """Return the extent of each of M groups of N surfaces, shape (M, 4).

    Args:
        extents: of the surfaces, shape (N, 4).
        together: which surfaces are in each group, shape (M, N).
    """
    is_in = together[..., np.newaxis]
    low = np.where(is_in, extents[:, :2], np.iinfo(np.int64).max).min(axis=1)
    return np.hstack([low, np.where(is_in, extents[:, 2:], 0).max(axis=1)])


def _flat(inside: _Inside, farther: int, planes: int) -> IntArray:
    """Return the one plane that fills the box, if there is one.

    A book is too flat to stand out from its table, and a poster from its wall: the part of the
    plane in the box is the object.
    """
    largest = int(np.argmax(inside.sizes))
    fills = inside.sizes[largest] >= FLAT_SHARE * (inside.sizes.sum() + farther)
    return np.array([largest] if fills and largest < planes else [], dtype=np.int64)


def _iou(extents: IntArray, box: NDArray[np.float32]) -> NDArray[np.float64]:
    """Return the intersection over union of some boxes with another one."""
    low, high = np.maximum(extents[:, :2], box[:2]), np.minimum(extents[:, 2:], box[2:])
    shared = np.prod(np.maximum(high - low, 0), axis=1)
    areas = np.prod(extents[:, 2:] - extents[:, :2], axis=1)
    return np.asarray(shared / (areas + np.prod(box[2:] - box[:2]) - shared))


@loop()
def _choose(
    labels: NDArray[np.int32], pixels: IntArray, is_chosen: BoolArray, found: IntArray
) -> int:
    """Find the pixels that are on a chosen surface; return how many there are."""
    count = 0
    for pixel in pixels:
        found[count] = pixel
        count += is_chosen[labels[pixel]]
    return count


@loop()
def _measure(
    flat_labels: NDArray[np.int32],
    flat_disparity: NDArray[np.float32],
    width: int,
    pixels: IntArray,
    sizes: IntArray,
    extents: IntArray,
    sums: NDArray[np.float64],
) -> None:
    """Fill in size, extent and sum of disparities of each surface among some pixels."""
    row, end = -1, 0  # the current row of the image
    i = 0
    while i < len(pixels):
        first, label, total = i, flat_labels[pixels[i]], 0.0
        while pixels[i] >= end:
            row, end = row + 1, end + width
        while i < len(pixels) and pixels[i] < end and flat_labels[pixels[i]] == label:
            total += flat_disparity[pixels[i]]
            i += 1
        left, right = pixels[first] - row * width, pixels[i - 1] - row * width + 1
        if sizes[label] == 0:
            extents[label, 0], extents[label, 1] = left, row
        extents[label, 0] = min(extents[label, 0], left)
        extents[label, 2] = max(extents[label, 2], right)
        extents[label, 3] = row + 1
        sizes[label] += i - first
        sums[label] += total
