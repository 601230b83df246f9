"""The fast method: nearly the same regions, with neighbors looked up in the image."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hypermap._loops import loop
from hypermap.core.arrays import BoolArray, IntArray
from hypermap.perception.config import PerceptionConfig
from hypermap.perception.frame import RgbdFrame
from hypermap.perception.projection import rows_of
from hypermap.perception.region_growing.normals import fit_planes
from hypermap.perception.region_growing.padded import MARGIN, planes_of
from hypermap.perception.region_growing.regions import NOTHING, join

# In the image, neighborhood is mutual; in PCL, it is not. Mutuality loses about as many
# neighbors as a third more adds.
MUTUAL = 4 / 3


def grow_regions(
    frame: RgbdFrame, valid: BoolArray, objects: Sequence[IntArray], config: PerceptionConfig
) -> list[IntArray]:
    """Return the region of each pixel of each object.

    Similar to `unorganised.grow_regions`, with a frame instead of its points. Two
    points join if each is among the other's neighbors and their normals agree, and regions are
    the connected components. A point above the curvature threshold joins one region, but does not
    connect two.

    Args:
        frame: depth or points, and intrinsics.
        valid: which of its pixels have a point, shape (H, W).
        objects: increasing row-major indices of the valid pixels of each object, none empty.
        config: neighbors and thresholds.
    """
    if not objects:
        return []
    camera, width = frame.camera, frame.camera.width
    starts = [_row_starts(pixels, width) for pixels in objects]
    parts = np.array([_part(*each, width) for each in zip(objects, starts, strict=True)])
    top, left = parts[:, :2].min(axis=0)
    bottom, right = parts[:, 2:].max(axis=0)
    planes = planes_of(
        rows_of(frame.depth, frame.camera.K, frame.cloud), valid, top, left, bottom, right
    )
    size, stride = planes[0].size, planes.shape[2]
    shift = (MARGIN - top) * stride + MARGIN - left  # where the image's first pixel would be
    places = [_places(pixels, width, stride, shift) for pixels in objects]
    wanted = np.zeros(size, dtype=np.bool_)
    for own in places:
        wanted[own] = True
    k = config.normal_neighbors
    focal = camera.K[0, 0], camera.K[1, 1]
    normals, curvatures, radii2 = fit_planes(planes, wanted.reshape(-1, stride), k, focal)
    share = np.float32(MUTUAL * config.region_neighbors / k)
    reach2 = radii2.ravel()
    _set_reach(reach2, wanted, curvatures.ravel(), share, np.float32(config.curvature_threshold))
    cosine = np.float32(np.cos(np.radians(config.smoothness_deg)))
    labels = np.full(size, NOTHING, np.int32)
    parts += np.array([MARGIN - top, MARGIN - left] * 2)  # now of the planes
    return [
        join(planes, own, part, normals, reach2, cosine, labels)
        for own, part in zip(places, parts, strict=True)
    ]


def _row_starts(pixels: IntArray, width: int) -> IntArray:
    """Return which of increasing pixels is the first of each row, and at the end their number."""
    rows = np.arange(pixels[0] // width, pixels[-1] // width + 2)
    return np.searchsorted(pixels, rows * width)


@loop()
def _part(pixels: IntArray, starts: IntArray, width: int) -> tuple[int, int, int, int]:
    """Return the first row and column of some pixels, and those after the last."""
    top = pixels[0] // width
    left, right = width, 0
    for i in range(len(starts) - 1):
        if starts[i] < starts[i + 1]:
            left = min(left, pixels[starts[i]] - (top + i) * width)
            right = max(right, pixels[starts[i + 1] - 1] - (top + i) * width + 1)
    return top, left, top + len(starts) - 1, right


def _places(pixels: IntArray, width: int, stride: int, shift: int) -> NDArray[np.int32]:
    """Return the places of pixels in a plane with margins."""
    return (pixels + pixels // width * (stride - width) + shift).astype(np.int32)


@loop()
def _set_reach(
    radii2: NDArray[np.float32],
    wanted: BoolArray,
    curvatures: NDArray[np.float32],
    share: np.float32,
    threshold: np.float32,
) -> None:
    """Turn squared radii into squared reach: negative where there is no point or high curvature."""
    for place in range(len(wanted)):
        reach2 = radii2[place] * (-share if curvatures[place] > threshold else share)
        radii2[place] = reach2 if wanted[place] else np.float32(-1)
