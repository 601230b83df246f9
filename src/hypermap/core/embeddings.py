"""Embeddings of objects: what encoders of images make of them, as unit vectors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from hypermap.core.arrays import IntArray

MOST_NUMBERS = 4096
"""How many numbers an embedding may have."""
_AT_ONCE = 50_000  # embeddings that are read as float32 together
_LONGEST = 1e12  # sums of unit vectors; their squares still fit into float32


class TextEncoder(Protocol):
    """Turns texts into vectors that can be compared with the embeddings of objects.

    Attributes:
        model: identifies a pair of encoders of images and texts.
    """

    model: str

    def texts(self, texts: list[str]) -> NDArray[np.float32]:
        """Return a unit vector for each text, shape (N, D)."""
        ...


@dataclass(frozen=True, eq=False)
class Embedding:
    """What all views of one object look like.

    Attributes:
        model: the encoders that made it.
        total: the sum of a unit vector for each view, times its score, float32, shape (D,).
    """

    model: str
    total: NDArray[np.float32]

    def __post_init__(self) -> None:
        if self.total.ndim != 1 or not 0 < len(self.total) <= MOST_NUMBERS:
            raise ValueError(f"an embedding has 1 to {MOST_NUMBERS} numbers")

    @property
    def length(self) -> float:
        """The length of the sum: how many views there are, and how alike."""
        return float(np.linalg.norm(self.total))

    def plus(self, other: Embedding | None) -> Embedding:
        """Return the embedding of the views of both; of different models the longer one stays."""
        if other is None:
            return self
        if other.model != self.model or len(other.total) != len(self.total):
            return self if self.length >= other.length else other
        return Embedding(self.model, self.total + other.total)


@dataclass(frozen=True, eq=False)
class Embeddings:
    """The embeddings of a layer's objects, all of one model, as columns.

    Attributes:
        model: the encoders that made them.
        ids: of the objects, int64, ascending, shape (N,).
        vectors: of length 1, float16, shape (N, D).
        lengths: as in `Embedding`, float32, shape (N,).

    Raises:
        ValueError: If the columns do not fit, or have numbers that are not finite or too large.
    """

    model: str
    ids: IntArray
    vectors: NDArray[np.float16]
    lengths: NDArray[np.float32]

    def __post_init__(self) -> None:
        rows = self.ids.shape
        if self.vectors.ndim != 2 or self.vectors.shape[:1] != rows or self.lengths.shape != rows:
            raise ValueError("the columns of the embeddings differ in length")
        if self.vectors.dtype != np.float16 or not 0 < self.vectors.shape[1] <= MOST_NUMBERS:
            raise ValueError(f"embeddings are 1 to {MOST_NUMBERS} numbers of float16")
        if (self.ids[1:] <= self.ids[:-1]).any():
            raise ValueError("the ids of the embeddings are not ascending")
        if not (np.isfinite(self.vectors).all() and np.isfinite(self.lengths).all()):
            raise ValueError("the numbers of embeddings must be finite")
        if not ((self.lengths >= 0) & (self.lengths <= _LONGEST)).all():
            raise ValueError(f"the lengths of embeddings are from 0 to {_LONGEST:g}")

    @classmethod
    def of(cls, found: Mapping[int, Embedding]) -> Embeddings | None:
        """Return embeddings by the objects' ids; of several models those of the most frequent."""
        models = [one.model for one in found.values()]
        if not models:
            return None
        model = max(dict.fromkeys(models), key=models.count)
        pairs = sorted((number, one) for number, one in found.items() if one.model == model)
        totals = np.array([one.total for _, one in pairs], dtype=np.float32)
        lengths = np.linalg.norm(totals, axis=1)
        units = totals / np.maximum(lengths, np.float32(1e-12))[:, np.newaxis]
        ids = np.array([number for number, _ in pairs], dtype=np.int64)
        return cls(model, ids, units.astype(np.float16), lengths.astype(np.float32))

    def __len__(self) -> int:
        return len(self.ids)

    def of_objects(self, ids: IntArray) -> Embeddings:
        """Return those of some objects."""
        rows = np.flatnonzero(np.isin(self.ids, ids))
        return Embeddings(self.model, self.ids[rows], self.vectors[rows], self.lengths[rows])

    def embedding(self, object_id: int) -> Embedding | None:
        """Return what is known of one object; None if nothing is."""
        row = int(np.searchsorted(self.ids, object_id))
        if row == len(self.ids) or self.ids[row] != object_id:
            return None
        return Embedding(self.model, self.vectors[row].astype(np.float32) * self.lengths[row])

    def similarities(self, vector: NDArray[np.float32], ids: IntArray) -> NDArray[np.float32]:
        """Return the cosines between a unit vector and some objects, shape (M,); NaN if unknown."""
        rows = np.minimum(np.searchsorted(self.ids, ids), len(self.ids) - 1)
        cosines = np.full(len(ids), np.nan, dtype=np.float32)
        known = np.flatnonzero(self.ids[rows] == ids)
        for begin in range(0, len(known), _AT_ONCE):
            part = known[begin : begin + _AT_ONCE]
            cosines[part] = self.vectors[rows[part]].astype(np.float32) @ vector
        return cosines

    @cached_property
    def coarse(self) -> tuple[NDArray[np.int8], NDArray[np.float32], float]:
        """The vectors in int8, (N, D), with the scale of each, (N,), and the largest error.

        Made at the first search, and kept: it is read four times as fast as float32.
        """
        codes = np.empty(self.vectors.shape, dtype=np.int8)
        scales = np.empty(len(self), dtype=np.float32)
        worst = 0.0
        for begin in range(0, len(self), _AT_ONCE):
            part = self.vectors[begin : begin + _AT_ONCE].astype(np.float32)
            scale = np.maximum(np.abs(part).max(axis=1), np.float32(1e-12)) / 127
            rounded = np.rint(part / scale[:, np.newaxis])
            codes[begin : begin + _AT_ONCE] = rounded
            scales[begin : begin + _AT_ONCE] = scale
            errors = np.linalg.norm(part - rounded * scale[:, np.newaxis], axis=1)
            worst = max(worst, float(errors.max()))
        return codes, scales, worst
