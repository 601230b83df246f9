"""What a user can say about a recording that the recording does not say itself."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hypermap.core.trajectory import pose_from_rpy
from hypermap.perception.frame import Camera


@dataclass(frozen=True)
class RecordingOptions:
    """How to read a recording; the defaults read a complete one as it is.

    Attributes:
        intrinsics: fx, fy, cx, cy of the depth images [pixels]; None takes the recording's own.
        map_T_world: pose of the recording's world in the map, whose z axis must point up, as x, y,
            z [m], roll, pitch, yaw [rad], or as a 4 x 4 matrix: an array, its rows, or its 16
            numbers row by row.
        map_frame: the fixed frame of a bag in which the map is made, z up; None takes `map`, or,
            where tf has no such frame, the root of tf above the camera.
        camera_frame: the optical frame of a bag's camera; None takes it from the depth messages.
        depth_topic: topic of the depth images; None finds one, as for all topics below.
        cloud_topic: topic of organised clouds; when given, they are used in place of depth images.
        color_topic: topic of the color images.
        camera_info_topic: topic of the intrinsics.
        detections_topic: topic of recorded detections.
        map_topic: topic of an occupancy map.
        depth_scale: units of integer depth per meter; None is the format's own (5000 for TUM,
            1000 otherwise).
        max_time_difference: seconds by which the stamps of a depth image and of the color image
            or detections that go with it may differ, at most 1.
        max_pose_gap: seconds between two poses across which none is interpolated.
        every: use every n-th frame.

    Raises:
        ValueError: If a value is out of its range.
    """

    intrinsics: tuple[float, float, float, float] | None = None
    map_T_world: ArrayLike | None = None
    map_frame: str | None = None
    camera_frame: str | None = None
    depth_topic: str | None = None
    cloud_topic: str | None = None
    color_topic: str | None = None
    camera_info_topic: str | None = None
    detections_topic: str | None = None
    map_topic: str | None = None
    depth_scale: float | None = None
    max_time_difference: float = 0.02
    max_pose_gap: float = 1.0
    every: int = 1

    def __post_init__(self) -> None:
        if self.intrinsics is not None:
            _check_numbers("intrinsics", self.intrinsics, {4: "fx, fy, cx, cy"})
            if min(self.intrinsics[:2]) <= 0:
                raise ValueError(f"the focal lengths must be positive, got {self.intrinsics[:2]}")
        if self.map_T_world is not None:
            # As a tuple, options can be compared, too.
            object.__setattr__(self, "map_T_world", _row_by_row(self.map_T_world))
            _check_numbers(
                "map_T_world",
                _row_by_row(self.map_T_world),
                {6: "x, y, z, roll, pitch, yaw", 16: "the rows of a 4 x 4 matrix"},
            )
            self.world_pose()
        if self.depth_scale is not None and not 0 < self.depth_scale < math.inf:
            raise ValueError(f"depth_scale must be positive, got {self.depth_scale}")
        if not 0 <= self.max_time_difference <= 1:
            raise ValueError(
                f"max_time_difference must be 0 .. 1 s, got {self.max_time_difference}"
            )
        if not self.max_pose_gap > 0:
            raise ValueError(f"max_pose_gap must be positive, got {self.max_pose_gap}")
        if self.every < 1:
            raise ValueError(f"every must be at least 1, got {self.every}")
        if self.map_frame == "":
            raise ValueError("map_frame must be the name of a frame, got an empty string")

    def world_pose(self) -> NDArray[np.float64]:
        """Return `map_T_world` as a matrix, shape (4, 4); the identity if it was not given."""
        if self.map_T_world is None:
            return np.eye(4)
        numbers = _row_by_row(self.map_T_world)
        if len(numbers) == 6:
            return pose_from_rpy(*numbers)
        return nearest_rigid(np.array(numbers).reshape(4, 4))

    def camera(self, width: int, height: int) -> Camera | None:
        """Return the camera that the user described, if so."""
        if self.intrinsics is None:
            return None
        return Camera.from_intrinsics(*self.intrinsics, width=width, height=height)


def nearest_rigid(pose: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rotation and translation that a 4 x 4 matrix of rounded numbers stands for.

    Raises:
        ValueError: If it stretches by more than 1 %, mirrors, or has another last row.

    Source: the nearest rotation is that of the polar decomposition (Higham, 1986).
    """
    left, stretch, right = np.linalg.svd(pose[:3, :3])
    is_rigid = (
        np.abs(stretch - 1).max() < 1e-2
        and np.linalg.det(left @ right) > 0
        and np.allclose(pose[3], [0, 0, 0, 1])
    )
    if not is_rigid:
        raise ValueError("the matrix is not a rotation and a translation with last row 0 0 0 1")
    rigid = np.eye(4)
    rigid[:3, :3] = left @ right
    rigid[:3, 3] = pose[:3, 3]
    return rigid


def _row_by_row(numbers: ArrayLike) -> tuple[float, ...]:
    """Return the numbers of a pose, which may be a matrix."""
    try:
        array = np.asarray(numbers, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ValueError(f"map_T_world must be numbers: {error}") from None
    if array.ndim > 1 and array.shape != (4, 4):
        raise ValueError(f"map_T_world must be a 4 x 4 matrix, got one of shape {array.shape}")
    return tuple(array.ravel().tolist())


def _check_numbers(name: str, numbers: Sequence[float], meanings: dict[int, str]) -> None:
    if len(numbers) not in meanings:
        expected = " or ".join(f"{n} numbers ({what})" for n, what in meanings.items())
        raise ValueError(f"{name} must be {expected}, got {len(numbers)}")
    if not all(math.isfinite(number) for number in numbers):
        raise ValueError(f"{name} must be finite numbers, got {tuple(numbers)}")
