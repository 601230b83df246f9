"""The position of an image in a network's input, and conversions in both directions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hypermap.core.arrays import FloatArray

BORDER = 114.0  # gray around the image, as in the training of these networks


@dataclass(frozen=True)
class Placement:
    """An image, resized, in a network's input.

    Attributes:
        image_size: columns and rows of the image.
        input_size: columns and rows of the network's input.
        size: columns and rows of the image there.
        left: column where it begins.
        top: row where it begins.
    """

    image_size: tuple[int, int]
    input_size: tuple[int, int]
    size: tuple[int, int]
    left: int = 0
    top: int = 0

    def fill(self, image: NDArray[np.uint8]) -> NDArray[np.float32]:
        """Return the network's input (H, W, 3), 0..255: the image, and gray around it."""
        width, height = self.size
        columns = (np.arange(width) + 0.5) * (self.image_size[0] / width) - 0.5
        rows = (np.arange(height) + 0.5) * (self.image_size[1] / height) - 0.5
        filled = np.full((self.input_size[1], self.input_size[0], 3), BORDER, np.float32)
        inside = filled[self.top : self.top + height, self.left : self.left + width]
        inside[:] = sample_bilinear(image, rows, columns)
        return filled

    def to_image(self, xyxy: FloatArray) -> NDArray[np.float32]:
        """Return boxes (N, 4) of the input as boxes of the image, clipped at its edges."""
        scale = np.divide(self.size, self.image_size)
        corners = (xyxy.reshape(-1, 2, 2) - (self.left, self.top)) / scale
        return np.clip(corners, 0, self.image_size).reshape(-1, 4).astype(np.float32)

    def to_input(self, columns: FloatArray, rows: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return coordinates on the image [pixels], shape (N,), as coordinates on the input."""
        return (
            columns * (self.size[0] / self.image_size[0]) + self.left,
            rows * (self.size[1] / self.image_size[1]) + self.top,
        )


def top_left(image_size: tuple[int, int], input_size: tuple[int, int]) -> Placement:
    """Return the image as large as fits, in the upper left corner."""
    scale = min(input_size[0] / image_size[0], input_size[1] / image_size[1])
    width, height = (max(1, round(side * scale)) for side in image_size)
    return Placement(image_size, input_size, (width, height))


def centered(image_size: tuple[int, int], input_size: tuple[int, int]) -> Placement:
    """Return the image as large as fits, in the center.

    >>> centered((640, 480), (640, 640)).top
    80
    """
    width, height = top_left(image_size, input_size).size
    left, top = (input_size[0] - width) // 2, (input_size[1] - height) // 2
    return Placement(image_size, input_size, (width, height), left, top)


def stretched(image_size: tuple[int, int], input_size: tuple[int, int]) -> Placement:
    """Return the image stretched over the whole input."""
    return Placement(image_size, input_size, input_size)


def sample_bilinear(image: NDArray[Any], rows: FloatArray, columns: FloatArray) -> FloatArray:
    """Return the image at every pair of a row and a column, interpolated between four pixels.

    The networks were trained on images resized in this way. Pillow's bilinear filter averages
    over more pixels when it shrinks an image, and a network finds fewer objects in the result.

    Args:
        image: shape (H, W) or (H, W, C); pixel centers have whole coordinates.
        rows: shape (h,); positions outside the image get the value at its edge.
        columns: shape (w,).

    Returns:
        Shape (h, w) or (h, w, C).

    >>> sample_bilinear(np.array([[0, 10], [20, 30]]), np.array([0.5]), np.array([0, 0.25, 9]))
    array([[10. , 12.5, 20. ]])
    """
    above, below, down = _neighbours(rows, image.shape[0])
    before, after, right = _neighbours(columns, image.shape[1])
    channels = (1,) * (image.ndim - 2)
    down = down.reshape(-1, 1, *channels)
    right = right.reshape(-1, *channels)
    between_rows = image[above] * (1 - down) + image[below] * down
    sampled: FloatArray = between_rows[:, before] * (1 - right) + between_rows[:, after] * right
    return sampled


def _neighbours(
    positions: FloatArray, count: int
) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.float32]]:
    """Return the pixels on both sides of each position, and the weight of the second."""
    inside = np.clip(positions, 0, count - 1)
    first = inside.astype(np.intp)
    return first, np.minimum(first + 1, count - 1), (inside - first).astype(np.float32)
