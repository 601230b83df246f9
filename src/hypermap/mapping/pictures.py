"""Keeps the few pictures that show each object best, from different sides.

A picture is better if it shows more pixels of the object, not cut off by the border of the image,
with a higher score. All of this is known without decoding the color image, which is decoded only
for the few frames that improve something.
"""

from __future__ import annotations

import io
import logging
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from hypermap.core.errors import HypermapError
from hypermap.core.pictures import MOST_PICTURES, ObjectPicture, best_pictures
from hypermap.mapping.evidence import EvidenceMap
from hypermap.mapping.stages import PictureConfig
from hypermap.perception.detections import Detections
from hypermap.perception.frame import RgbdFrame
from hypermap.perception.observation import ObservedObject

_log = logging.getLogger(__name__)

PEOPLE = frozenset({"person", "people", "man", "woman", "boy", "girl", "child", "baby", "face"})
"""Classes of people, of whom no pictures are kept unless asked for."""

_MOST_BYTES = 20_000  # of a picture
_LONGEST = 240  # pixels; width or height of a picture
_LEAST = 10  # pixels; in smaller pictures nothing can be seen
_ENOUGH = 200.0 * 200.0  # pixels of an object; more of them show no more
_MARGIN = 0.1  # of the box, around it
_CUT_OFF = 0.5  # quality of an object at the border of the image
_BETTER = 1.5  # times as good; less is not worth decoding the color image
_BLURRED = 0.5  # of the sharpness of an earlier picture from the same side
_JPEG_QUALITIES = (85, 70, 50, 30)


def keep_pictures(
    frame: RgbdFrame, detections: Detections, evidence: EvidenceMap, config: PictureConfig
) -> None:
    """Keep crops of a frame that show objects better than their pictures so far.

    Args:
        frame: the frame of the last update of the evidence map.
        detections: the detections of its objects.
        evidence: keeps the pictures; changed.
        config: which pictures are kept.
    """
    for observed, track_id in evidence.shown:
        names = observed.name, evidence.class_of(track_id)
        if observed.detection is None or (any(map(is_person, names)) and not config.people):
            continue
        box = detections.xyxy[observed.detection]
        azimuth = _azimuth(frame, observed)
        quality = _quality(frame, box, observed)
        kept = evidence.pictures(track_id)
        rivals = [each for each in kept if each.is_from_side(azimuth)]
        if not _is_wanted(quality, rivals, kept):
            continue
        try:
            picture = _taken(frame, box, azimuth, quality)
        except HypermapError as error:  # a map does not need it
            _log.info("frame %.6f: no picture was taken: %s", frame.stamp, error)
            return
        if picture is None or any(picture.sharpness < _BLURRED * r.sharpness for r in rivals):
            continue
        evidence.keep_pictures(track_id, best_pictures([*kept, picture]))


def is_person(name: str) -> bool:
    """Return whether objects of a class are people."""
    return name.strip().lower() in PEOPLE


def _azimuth(frame: RgbdFrame, observed: ObservedObject) -> float:
    """Return the direction from an object to the camera [rad]."""
    x, y = frame.map_T_camera[:2, 3].tolist()
    center = observed.footprint.centroid
    return math.atan2(y - center.y, x - center.x)


def _quality(frame: RgbdFrame, box: NDArray[np.float32], observed: ObservedObject) -> float:
    """Return how well a frame shows an object, at most 1, without regard to color."""
    x_min, y_min, x_max, y_max = box.tolist()
    is_whole = min(x_min, y_min) >= 1 and x_max < frame.camera.width and y_max < frame.camera.height
    size = min(1.0, observed.pixel_count / _ENOUGH)
    return size * min(1.0, observed.score) * (1.0 if is_whole else _CUT_OFF)


def _is_wanted(
    quality: float, rivals: Sequence[ObjectPicture], kept: Sequence[ObjectPicture]
) -> bool:
    """Return whether a picture is so much better, or from another side, that it may be kept."""
    if not rivals and len(kept) < MOST_PICTURES:
        return quality > 0
    beaten = max(each.quality for each in rivals) if rivals else kept[-1].quality
    return quality > _BETTER * beaten


def _taken(
    frame: RgbdFrame, box: NDArray[np.float32], azimuth: float, quality: float
) -> ObjectPicture | None:
    """Return the crop of a box; None if there is no color, or it is too small or too large."""
    color = frame.color
    if color is None:
        return None
    size = box[2:] - box[:2]
    low = np.maximum(np.floor(box[:2] - _MARGIN * size), 0).astype(int)
    high = np.minimum(np.ceil(box[2:] + _MARGIN * size), color.shape[1::-1]).astype(int)
    if (high <= low).any():
        return None
    crop = color[low[1] : high[1], low[0] : high[0]]
    image = Image.fromarray(np.ascontiguousarray(crop))
    image.thumbnail((_LONGEST, _LONGEST), Image.Resampling.BOX)
    if min(image.size) < _LEAST:
        return None
    sharpness = _sharpness(np.asarray(image))
    for jpeg_quality in _JPEG_QUALITIES:
        file = io.BytesIO()
        image.save(file, "JPEG", quality=jpeg_quality)
        if len(file.getvalue()) <= _MOST_BYTES:
            return ObjectPicture(file.getvalue(), frame.stamp, azimuth, quality, sharpness)
    return None


def _sharpness(color: NDArray[np.uint8]) -> float:
    """Return the variance of the Laplacian of the gray values of an image."""
    gray = color.mean(axis=2, dtype=np.float32)
    inner = gray[1:-1, 1:-1]
    laplacian = gray[:-2, 1:-1] + gray[2:, 1:-1] + gray[1:-1, :-2] + gray[1:-1, 2:] - 4 * inner
    return float(np.round(laplacian.var(), 3))
