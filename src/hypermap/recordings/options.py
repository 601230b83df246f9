"""Options for data that a recording does not contain."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hypermap.core.errors import FormatError
from hypermap.core.trajectory import compose, pose_from_rpy
from hypermap.perception.frame import Camera
from hypermap.perception.pose_convention import CONVENTIONS, OPTICAL, optical_poses

_MOST_OFFSET = 10  # seconds between the clocks of poses and images


@dataclass(frozen=True)
class RecordingOptions:
    """How to read a recording; the defaults read a complete one as it is.

    Attributes:
        intrinsics: fx, fy, cx, cy of the depth images [pixels]; None takes the recording's own.
        map_T_world: pose of the recording's world in the map, whose z axis must point up, as x, y,
            z [m], roll, pitch, yaw [rad], or as a 3 x 4 or 4 x 4 matrix: an array, its rows, or
            its numbers row by row.
        map_frame: the fixed frame of a bag in which the map is made, z up; None takes `map`, or,
            where tf has no such frame, the root of tf above the camera.
        camera_frame: the optical frame of a bag's camera; None takes it from the depth messages.
        depth_topic: topic of the depth images; None finds one, as for all topics below.
        cloud_topic: topic of organized clouds; if given, they are used instead of depth images.
        color_topic: topic of the color images.
        camera_info_topic: topic of the intrinsics.
        detections_topic: topic of recorded detections.
        map_topic: topic of an occupancy map.
        depth_scale: units of integer depth per meter; None is the format's own (5000 for TUM,
            1000 otherwise).
        register: whether to register depth to color, that is, move it into the color camera.
        color_intrinsics: fx, fy, cx, cy of the color images [pixels], for `register`; None takes
            them from a bag's camera info.
        color_T_depth: pose of the depth camera in the color camera, as `map_T_world` is given, for
            `register`; None takes it from a bag's tf, and in folders both cameras for one place.
        time_offset: seconds by which the clock of the poses is ahead of that of the images: the
            image of time t was taken from the pose of time t + `time_offset`.
        rotate: degrees by which to rotate the images clockwise: 0, 90, 180 or 270; for a camera
            that is mounted upside down and whose poses say so.
        pose_convention: of the recorded poses; one of `perception.pose_convention.CONVENTIONS`.
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
    register: bool = False
    color_intrinsics: tuple[float, float, float, float] | None = None
    color_T_depth: ArrayLike | None = None
    time_offset: float = 0.0
    rotate: int = 0
    pose_convention: str = OPTICAL
    max_time_difference: float = 0.02
    max_pose_gap: float = 1.0
    every: int = 1

    def __post_init__(self) -> None:
        for name in ("intrinsics", "color_intrinsics"):
            self._check_intrinsics(name)
        for name in ("map_T_world", "color_T_depth"):
            self._check_pose(name)
        for name in ("color_intrinsics", "color_T_depth"):
            if getattr(self, name) is not None and not self.register:
                raise ValueError(f"{name} is for registering depth to color: give register, too")
        if self.depth_scale is not None and not 0 < self.depth_scale <= sys.float_info.max:
            raise ValueError(f"depth_scale must be positive, got {self.depth_scale}")
        if self.rotate not in (0, 90, 180, 270):
            raise ValueError(f"rotate must be 0, 90, 180 or 270 degrees, got {self.rotate}")
        if self.pose_convention not in CONVENTIONS:
            raise ValueError(
                f"pose_convention must be one of {', '.join(CONVENTIONS)}, got "
                f"{self.pose_convention!r}"
            )
        if not abs(self.time_offset) <= _MOST_OFFSET:
            raise ValueError(
                f"time_offset must be -{_MOST_OFFSET} .. {_MOST_OFFSET} s, got {self.time_offset}"
            )
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
        return _matrix("map_T_world", self.map_T_world)

    def poses_in_map(self, recorded: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return `map_T_camera` of the optical frame from poses as recorded, shape (..., 4, 4)."""
        return compose(self.world_pose(), optical_poses(recorded, self.pose_convention))

    def depth_pose(self) -> NDArray[np.float64]:
        """Return `color_T_depth` as a matrix, shape (4, 4); the identity if it was not given."""
        return _matrix("color_T_depth", self.color_T_depth)

    def camera(self, width: int, height: int) -> Camera | None:
        """Return the camera from the user, if given.

        Raises:
            FormatError: If its principal point is not on images of this size.
        """
        return _camera("--intrinsics", self.intrinsics, width, height)

    def color_camera(self, width: int, height: int) -> Camera | None:
        """Return the color camera from the user, if given; raises like `camera`."""
        return _camera("--color-intrinsics", self.color_intrinsics, width, height)

    def turned_size(self, camera: Camera) -> tuple[int, int]:
        """Return columns and rows of a camera's images after rotation."""
        size = camera.width, camera.height
        return size if self.rotate % 180 == 0 else size[::-1]

    def _check_intrinsics(self, name: str) -> None:
        numbers = getattr(self, name)
        if numbers is not None:
            _check_numbers(name, numbers, {4: "fx, fy, cx, cy"})
            if min(numbers[:2]) <= 0:
                hint = ""
                if numbers[1] < 0 < numbers[0]:  # as of ICL-NUIM
                    hint = "; a negative fy belongs to --pose-convention mirrored"
                raise ValueError(
                    f"{name}: the focal lengths must be positive, got {numbers[:2]}{hint}"
                )

    def _check_pose(self, name: str) -> None:
        if getattr(self, name) is not None:
            numbers = _row_by_row(name, getattr(self, name))
            object.__setattr__(self, name, numbers)  # as tuples, options can be compared
            meanings = {
                6: "x, y, z, roll, pitch, yaw",
                12: "the rows of a 3 x 4 matrix",
                16: "the rows of a 4 x 4 matrix",
            }
            _check_numbers(name, numbers, meanings)
            _matrix(name, numbers)


def nearest_rigid(pose: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rigid transform nearest to a 4 x 4 matrix of rounded numbers.

    Raises:
        ValueError: If it stretches by more than 1 %, mirrors, or has another last row.

    Source: the nearest rotation is that of the polar decomposition (Higham, 1986).
    """
    if not np.allclose(pose[3], [0, 0, 0, 1]):
        row = " ".join(f"{number:g}" for number in pose[3])
        hint = "; is it transposed?" if pose[3, :3].any() else ""
        raise ValueError(f"the last row of the matrix is {row}, not 0 0 0 1{hint}")
    left, stretch, right = np.linalg.svd(pose[:3, :3])
    if np.abs(stretch - 1).max() >= 1e-2:
        sizes = ", ".join(f"{number:g}" for number in stretch)
        raise ValueError(f"the matrix stretches by {sizes}, so it is not a rotation")
    if np.linalg.det(left @ right) < 0:
        raise ValueError("the matrix mirrors, so it is not a rotation")
    rigid = np.eye(4)
    rigid[:3, :3] = left @ right
    rigid[:3, 3] = pose[:3, 3]
    return rigid


def _camera(
    flag: str, intrinsics: tuple[float, float, float, float] | None, width: int, height: int
) -> Camera | None:
    if intrinsics is None:
        return None
    camera = Camera.from_intrinsics(*intrinsics, width=width, height=height)
    if not camera.has_center_on_image:
        raise FormatError(
            f"{flag}: the principal point ({intrinsics[2]:g}, {intrinsics[3]:g}) is not on the "
            f"images of {width} x {height} pixels: these intrinsics are for another image size"
        )
    return camera


def _matrix(name: str, pose: ArrayLike | None) -> NDArray[np.float64]:
    """Return a pose as a matrix, shape (4, 4); the identity for None."""
    if pose is None:
        return np.eye(4)
    numbers = _row_by_row(name, pose)
    if len(numbers) == 6:
        return pose_from_rpy(*numbers)
    return nearest_rigid(np.array(numbers).reshape(4, 4))


def _row_by_row(name: str, numbers: ArrayLike) -> tuple[float, ...]:
    """Return the numbers of a pose, which may be a matrix."""
    try:
        array = np.asarray(numbers, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise ValueError(f"{name} must be numbers: {error}") from None
    if array.ndim > 1 and array.shape not in ((3, 4), (4, 4)):
        raise ValueError(f"{name} must be a 3 x 4 or 4 x 4 matrix, got one of shape {array.shape}")
    row_by_row = tuple(array.ravel().tolist())
    return (*row_by_row, 0.0, 0.0, 0.0, 1.0) if len(row_by_row) == 12 else row_by_row


def _check_numbers(name: str, numbers: Sequence[float], meanings: dict[int, str]) -> None:
    if len(numbers) not in meanings:
        *others, last = (f"{n} numbers ({what})" for n, what in meanings.items())
        expected = f"{', '.join(others)} or {last}" if others else last
        raise ValueError(f"{name} must be {expected}, got {len(numbers)}")
    if not all(abs(number) <= sys.float_info.max for number in numbers):  # false for NaN
        raise ValueError(f"{name} must be finite numbers, got {tuple(numbers)}")
