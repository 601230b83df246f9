"""Frames in the plane: poses, and the tree that connects the frames of a map's layers."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import ObjectArray, PointsLike, as_points_xy
from hypermap.core.errors import FrameError, did_you_mean


@dataclass(frozen=True)
class Pose2D:
    """A pose in the plane [m, m, rad], read as the transform `parent_T_child`.

    >>> parent_T_child = Pose2D(x=1.0, yaw=math.pi / 2)
    >>> parent_T_child.apply([2.0, 0.0]).round(3)
    array([[1., 2.]])
    """

    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0

    def __post_init__(self) -> None:
        if not all(math.isfinite(value) for value in (self.x, self.y, self.yaw)):
            raise ValueError(f"a pose must be finite, got {self}")

    @property
    def is_identity(self) -> bool:
        """Whether the transform leaves every point where it is."""
        return self.x == 0 and self.y == 0 and self.yaw == 0

    def matrix(self) -> NDArray[np.float64]:
        """Return the homogeneous matrix, shape (3, 3)."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        return np.array([[c, -s, self.x], [s, c, self.y], [0.0, 0.0, 1.0]])

    def apply(self, points_xy: PointsLike) -> NDArray[np.float64]:
        """Return points given in the child frame, shape (N, 2), as points in the parent frame."""
        points = as_points_xy(points_xy)
        if self.is_identity:
            return points.copy()
        if self.yaw == 0:
            return np.add(points, [self.x, self.y], dtype=np.float64)
        # Written out: a matrix product may round a point differently depending on the other points.
        x, y = points.T
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        return np.column_stack([c * x - s * y + self.x, s * x + c * y + self.y])

    def apply_geometry(self, geometry: BaseGeometry) -> BaseGeometry:
        """Return a shapely geometry given in the child frame as one in the parent frame."""
        if self.is_identity:
            return geometry
        moved: BaseGeometry = shapely.transform(geometry, self.apply)
        return moved

    def apply_geometries(self, geometries: ObjectArray) -> ObjectArray:
        """Return shapely geometries, shape (N,), like `apply_geometry`."""
        if self.is_identity:
            return geometries
        return np.asarray(shapely.transform(geometries, self.apply))

    def inverse(self) -> Pose2D:
        """Return `child_T_parent`."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        return Pose2D(-c * self.x - s * self.y, s * self.x - c * self.y, -self.yaw)

    def __matmul__(self, other: Pose2D) -> Pose2D:
        """Return `a_T_c` from `a_T_b @ b_T_c`; the yaw is kept in [-pi, pi]."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        yaw = math.remainder(self.yaw + other.yaw, math.tau)
        return Pose2D(self.x + c * other.x - s * other.y, self.y + s * other.x + c * other.y, yaw)


@dataclass(frozen=True)
class Transform:
    """The pose of a child frame in its parent frame."""

    parent: str
    child: str
    pose: Pose2D


class FrameTree:
    """The frames of a map: every frame has at most one parent, and there are no loops.

    >>> tree = FrameTree([Transform("map", "lab", Pose2D(x=2.0))])
    >>> tree.lookup("map", "lab").apply([1.0, 0.0])
    array([[3., 0.]])
    """

    def __init__(self, transforms: Iterable[Transform] = ()) -> None:
        self._by_child: dict[str, Transform] = {}
        for transform in transforms:
            self.add(transform)

    def add(self, transform: Transform) -> None:
        """Add a transform; parents may come before or after their children.

        Raises:
            FrameError: If the child already has a parent, or the two would form a loop.
        """
        if transform.child in self._by_child:
            parent = self._by_child[transform.child].parent
            raise FrameError(f"frame {transform.child!r} already has the parent {parent!r}")
        if transform.child in (frame for frame, _ in self._to_root(transform.parent)):
            raise FrameError(
                f"frame {transform.child!r} cannot be a child of {transform.parent!r}: "
                "the two would form a loop"
            )
        self._by_child[transform.child] = transform

    def __iter__(self) -> Iterator[Transform]:
        """Yield the transforms in the order in which they were added."""
        return iter(self._by_child.values())

    def __len__(self) -> int:
        return len(self._by_child)

    @property
    def frames(self) -> list[str]:
        """All frames of the transforms; parents come first if they were added first."""
        names = (name for t in self for name in (t.parent, t.child))
        return list(dict.fromkeys(names))

    def lookup(self, target: str, source: str) -> Pose2D:
        """Return `target_T_source`, which takes points in `source` to points in `target`.

        Raises:
            FrameError: If the two frames are not connected.
        """
        if target == source:
            return Pose2D()
        from_source = dict(self._to_root(source))
        for frame, frame_T_target in self._to_root(target):
            if frame in from_source:
                return frame_T_target.inverse() @ from_source[frame]
        for name in (source, target):
            if name not in self.frames:
                hint = did_you_mean(name, self.frames)
                raise FrameError(f"no transform has the frame {name!r}; {hint}")
        raise FrameError(f"no transform connects the frame {source!r} with the frame {target!r}")

    def _to_root(self, frame: str) -> list[tuple[str, Pose2D]]:
        """Return the frame and its ancestors, each with the pose of `frame` in it."""
        path = [(frame, Pose2D())]
        while (transform := self._by_child.get(path[-1][0])) is not None:
            path.append((transform.parent, transform.pose @ path[-1][1]))
        return path
