"""Measured values at places."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hypermap.core.arrays import BoolArray, PointsLike, as_points_xy


@dataclass(frozen=True, eq=False)
class Samples:
    """What a sensor said at places.

    Attributes:
        points_xy: where it was, shape (N, 2) [m].
        values: what it measured, float64, shape (N,), in its unit. Where nothing was heard it is
            the limit that the value lies below.
        is_below: whether a value is such a limit, shape (N,).
        stamps: when it was measured, float64, shape (N,) [s]; NaN if unknown.
    """

    points_xy: NDArray[np.float64]
    values: NDArray[np.float64]
    is_below: BoolArray
    stamps: NDArray[np.float64]

    @staticmethod
    def of(
        points_xy: PointsLike,
        values: ArrayLike,
        is_below: ArrayLike | None = None,
        stamps: ArrayLike | None = None,
    ) -> Samples:
        """Return samples, checked; without `is_below` all are values.

        Raises:
            ValueError: If the arrays do not have one entry for each point, a coordinate or value
                is not finite, or a stamp infinite.
        """
        points = as_points_xy(points_xy)
        below = np.zeros(len(points), dtype=bool) if is_below is None else np.array(is_below, bool)
        times = np.full(len(points), np.nan) if stamps is None else np.array(stamps, np.float64)
        numbers = np.array(values, dtype=np.float64)
        for name, column in (("values", numbers), ("is_below", below), ("stamps", times)):
            if column.shape != (len(points),):
                raise ValueError(f"{name} must have shape ({len(points)},), got {column.shape}")
        for name, column in (("values", numbers), ("stamps", np.nan_to_num(times, posinf=np.inf))):
            wrong = np.flatnonzero(~np.isfinite(column))
            if len(wrong):
                raise ValueError(f"{name}[{wrong[0]}] is not finite: {column[wrong[0]]}")
        return Samples(points, numbers, below, times)

    def __len__(self) -> int:
        return len(self.values)

    def chosen(self, which: BoolArray) -> Samples:
        """Return those for which `which`, shape (N,), is True."""
        return Samples(
            self.points_xy[which], self.values[which], self.is_below[which], self.stamps[which]
        )

    def joined(self, others: Samples) -> Samples:
        """Return these and others, in the same frame and unit."""
        columns = zip(vars(self).values(), vars(others).values(), strict=True)
        return Samples(*(np.concatenate(pair) for pair in columns))

    def censored(self, limit: float) -> Samples:
        """Return the samples, those below a limit as not heard: below that limit."""
        is_below = self.is_below | (self.values < limit)
        values = np.where(is_below, np.maximum(self.values, limit), self.values)
        return replace(self, values=values, is_below=is_below)
