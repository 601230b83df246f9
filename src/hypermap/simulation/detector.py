"""A simulated detector that makes realistic errors; each error can be set to zero."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from hypermap.perception.detections import Detections
from hypermap.simulation.noise import check_not_negative

WALL_NAMES = ("train", "refrigerator")  # what detectors trained on COCO take walls for
_BACKGROUND_SHARE = 0.9


@dataclass(frozen=True)
class DetectorNoise:
    """How a detector errs.

    Attributes:
        min_pixels: objects of which fewer pixels are visible are not found.
        miss: probability that an object is missed in a frame.
        flicker: probability per frame that an object is lost for a while.
        flicker_frames: for how many frames it is then lost, in the mean.
        looseness: by how much boxes are too large, as a share of their size, in the mean.
        shift: standard deviation of a box's center, as a share of its size.
        confusion: probability that an object gets the name of another class of the world.
        false_positives: boxes around nothing, per frame, in the mean.
        walls: large boxes on walls and floor with a name of `WALL_NAMES`, per frame, in the mean.
        mask_margin: pixels by which masks, where there are any, reach past their objects.
    """

    min_pixels: int = 60
    miss: float = 0.1
    flicker: float = 0.02
    flicker_frames: float = 4.0
    looseness: float = 0.05
    shift: float = 0.02
    confusion: float = 0.02
    false_positives: float = 0.03
    walls: float = 0.0
    mask_margin: int = 1

    def __post_init__(self) -> None:
        check_not_negative(self, *(f.name for f in fields(self)))
        if self.flicker_frames < 1:
            raise ValueError(f"flicker_frames must be at least 1, got {self.flicker_frames}")


EXACT_DETECTOR = DetectorNoise(
    miss=0, flicker=0, looseness=0, shift=0, confusion=0, false_positives=0, walls=0, mask_margin=0
)


class NoisyDetector:
    """Finds objects by their true pixels, and errs; it remembers what it has lost for a while."""

    def __init__(
        self,
        names: Sequence[str],
        noise: DetectorNoise,
        rng: np.random.Generator,
        has_masks: bool = False,
    ) -> None:
        """Prepare to detect.

        Args:
            names: the class of every object of the world, in their order.
            noise: how it errs.
            rng: all chance comes from here.
            has_masks: whether it gives masks with its boxes.
        """
        self._names = list(names)
        self._classes = sorted(set(names))
        self._noise = noise
        self._rng = rng
        self._has_masks = has_masks
        self._lost_for = np.zeros(len(names), dtype=np.int64)

    def detect(self, instances: NDArray[np.int32]) -> Detections:
        """Return boxes around the visible parts of the objects, clipped to the image.

        Args:
            instances: which object each pixel shows, -1 for none, shape (H, W).
        """
        height, width = instances.shape
        size = [width, height, width, height]
        pixels = np.bincount(instances[instances >= 0], minlength=len(self._names))
        found = np.flatnonzero(self._is_found(pixels))
        boxes = self._misplaced(visible_boxes(instances, len(self._names))[found])
        names = [self._named(self._names[i]) for i in found]
        scores = self._rng.uniform(0.5, 0.95, len(names))

        extra = self._rng.poisson(self._noise.false_positives) if self._classes else 0
        nonsense = [self._nonsense(width, height) for _ in range(extra)]
        names += [self._classes[self._rng.integers(len(self._classes))] for _ in range(extra)]
        if self._noise.walls:
            on_walls = self._on_walls(instances)
            nonsense += on_walls
            names += [WALL_NAMES[self._rng.integers(len(WALL_NAMES))] for _ in on_walls]
        scores = np.append(scores, self._rng.uniform(0.3, 0.6, len(nonsense)))
        masks = self._masks(instances, found, nonsense) if self._has_masks else None
        boxes = np.clip(np.vstack([boxes, *nonsense]), 0, size)
        return Detections.of(boxes, names, scores, masks)

    def _is_found(self, pixels: NDArray[np.int64]) -> NDArray[np.bool_]:
        noise, rng, n = self._noise, self._rng, len(pixels)
        self._lost_for = np.maximum(self._lost_for - 1, 0)
        starts = (self._lost_for == 0) & (rng.random(n) < noise.flicker)
        self._lost_for[starts] = rng.geometric(1 / noise.flicker_frames, n)[starts]
        seen = (pixels > 0) & (pixels >= noise.min_pixels)
        return np.asarray(seen & (self._lost_for == 0) & (rng.random(n) >= noise.miss))

    def _named(self, name: str) -> str:
        others = [other for other in self._classes if other != name]
        if others and self._rng.random() < self._noise.confusion:
            return others[self._rng.integers(len(others))]
        return name

    def _misplaced(self, boxes: NDArray[np.float64]) -> NDArray[np.float64]:
        size = boxes[:, 2:] - boxes[:, :2]
        shift = self._rng.normal(size=size.shape) * self._noise.shift * size
        growth = self._rng.exponential(size=size.shape) * self._noise.looseness * size
        return np.hstack([boxes[:, :2] + shift - growth / 2, boxes[:, 2:] + shift + growth / 2])

    def _masks(
        self,
        instances: NDArray[np.int32],
        found: NDArray[np.intp],
        nonsense: Sequence[NDArray[np.float64]],
    ) -> NDArray[np.bool_]:
        """Return the found objects' pixels and what is around them; a false positive is all box."""
        masks = np.zeros((len(found) + len(nonsense), *instances.shape), dtype=bool)
        for mask, index in zip(masks, found, strict=False):
            mask[:] = instances == index
            if self._noise.mask_margin:
                mask[:] = ndimage.binary_dilation(mask, iterations=self._noise.mask_margin)
        for mask, box in zip(masks[len(found) :], nonsense, strict=True):
            xmin, ymin, xmax, ymax = np.round(box).astype(int)
            mask[ymin:ymax, xmin:xmax] = True
        return masks

    def _on_walls(self, instances: NDArray[np.int32]) -> list[NDArray[np.float64]]:
        """Return large boxes that show hardly anything but the background."""
        height, width = instances.shape
        boxes = []
        for _ in range(self._rng.poisson(self._noise.walls)):
            size = np.round(self._rng.uniform(0.3, 0.8, 2) * [width, height])
            corner = np.floor(self._rng.uniform(size=2) * ([width, height] - size))
            box = np.hstack([corner, corner + size])
            xmin, ymin, xmax, ymax = box.astype(int)
            if np.mean(instances[ymin:ymax, xmin:xmax] < 0) > _BACKGROUND_SHARE:
                boxes.append(box)
        return boxes

    def _nonsense(self, width: int, height: int) -> NDArray[np.float64]:
        size = self._rng.uniform(0.05, 0.4, 2) * [width, height]
        corner = self._rng.uniform(size=2) * ([width, height] - size)
        return np.hstack([corner, corner + size])


def visible_boxes(instances: NDArray[np.int32], count: int) -> NDArray[np.float64]:
    """Return xmin, ymin, xmax, ymax of each object's pixels, shape (count, 4); zeros if none."""
    boxes = np.zeros((count, 4))
    for i, place in enumerate(ndimage.find_objects(instances + 1, max_label=count)):
        if place is not None:
            rows, cols = place
            boxes[i] = cols.start, rows.start, cols.stop, rows.stop
    return boxes
