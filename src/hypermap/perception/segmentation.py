"""From the points in a detection's box or mask to the points of the object itself."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from hypermap.core.arrays import BoolArray, IntArray
from hypermap.perception import enclosed, organised, unorganised
from hypermap.perception.config import PerceptionConfig
from hypermap.perception.detections import Detections
from hypermap.perception.frame import RgbdFrame
from hypermap.perception.smoothing import smoothed

FARTHEST = 1e4  # what is farther away than any camera sees is a broken number [m]


@dataclass(frozen=True, eq=False)
class Segment:
    """The points of one detected object.

    Attributes:
        detection: the number of its detection.
        pixels: row-major indices of its pixels, increasing, shape (N,).
        points_xyz: its points in the camera's optical frame [m], shape (N, 3); smoothed by the
            method "enclosed".
        is_piece: whether its box cut it out of a surface that runs on, so that its border is known
            less well.
    """

    detection: int
    pixels: IntArray
    points_xyz: NDArray[np.float32]
    is_piece: bool = False


def valid_pixels(frame: RgbdFrame, config: PerceptionConfig) -> BoolArray:
    """Return which pixels hold a point within the depths of the configuration, shape (H, W)."""
    z = frame.z
    valid = (z > config.min_depth) & (z <= min(config.max_depth, FARTHEST))
    if frame.cloud is not None:
        valid &= (np.abs(frame.cloud[..., :2]) < FARTHEST).all(axis=-1)
    return np.asarray(valid)


def segment(
    frame: RgbdFrame, valid: BoolArray, detections: Detections, config: PerceptionConfig
) -> list[Segment]:
    """Return the object in each detection's box, or mask if it has one.

    Args:
        frame: depth or points, and intrinsics.
        valid: which of its pixels hold a point, shape (H, W).
        detections: what was found in the image.
        config: method and thresholds.

    Returns:
        Segments in the order of the detections; those of which too few or too many points are left
        have none.

    Raises:
        ValueError: If the masks are not of the image's size.
    """
    candidates = [
        (number, pixels)
        for number in range(len(detections))
        if len(pixels := _pixels_of(detections, number, valid)) >= config.min_cluster
    ]
    objects = [pixels for _, pixels in candidates]
    if not objects:
        return []
    is_piece = np.zeros(len(objects), dtype=bool)
    if config.method == "enclosed":
        boxes = detections.xyxy[[number for number, _ in candidates]]
        cut, is_piece = enclosed.cut_out(frame.z, valid, frame.camera, objects, boxes, config)
    else:
        points = frame.points()
        if config.method == "organised":
            regions = organised.grow_regions(points, valid, frame.camera, objects, config)
        else:
            regions = unorganised.grow_regions(points, valid, objects, config)
        cut = [
            _largest(pixels, region_of, config)
            for pixels, region_of in zip(objects, regions, strict=True)
        ]
    return [
        Segment(number, pixels, _points_of(frame, pixels, config), bool(piece))
        for (number, _), pixels, piece in zip(candidates, cut, is_piece, strict=True)
        if config.min_cluster <= len(pixels) <= config.max_cluster
    ]


def _points_of(frame: RgbdFrame, pixels: IntArray, config: PerceptionConfig) -> NDArray[np.float32]:
    points_xyz = frame.points_of(pixels)
    if config.method == "enclosed":
        return smoothed(points_xyz, pixels, frame.camera.width, config)
    return points_xyz


def _largest(pixels: IntArray, region_of: IntArray, config: PerceptionConfig) -> IntArray:
    """Return the pixels of the largest region that may be an object; none if there is none."""
    sizes = np.bincount(region_of)
    sizes[(sizes < config.min_cluster) | (sizes > config.max_cluster)] = 0
    return pixels[region_of == sizes.argmax()] if sizes.any() else pixels[:0]


def _pixels_of(detections: Detections, number: int, valid: BoolArray) -> IntArray:
    """Return the valid pixels of a detection as row-major indices."""
    if detections.masks is not None:
        mask = detections.masks[number]
        if mask.shape != valid.shape:
            raise ValueError(f"masks must have the image's shape {valid.shape}, got {mask.shape}")
        return np.flatnonzero(mask & valid)
    height, width = valid.shape
    box = detections.xyxy[number]
    if np.isnan(box).any():
        return np.empty(0, dtype=np.int64)
    # The box holds the pixels from xmin up to, but without, xmax.
    left, top, right, bottom = np.ceil(np.clip(box, 0, [width, height] * 2)).astype(int)
    return np.asarray(_valid_in(valid, left, top, right, bottom))


@njit(cache=True)
def _valid_in(valid, left, top, right, bottom):  # type: ignore[no-untyped-def]
    """Return the valid pixels of a box within the image as row-major indices."""
    found = np.empty(max(bottom - top, 0) * max(right - left, 0), np.int64)
    count = 0
    for row in range(top, bottom):
        for column in range(left, right):
            found[count] = row * valid.shape[1] + column
            count += valid[row, column]
    return found[:count].copy()
