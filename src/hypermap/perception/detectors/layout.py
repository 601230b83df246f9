"""A layout: how to turn a network's outputs into boxes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hypermap.core.arrays import FloatArray, IntArray
from hypermap.perception.detectors.placement import Placement, centered

NOTHING: NDArray[np.float32] = np.zeros((0, 0), np.float32)


@dataclass(frozen=True, eq=False)
class Outputs:
    """The outputs of a network for one image.

    Attributes:
        arrays: all outputs, by name.
        table: the boxes with their values, shape (A, B), if the network returns
            one array (1, A, B); otherwise (0, 0).
        prototypes: masks that all others are mixed from, shape (M, h, w); M = 0 if none.
        input_size: columns and rows of the network's input.
    """

    arrays: Mapping[str, NDArray[np.float32]]
    table: NDArray[np.float32]
    prototypes: NDArray[np.float32]
    input_size: tuple[int, int]

    @classmethod
    def of(cls, arrays: Mapping[str, NDArray[np.float32]], input_size: tuple[int, int]) -> Outputs:
        """Return the outputs in the arrays, without those of inner layers, (1, 3, h, w, ...)."""
        single = [array[0] for array in arrays.values() if array.ndim > 2 and len(array) == 1]
        tables = [array for array in single if array.ndim == 2]
        prototypes = [array for array in single if array.ndim == 3]
        return cls(
            arrays,
            tables[0] if len(tables) == 1 and len(prototypes) < 2 else NOTHING,
            prototypes[0] if prototypes else NOTHING[:, :, np.newaxis],
            input_size,
        )

    @property
    def is_relative(self) -> bool:
        """Whether the table's boxes have coordinates from 0 to 1, not in pixels."""
        boxes = self.table[:, :4]
        # Exports that include suppression return zeros if they find nothing.
        return bool(self.table.any() and (boxes >= 0).all() and (boxes <= 1).all())

    def shapes(self, *names: str) -> list[tuple[int, ...]] | None:
        """Return the shapes of the arrays of these names; None if one is missing."""
        if not set(names) <= set(self.arrays):
            return None
        return [self.arrays[name].shape for name in names]


@dataclass(frozen=True, eq=False)
class Candidates:
    """Boxes that a network proposes, as parallel arrays.

    Attributes:
        xyxy: in pixels of the network's input, shape (N, 4).
        scores: 0..1, shape (N,).
        class_ids: shape (N,).
        mixture: weight of each prototype in the mask, shape (N, M).
        class_count: how many classes the network distinguishes; None if its outputs do not say.
    """

    xyxy: FloatArray
    scores: FloatArray
    class_ids: IntArray
    mixture: FloatArray
    class_count: int | None

    @classmethod
    def best(
        cls, xyxy: FloatArray, class_scores: FloatArray, mixture: FloatArray | None = None
    ) -> Candidates:
        """Return boxes with the best class of each, given all scores, shape (N, classes)."""
        count, class_count = class_scores.shape
        class_ids = class_scores.argmax(axis=1)
        scores = class_scores[np.arange(count), class_ids]
        mixture = class_scores[:, :0] if mixture is None else mixture
        return cls(xyxy, scores, class_ids, mixture, class_count)

    def __getitem__(self, index: Any) -> Candidates:
        return replace(
            self,
            xyxy=self.xyxy[index],
            scores=self.scores[index],
            class_ids=self.class_ids[index],
            mixture=self.mixture[index],
        )


@dataclass(frozen=True)
class Layout:
    """A family of networks.

    Attributes:
        name: of the family.
        shape: of its outputs, in words.
        fits: returns whether outputs are of this family.
        decode: turns outputs into candidates.
        place: puts an image into the input.
        is_bgr: channels are blue, green, red, instead of red, green, blue.
        mean: subtracted from each channel, with black 0 and white 1.
        std: then divides each channel.
        is_final: the network already suppresses all but one candidate of an object.
    """

    name: str
    shape: str
    fits: Callable[[Outputs], bool]
    decode: Callable[[Outputs], Candidates]
    place: Callable[[tuple[int, int], tuple[int, int]], Placement] = centered
    is_bgr: bool = False
    mean: tuple[float, float, float] = (0.0, 0.0, 0.0)
    std: tuple[float, float, float] = (1.0, 1.0, 1.0)
    is_final: bool = False

    def scale(self, image: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return an image (H, W, 3), 0..255, normalized as in the network's training."""
        mean, std = np.array(self.mean, np.float32), np.array(self.std, np.float32)
        return image * (1 / (255 * std)) - mean / std


def corners(xywh: FloatArray) -> FloatArray:
    """Return (xmin, ymin, xmax, ymax) of boxes given by center and size, shape (N, 4).

    >>> corners(np.array([[5, 5, 4, 2]]))
    array([[3., 4., 7., 6.]])
    """
    centers, halves = xywh[:, :2], xywh[:, 2:] / 2
    return np.hstack([centers - halves, centers + halves])
