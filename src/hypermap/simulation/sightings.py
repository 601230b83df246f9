"""Which things of a world a drive shows, and which of them its detections show: what bounds recall.

A map can have a thing only if the detector finds it. So the share of the things that it finds is
the greatest recall that any mapping can reach on a drive.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hypermap.core.arrays import BoolArray, IntArray
from hypermap.perception.detections import Detections
from hypermap.simulation.detector import visible_boxes

LEAST_PIXELS = 60
"""Smaller views of a thing do not count, as for `DetectorNoise.min_pixels`."""

_SAME = 0.5  # intersection over union of a detection's box and that of what is visible of a thing


@dataclass(frozen=True, eq=False)
class Sightings:
    """How often each thing of a world was seen, by its place in the world's list.

    Attributes:
        visible: frames that show it, int64, shape (N,).
        detected: frames with a detection of it, by its own class, int64, shape (N,).
        mistaken: frames with a detection of it by another class alone, int64, shape (N,).
        nearest: mean depth of its pixels in the frame that shows it from the nearest [m], inf if
            none does, float64, shape (N,).
    """

    visible: IntArray
    detected: IntArray
    mistaken: IntArray
    nearest: NDArray[np.float64]

    @classmethod
    def none(cls, count: int) -> Sightings:
        """Return those of no frame."""
        visible, detected, mistaken = np.zeros((3, count), np.int64)
        return cls(visible, detected, mistaken, np.full(count, np.inf))

    def add(
        self,
        instances: NDArray[np.int32],
        depth: NDArray[np.float32],
        detections: Detections,
        names: Sequence[str],
    ) -> None:
        """Count one frame.

        Args:
            instances: which thing each pixel shows, -1 for none, shape (H, W); things from N on
                are not counted.
            depth: of each pixel, without errors [m], shape (H, W).
            detections: what was found in it.
            names: the class of each thing, N of them.
        """
        count = len(names)
        known = np.where(instances < count, instances, -1)
        is_known = known >= 0
        pixels = np.bincount(known[is_known], minlength=count)
        shown = np.flatnonzero(pixels >= LEAST_PIXELS)
        self.visible[shown] += 1
        depths = np.bincount(known[is_known], depth[is_known], minlength=count)
        self.nearest[shown] = np.fmin(self.nearest[shown], depths[shown] / pixels[shown])
        if len(shown) == 0 or len(detections) == 0:
            return
        fits = _ious(visible_boxes(known, count)[shown], detections.xyxy) >= _SAME
        own = np.array([[names[i] == name for name in detections.names] for i in shown.tolist()])
        is_detected = (fits & own).any(axis=1)
        self.detected[shown] += is_detected
        self.mistaken[shown] += (fits & ~own).any(axis=1) & ~is_detected

    def share(self, at_least: int = 1) -> float | None:
        """Return the share of the things that were detected, which bounds recall.

        Args:
            at_least: in how many frames; one that a map needs to be sure may be more than 1.
        """
        found: BoolArray = self.detected >= at_least
        return float(found.mean()) if len(found) else None


def _ious(boxes: NDArray[np.float64], others: NDArray[np.float32]) -> NDArray[np.float64]:
    """Return the intersection over union of N boxes with M others, shape (N, M)."""
    a, b = boxes[:, np.newaxis], others[np.newaxis].astype(np.float64)
    sides = np.minimum(a[..., 2:], b[..., 2:]) - np.maximum(a[..., :2], b[..., :2])
    shared = np.prod(np.maximum(sides, 0), axis=-1)
    areas = [np.prod(one[..., 2:] - one[..., :2], axis=-1) for one in (a, b)]
    return np.asarray(shared / (areas[0] + areas[1] - shared))
