"""Many points of a message, without an object for each."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from hypermap.ros.messages.geometry_messages import Types, points_of_rows


def many_points(points_xyz: NDArray[np.float64], types: Types) -> Any:
    """Return what a message that `writing_arrays` has made takes as its list of points.

    Args:
        points_xyz: shape (N, 3).
        types: the classes of messages.
    """
    point = types.message("geometry_msgs/Point")
    return points_xyz if is_ros1(point) else Points(point, points_xyz)


def is_ros1(message_class: type[Any]) -> bool:
    """Whether a class of messages is one of ROS 1, so that `writing_arrays` extends it."""
    return hasattr(message_class, "_slot_types")


class Points(Sequence[Any]):
    """Rows of an array as a sequence of `geometry_msgs/Point`, instead of a list of them.

    Messages are only ever written, so each point is made when it is its turn.

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
        return points_of_rows(self._point, self.points_xyz)

    @overload
    def __getitem__(self, place: int) -> Any: ...
    @overload
    def __getitem__(self, place: slice) -> Points: ...
    def __getitem__(self, place: int | slice) -> Any:
        if isinstance(place, slice):
            return Points(self._point, self.points_xyz[place])
        x, y, z = self.points_xyz[place].tolist()
        return self._point(x=x, y=y, z=z)
