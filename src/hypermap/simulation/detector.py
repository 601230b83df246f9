"""A simulated detector that makes realistic errors; each error can be set to zero."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from hypermap.core.arrays import BoolArray
from hypermap.perception.detections import Detections
from hypermap.simulation.lasting import LastingFaults
from hypermap.simulation.ranges import check_not_negative, check_shares

WALL_NAMES = ("train", "refrigerator")  # what detectors trained on COCO take walls for
_BACKGROUND_SHARE = 0.9
_PROBABILITIES = (
    "miss",
    "flicker",
    "confusion",
    "blackout",
    "lasting_misses",
    "hard_miss",
    "false_place_rate",
    "lasting_confusion",
    "confusion_rate",
)


@dataclass(frozen=True)
class DetectorNoise:
    """The errors of a detector.

    Attributes:
        min_pixels: objects with fewer visible pixels are not found.
        miss: probability that an object is missed in a frame.
        flicker: probability per frame that an object is lost for a while.
        flicker_frames: mean number of frames for which it is then lost.
        looseness: mean share of their size by which boxes are too large.
        shift: standard deviation of a box's center, as a share of its size.
        confusion: probability that an object gets the name of another class of the world.
        false_positives: mean number of boxes around nothing per frame.
        walls: mean number of large boxes on walls and floor with a name of `WALL_NAMES` per frame.
        mask_margin: pixels by which masks, if there are any, extend beyond their objects.
        blackout: probability per frame that the detector finds nothing at all for a while.
        blackout_frames: mean number of frames for which it then finds nothing.
        lasting_misses: probability that a thing as small as `hard_size` is one that the detector
            hardly ever finds. For a thing n times as large, it is an n-th of that. The seed
            chooses these things.
        hard_size: the largest side of such a small thing [m].
        hard_miss: probability that one of these is missed in a frame.
        false_places: number of places, such as a shadow or a picture, where the detector sees a
            thing that is not there whenever it looks from about the same side.
        false_place_rate: share of these frames in which it does.
        lasting_confusion: share of the things that the detector assigns to a similar class in many
            frames, such as a screen to laptop; the seed chooses them.
        confusion_rate: share of the frames in which it does.

    Small objects are missed more often, and classes are not confused at random:
    Hoiem, Chodpathumwan, Dai, "Diagnosing error in object detectors", ECCV 2012, sections 3 and 4.
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
    blackout: float = 0.0
    blackout_frames: float = 5.0
    lasting_misses: float = 0.0
    hard_size: float = 0.3
    hard_miss: float = 0.9
    false_places: int = 0
    false_place_rate: float = 0.6
    lasting_confusion: float = 0.0
    confusion_rate: float = 0.5

    def __post_init__(self) -> None:
        check_not_negative(self, *(f.name for f in fields(self)))
        check_shares(self, *_PROBABILITIES)
        for frames in ("flicker_frames", "blackout_frames"):
            if getattr(self, frames) < 1:
                raise ValueError(f"{frames} must be at least 1, got {getattr(self, frames)}")


EXACT_DETECTOR = DetectorNoise(
    miss=0, flicker=0, looseness=0, shift=0, confusion=0, false_positives=0, walls=0, mask_margin=0
)


class NoisyDetector:
    """Finds objects by their true pixels, with errors; some losses last for several frames."""

    def __init__(
        self,
        names: Sequence[str],
        noise: DetectorNoise,
        rng: np.random.Generator,
        has_masks: bool = False,
        lasting: LastingFaults | None = None,
    ) -> None:
        """Prepare to detect.

        Args:
            names: the class of every object of the world, in their order.
            noise: its errors.
            rng: random number generator.
            has_masks: whether it gives masks with its boxes.
            lasting: errors that last the whole drive, by object; None for none.
        """
        self._names = list(names)
        self._classes = sorted(set(names))
        self._noise = noise
        self._rng = rng
        self._has_masks = has_masks
        self._lasting = lasting
        self._lost_for = np.zeros(len(names), dtype=np.int64)
        self._blind_for = 0

    def detect(
        self, instances: NDArray[np.int32], false_places: Detections | None = None
    ) -> Detections:
        """Return boxes around the visible parts of the objects, clipped to the image.

        Args:
            instances: which object each pixel shows, -1 for none, shape (H, W).
            false_places: boxes around places that look like a thing; None for none.
        """
        found = self._objects(instances)
        if false_places is not None and len(false_places):
            found = self._joined(found, false_places, instances.shape)
        return found[:0] if self._is_blind() else found

    def _objects(self, instances: NDArray[np.int32]) -> Detections:
        height, width = instances.shape
        size = [width, height, width, height]
        pixels = np.bincount(instances[instances >= 0], minlength=len(self._names))
        found = np.flatnonzero(self._is_found(pixels))
        boxes = self._misplaced(visible_boxes(instances, len(self._names))[found])
        names = [self._named(self._called(i)) for i in found.tolist()]
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
        found = seen & (self._lost_for == 0) & (rng.random(n) >= noise.miss)
        if self._lasting is not None and self._lasting.is_hard.any():
            found &= ~(self._lasting.is_hard & (rng.random(n) < noise.hard_miss))
        return np.asarray(found)

    def _is_blind(self) -> bool:
        """Return whether nothing at all is found in this frame."""
        if not self._noise.blackout:
            return False
        self._blind_for = max(self._blind_for - 1, 0)
        if self._blind_for == 0 and self._rng.random() < self._noise.blackout:
            self._blind_for = int(self._rng.geometric(1 / self._noise.blackout_frames))
        return self._blind_for > 0

    def _called(self, index: int) -> str:
        """Return the class of an object, or a similar class with which it is often confused."""
        alias = "" if self._lasting is None else self._lasting.aliases[index]
        is_alias = bool(alias) and self._rng.random() < self._noise.confusion_rate
        return alias if is_alias else self._names[index]

    def _joined(self, found: Detections, others: Detections, shape: tuple[int, ...]) -> Detections:
        """Return detections and further boxes, which are clipped to the image."""
        height, width = shape
        boxes = np.clip(others.xyxy, 0, [width, height, width, height])
        masks = None
        if found.masks is not None:
            masks = np.concatenate([found.masks, _filled(boxes, height, width)])
        return Detections.of(
            np.vstack([found.xyxy, boxes]),
            [*found.names, *others.names],
            np.append(found.scores, others.scores),
            masks,
        )

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
                mask[:] = scipy.ndimage.binary_dilation(mask, iterations=self._noise.mask_margin)
        masks[len(found) :] = _filled(nonsense, *instances.shape)
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


def _filled(boxes: Iterable[NDArray[np.floating[Any]]], height: int, width: int) -> BoolArray:
    """Return masks of all that is in boxes, shape (N, height, width)."""
    corners = [np.round(box).astype(int) for box in boxes]
    masks = np.zeros((len(corners), height, width), dtype=bool)
    for mask, (xmin, ymin, xmax, ymax) in zip(masks, corners, strict=True):
        mask[ymin:ymax, xmin:xmax] = True
    return masks


def visible_boxes(instances: NDArray[np.int32], count: int) -> NDArray[np.float64]:
    """Return xmin, ymin, xmax, ymax of each object's pixels, shape (count, 4); zeros if none."""
    boxes = np.zeros((count, 4))
    for i, place in enumerate(scipy.ndimage.find_objects(instances + 1, max_label=count)):
        if place is not None:
            rows, cols = place
            boxes[i] = cols.start, rows.start, cols.stop, rows.stop
    return boxes
