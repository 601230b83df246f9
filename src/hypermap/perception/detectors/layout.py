"""What a layout is: the way from a network's outputs to the boxes that they stand for."""

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
    """What a network answers to one image.

    Attributes:
        arrays: everything, by name.
        table: the boxes with what belongs to them, shape (A, B), of a network that answers with
            one array (1, A, B); others have (0, 0).
        prototypes: the masks from which all are mixed, shape (M, h, w); M = 0 if there are none.
        input_size: columns and rows of the network's input.
    """

    arrays: Mapping[str, NDArray[np.float32]]
    table: NDArray[np.float32]
    prototypes: NDArray[np.float32]
    input_size: tuple[int, int]

    @classmethod
    def of(cls, arrays: Mapping[str, NDArray[np.float32]], input_size: tuple[int, int]) -> Outputs:
        """Return what is in the arrays; inner layers' (1, 3, h, w, ...) are left aside."""
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
        # Exports that do suppression themselves answer all zeros where they find nothing.
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
        mixture: how much of each prototype makes the mask, shape (N, M).
        class_count: how many classes the network tells apart; None if its outputs do not say.
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
        """Return boxes of the best class of each, given the scores of all, shape (N, classes)."""
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
        fits: whether outputs are of this family.
        decode: turns outputs into candidates.
        place: puts an image into the input.
        is_bgr: channels in the order blue, green, red, instead of red, green, blue.
        mean: subtracted from each channel, black being 0 and white 1.
        std: by which the channels are divided then.
        is_final: the candidates of one object have been reduced to one already.
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
        """Return an image (H, W, 3), 0..255, in the values that the network was trained with."""
        mean, std = np.array(self.mean, np.float32), np.array(self.std, np.float32)
        return image * (1 / (255 * std)) - mean / std


def corners(xywh: FloatArray) -> FloatArray:
    """Return (xmin, ymin, xmax, ymax) of boxes given by center and size, shape (N, 4).

    >>> corners(np.array([[5, 5, 4, 2]]))
    array([[3., 4., 7., 6.]])
    """
    centers, halves = xywh[:, :2], xywh[:, 2:] / 2
    return np.hstack([centers - halves, centers + halves])
