"""Many points of a message, made when they are written rather than all at once."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray


class Points(Sequence[Any]):
    """Rows of an array as a sequence of `geometry_msgs/Point`, in place of a list of them.

    A million points as objects cost seconds; messages are only ever written, so each point is
    made when it is its turn.

    Args:
        point: the class of a point.
        points_xyz: shape (N, 3).
    """

    def __init__(self, point: type[Any], points_xyz: NDArray[np.float64]) -> None:
        if points_xyz.ndim != 2 or points_xyz.shape[1] != 3:
            raise ValueError(f"points must have shape (N, 3), got {points_xyz.shape}")
        self._point = point
        self.points_xyz = points_xyz

    def __len__(self) -> int:
        return len(self.points_xyz)

    def __iter__(self) -> Iterator[Any]:
        point = self._point
        for x, y, z in self.points_xyz.tolist():
            yield point(x=x, y=y, z=z)

    @overload
    def __getitem__(self, place: int) -> Any: ...
    @overload
    def __getitem__(self, place: slice) -> Points: ...
    def __getitem__(self, place: int | slice) -> Any:
        if isinstance(place, slice):
            return Points(self._point, self.points_xyz[place])
        x, y, z = self.points_xyz[place].tolist()
        return self._point(x=x, y=y, z=z)
