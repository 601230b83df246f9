"""Measured values at places."""

from __future__ import annotations

from dataclasses import dataclass

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
    """

    points_xy: NDArray[np.float64]
    values: NDArray[np.float64]
    is_below: BoolArray

    @staticmethod
    def of(
        points_xy: PointsLike,
        values: ArrayLike,
        is_below: ArrayLike | None = None,
    ) -> Samples:
        """Return samples, checked.

        Raises:
            ValueError: If the arrays do not have one entry for each point, or a coordinate or value
                is not finite.
        """
        points = as_points_xy(points_xy)
        below = np.zeros(len(points), dtype=bool) if is_below is None else np.array(is_below, bool)
        numbers = np.array(values, dtype=np.float64)
        for name, column in (("values", numbers), ("is_below", below)):
            if column.shape != (len(points),):
                raise ValueError(f"{name} must have shape ({len(points)},), got {column.shape}")
        for name, column in (("values", numbers), ("points_xy", points)):
            wrong = np.flatnonzero(~np.isfinite(column.reshape(len(points), -1)).all(axis=1))
            if len(wrong):
                raise ValueError(f"{name}[{wrong[0]}] is not finite: {column[wrong[0]]}")
        return Samples(points, numbers, below)

    def __len__(self) -> int:
        return len(self.values)

    def chosen(self, which: BoolArray) -> Samples:
        """Return those for which `which`, shape (N,), is True."""
        return Samples(self.points_xy[which], self.values[which], self.is_below[which])
