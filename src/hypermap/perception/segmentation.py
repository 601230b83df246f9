"""From the points in a detection's box or mask to the points of the object itself."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hypermap._loops import loop
from hypermap.core.arrays import BoolArray, IntArray
from hypermap.perception import enclosed
from hypermap.perception.config import PerceptionConfig
from hypermap.perception.denoising import smoothed
from hypermap.perception.detections import Detections
from hypermap.perception.flying_pixels import without_flying
from hypermap.perception.frame import RgbdFrame
from hypermap.perception.region_growing import largest_regions
from hypermap.perception.segments import Segment

FARTHEST = 1e4  # farther than any camera sees: an invalid number [m]


def valid_pixels(frame: RgbdFrame, config: PerceptionConfig) -> BoolArray:
    """Return which pixels have a point within the configured depths, shape (H, W)."""
    valid = frame.z > np.float32(config.min_depth)
    valid &= frame.z <= np.float32(min(config.max_depth, FARTHEST))
    if frame.cloud is not None:
        valid &= (np.abs(frame.cloud[..., :2]) < FARTHEST).all(axis=-1)
    return valid


def segment(
    frame: RgbdFrame, valid: BoolArray, detections: Detections, config: PerceptionConfig
) -> list[Segment]:
    """Return the object in each detection's box, or mask if it has one.

    Args:
        frame: depth or points, and intrinsics.
        valid: which of its pixels have a point, shape (H, W).
        detections: in the image.
        config: method and thresholds.

    Returns:
        Segments in the order of the detections; detections with too few or too many points left
        have none.

    Raises:
        ValueError: If the masks do not have the image's size.
    """
    noise, support = config.depth_noise, config.min_support
    valid = without_flying(frame.z, valid, detections.xyxy, noise, support)
    candidates = [
        (number, pixels)
        for number in range(len(detections))
        if len(pixels := _pixels_of(detections, number, valid)) >= config.min_cluster
    ]
    objects = [pixels for _, pixels in candidates]
    if not objects:
        return []
    if config.method == "enclosed":
        numbers = [number for number, _ in candidates]
        beyond = (frame.z > np.float32(config.max_depth)) & (frame.z <= FARTHEST)
        farther = [_pixels_of(detections, number, beyond) for number in numbers]
        shown = objects, farther, detections.xyxy[numbers]
        cut = enclosed.cut_out(frame.z, valid, frame.camera, *shown, config)
    else:
        cut = largest_regions(frame, valid, objects, config)
    kept = [
        (number, pixels)
        for (number, _), pixels in zip(candidates, cut, strict=True)
        if config.min_cluster <= len(pixels) <= config.max_cluster
    ]
    clouds = _points_of(frame, [pixels for _, pixels in kept], config)
    return [
        Segment(number, pixels, points_xyz)
        for (number, pixels), points_xyz in zip(kept, clouds, strict=True)
    ]


def _points_of(
    frame: RgbdFrame, objects: Sequence[IntArray], config: PerceptionConfig
) -> list[NDArray[np.float32]]:
    """Return the points of each object, computed for all at once."""
    if not objects:
        return []
    ends = np.cumsum([len(pixels) for pixels in objects])
    clouds = np.split(frame.points_of(np.concatenate(objects)), ends[:-1])
    if config.method != "enclosed":
        return clouds
    width = frame.camera.width
    return [
        smoothed(points_xyz, pixels, width, config)
        for points_xyz, pixels in zip(clouds, objects, strict=True)
    ]


def _pixels_of(detections: Detections, number: int, valid: BoolArray) -> IntArray:
    """Return the valid pixels of a detection as row-major indices."""
    if detections.masks is not None:
        mask = detections.masks[number]
        if mask.shape != valid.shape:
            raise ValueError(f"masks must have the image's shape {valid.shape}, got {mask.shape}")
        return np.flatnonzero(mask & valid)
    box = detections.xyxy[number]
    if np.isnan(box).any():
        return np.empty(0, np.int64)
    # The box contains the pixels from xmin up to, not including, xmax.
    height, width = valid.shape
    left, top, right, bottom = (
        math.ceil(min(max(end, 0), size))
        for end, size in zip(box.tolist(), (width, height, width, height), strict=True)
    )
    found = np.empty(max(bottom - top, 0) * max(right - left, 0) + 1, np.int64)
    return found[: _find_valid(valid, left, top, right, bottom, found)]


@loop()
def _find_valid(
    valid: BoolArray, left: int, top: int, right: int, bottom: int, found: IntArray
) -> int:
    """Find the valid pixels of a box in the image, and return how many there are.

    `found` receives their row-major indices; it needs room for one more.
    """
    width = valid.shape[1]
    count = 0
    for row in range(top, bottom):
        for column in range(left, right):
            found[count] = row * width + column  # without a branch; the next one may overwrite it
            count += valid[row, column]
    return count
