"""The protocol of embedders: encoders of images and texts into one space."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray


class Embedder(Protocol):
    """Encodes images and texts as vectors, which are the more alike, the more their contents are.

    Attributes:
        model: identifies these encoders, for example by a checksum of their files.
    """

    model: str

    def images(self, images: Sequence[NDArray[np.uint8]]) -> NDArray[np.float32]:
        """Return a unit vector for each RGB image, uint8, (H, W, 3); shape (N, D)."""
        ...

    def texts(self, texts: list[str]) -> NDArray[np.float32]:
        """Return a unit vector for each text, shape (N, D)."""
        ...


def unit_vectors(vectors: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return vectors, shape (N, D), at length 1."""
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    scaled: NDArray[np.float32] = (vectors / np.maximum(lengths, 1e-12)).astype(np.float32)
    return scaled
