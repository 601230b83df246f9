"""The detections in one image, and the protocol of detectors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from hypermap.core.arrays import BoolArray, ObjectArray

_LONGEST_NAME = 200  # characters


@dataclass(frozen=True, eq=False)
class Detections:
    """Detected objects of one image, as parallel arrays; index it to select some of them.

    Attributes:
        xyxy: boxes (xmin, ymin, xmax, ymax) in pixels, float32, shape (N, 4). A box contains the
            pixels with ymin <= v < ymax and xmin <= u < xmax; it may extend past the image.
        names: class names, str objects, shape (N,).
        scores: 0..1, float32, shape (N,).
        masks: the pixels of each object, bool, shape (N, H, W); None if there are only boxes.
    """

    xyxy: NDArray[np.float32]
    names: ObjectArray
    scores: NDArray[np.float32]
    masks: BoolArray | None = None

    def __post_init__(self) -> None:
        n = len(self.names)
        if self.xyxy.shape != (n, 4) or self.scores.shape != (n,):
            raise ValueError(
                f"expected boxes ({n}, 4) and scores ({n},) for {n} names, "
                f"got {self.xyxy.shape} and {self.scores.shape}"
            )
        if self.masks is not None and (self.masks.ndim != 3 or len(self.masks) != n):
            raise ValueError(f"expected masks ({n}, H, W), got {self.masks.shape}")
        if self.masks is not None and self.masks.dtype != np.bool_:
            raise ValueError(f"expected masks of bool, got {self.masks.dtype}")

    @classmethod
    def of(
        cls,
        xyxy: Any,
        names: Sequence[str],
        scores: Any = None,
        masks: BoolArray | None = None,
    ) -> Detections:
        """Return detections from plain sequences; scores default to 1.

        What no file can hold of a name is replaced, and names are cut at 200 characters.
        """
        column = np.empty(len(names), dtype=object)
        column[:] = [_usable(name) for name in names]
        return cls(
            np.asarray(xyxy, dtype=np.float32).reshape(-1, 4),
            column,
            np.ones(len(names), np.float32) if scores is None else np.asarray(scores, np.float32),
            masks,
        )

    def __len__(self) -> int:
        return len(self.names)

    def __getitem__(self, index: Any) -> Detections:
        """Return the detections that a mask, slice or array of indices selects."""
        masks = None if self.masks is None else self.masks[index]
        return Detections(self.xyxy[index], self.names[index], self.scores[index], masks)


class Detector(Protocol):
    """Anything that finds objects in a color image."""

    def detect(self, color: NDArray[np.uint8]) -> Detections:
        """Return the objects in an RGB image, uint8, shape (H, W, 3), by descending score."""
        ...


def _usable(name: str) -> str:
    """Return a name that every file and store can hold: without NUL and halves of characters."""
    if len(name) <= _LONGEST_NAME and name.isprintable():
        return name
    cut = name[:_LONGEST_NAME]
    return "".join("\ufffd" if c == "\0" or "\ud800" <= c <= "\udfff" else c for c in cut)
