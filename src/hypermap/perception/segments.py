"""The segment of an object: its points in a frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hypermap.core.arrays import IntArray


@dataclass(frozen=True, eq=False)
class Segment:
    """The points of one detected object.

    Attributes:
        detection: the number of its detection.
        pixels: row-major indices of its pixels, increasing, shape (N,).
        points_xyz: its points in the camera's optical frame [m], shape (N, 3); smoothed by the
            method "enclosed".
    """

    detection: int
    pixels: IntArray
    points_xyz: NDArray[np.float32]
