"""Folders of images whose names contain the number of their frame: 7-Scenes, ScanNet, Replica."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hypermap.core.errors import FileMissing, FormatError, HypermapError
from hypermap.core.stamps import ticks_per_second
from hypermap.core.trajectory import trajectory_of
from hypermap.perception.frame import Camera
from hypermap.perception.recording import RecordingInfo, Stream
from hypermap.recordings.folders import ImageFolder, Shot, usual_size
from hypermap.recordings.intrinsics_files import Intrinsics, color_intrinsics, depth_intrinsics
from hypermap.recordings.layouts import POSES_USE, FoundFiles, Layout
from hypermap.recordings.numbered_poses import NumberedPose, are_sorted_as_text, read_numbered_poses
from hypermap.recordings.options import RecordingOptions
from hypermap.recordings.problems import problems_of
from hypermap.text import counted

FRAME_RATE = 30.0  # frames per second; the files carry no times


@dataclass(frozen=True, eq=False)
class NumberedFrame:
    """The files of one frame, and its pose as recorded, shape (4, 4), or why there is none.

    Its stamp is in seconds since frame 0, or since 1970 if the numbers are times.
    """

    stamp: float
    depth: Path
    color: Path | None
    world_T_camera: NDArray[np.float64] | HypermapError

    def pose(self, options: RecordingOptions) -> NDArray[np.float64]:
        """Return the camera's pose in the map, shape (4, 4).

        Raises:
            FileMissing: If it has no file.
            FormatError: If its file does not contain one.
        """
        if isinstance(self.world_T_camera, HypermapError):
            raise self.world_T_camera
        return options.poses_in_map(self.world_T_camera)


class NumberedRecording(ImageFolder):
    """A folder of depth and color images whose names contain the number of their frame.

    Depth has 16 bits, in millimeters if nothing says otherwise, 0 and 65535 for no return. A pose
    is a 4 x 4 matrix that takes camera points to the world, which need not be level
    (`map_T_world`). Color may have another size than depth, if a file has its intrinsics: both are
    then of cameras in one place, as in ScanNet.

    Sources: the pages of 7-Scenes (Shotton et al., CVPR 2013), ScanNet (Dai et al., CVPR 2017) and
    Redwood (Choi et al., CVPR 2015), and NICE-SLAM's Replica (Zhu et al., CVPR 2022).
    """

    def __init__(self, path: Path, options: RecordingOptions, layout: Layout) -> None:
        super().__init__(path, options)
        self._layout = layout
        self._files = FoundFiles(path, layout)

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self._frames)

    @property
    def depth_scale(self) -> float:
        """Units of depth per meter: those of the file of intrinsics, or of the layout."""
        said = None if self._intrinsics is None else self._intrinsics.depth_scale
        return said or self._layout.depth_scale

    def _shots(self) -> list[Shot]:
        return [
            Shot(
                stamp=frame.stamp,
                depth=frame.depth,
                color=frame.color,
                color_stamp=frame.stamp if frame.color else None,
                pose=partial(frame.pose, self._options),
            )
            for frame in self._frames
        ]

    def info(self) -> RecordingInfo:
        """Return what is in the folder and what is missing."""
        missing = []
        if not self._files.color and not self.has_detections:
            missing.append(
                f"there are no color images {self._layout.color.example}: "
                "without them no objects can be detected"
            )
        frames, duration, image_size = 0, 0.0, None
        notes = [
            "stamps are the times in the names of the files"
            if ticks_per_second(list(self._files.depth))
            else f"stamps are frame numbers at {FRAME_RATE:g} Hz"
        ]
        if self._options.map_T_world is None:
            notes.append(
                "the world is taken as level, z up; if it is not, give --level auto or "
                "--world-transform"
            )
        needs = ("_poses", "_frames", "_camera", "_color_camera", "_registration")
        problems = problems_of(self, *needs)
        if not problems:
            frames = len(self._frames)
            duration = self._frames[-1].stamp - self._frames[0].stamp
            image_size = self.image_size
            notes += self._left_out
        return RecordingInfo(
            self._path,
            self._layout.name,
            duration,
            frames,
            image_size,
            tuple(self._streams()),
            (*missing, *problems),
            tuple(notes),
        )

    def _streams(self) -> Iterator[Stream]:
        files = self._files
        yield from files.streams()
        if files.trajectory is not None:
            name = files.trajectory.relative_to(self._path).as_posix()
            count = 0 if problems_of(self, "_poses") else len(self._poses)
            yield Stream(name, "camera poses", count, POSES_USE if count else "")

    @property
    def _frames(self) -> tuple[NumberedFrame, ...]:
        return self._frames_and_notes[0]

    @property
    def _left_out(self) -> tuple[str, ...]:
        return self._frames_and_notes[1]

    @cached_property
    def _frames_and_notes(self) -> tuple[tuple[NumberedFrame, ...], tuple[str, ...]]:
        """The complete frames.

        All frames may lack color, but if most have it, the others are skipped.
        """
        depths, colors, poses = self._files.depth, self._files.color, self._poses
        wanted = [set(depths), set(poses), *([set(colors)] if colors else [])]
        complete = sorted(set.intersection(*wanted))
        incomplete = len(set(depths) | set(poses) | set(colors)) - len(complete)
        rate = ticks_per_second(list(depths)) or FRAME_RATE
        frames, lost = [], 0
        for number in complete:
            pose = poses[number]
            if pose is None:
                lost += 1
            else:
                stamp, color = number / rate, colors.get(number)
                frames.append(NumberedFrame(stamp, depths[number], color, pose))
        if self._options.time_offset:
            frames, left = moved_in_time(
                frames, self._options.time_offset, self._options.max_pose_gap
            )
            lost += left
        wrong = [frame.world_T_camera for frame in frames]
        broken = [error for error in wrong if isinstance(error, HypermapError)]
        if frames and len(broken) == len(frames):
            raise broken[0]
        if not frames:
            raise FormatError(
                f"there is no complete frame: {counted(len(depths), 'depth image')}, "
                f"{counted(len(colors), 'color image')} and {counted(len(poses), 'pose')}, "
                f"{lost} of them without tracking",
                path=self._path,
            )
        notes = [*self._doubts_about_trajectory()]
        if incomplete:
            notes.append(f"left out, without an image or a pose: {counted(incomplete, 'frame')}")
        if broken:
            notes.append(f"poses that cannot be read: {len(broken)}, the first is {broken[0]}")
        if lost:
            past = ", or --time-offset leads past them" if self._options.time_offset else ""
            many = counted(lost, "frame")
            notes.append(f"left out, without a pose (tracking was lost{past}): {many}")
        return tuple(frames[:: self._options.every]), tuple(notes)

    def _doubts_about_trajectory(self) -> Iterator[str]:
        """Yield why the poses in one file for all images may be those of others."""
        file, depths, poses = self._files.trajectory, self._files.depth, self._poses
        if file is None:
            return
        if len(poses) != len(depths):
            yield (
                f"{file.name} has {counted(len(poses), 'pose')} for "
                f"{counted(len(depths), 'depth image')}: they are taken as those of the images "
                f"{min(poses)} to {max(poses)}; if they are of others, the images must be named by "
                f"the number of their pose, from {min(poses)}"
            )
        if are_sorted_as_text(list(poses.values())):
            yield (
                f"the poses of {file.name} seem to be in the order 0, 1, 10, 11, ..., 2 of files "
                "sorted as text, so most images have that of another one: sort them by number"
            )

    @cached_property
    def _poses(self) -> dict[int, NumberedPose]:
        if self._files.depth and not self._files.poses and self._files.trajectory is None:
            names = filter(None, [self._layout.poses.example, *self._layout.trajectories])
            raise FileMissing(
                f"{self._path}: there are no camera poses, expected {' or '.join(names)}; SLAM "
                "estimates them"
            )
        return read_numbered_poses(self._files)

    @cached_property
    def _intrinsics(self) -> Intrinsics | None:
        """Those of depth in a file; None if there is none."""
        return depth_intrinsics(self._path)

    @cached_property
    def _camera(self) -> Camera:
        has_own_color = color_intrinsics(self._path) is not None
        frames = [(frame.depth, None if has_own_color else frame.color) for frame in self._frames]
        width, height = self._depth_size(frames)
        given = self._options.camera(width, height)
        if given is not None:
            return given
        if self._intrinsics is None:
            raise FileMissing(
                f"{self._path}: there are no intrinsics, here or one folder up: "
                f"{self._layout.intrinsics}"
            )
        return self._intrinsics.camera(width, height)

    @cached_property
    def _color_camera(self) -> Camera | None:
        intrinsics = color_intrinsics(self._path)
        colors = [(frame.color, None) for frame in self._frames if frame.color is not None]
        if intrinsics is None or not colors:
            return None
        width, height = usual_size(colors)
        if (width, height) == (self._camera.width, self._camera.height):
            return None
        return intrinsics.camera(width, height)


def moved_in_time(
    frames: list[NumberedFrame], offset: float, max_gap: float
) -> tuple[list[NumberedFrame], int]:
    """Return frames with the poses `offset` [s] later, and how many are skipped without one."""
    posed = [frame for frame in frames if not isinstance(frame.world_T_camera, HypermapError)]
    if not posed:
        return frames, 0
    poses = np.array([frame.world_T_camera for frame in posed])
    stamps = np.array([frame.stamp for frame in posed])
    trajectory = trajectory_of(stamps, poses, max_gap)
    known = trajectory.covers(stamps + offset)
    moved = trajectory.at((stamps + offset)[known])
    found = [frame for frame, is_known in zip(posed, known, strict=True) if is_known]
    return [
        replace(frame, world_T_camera=pose) for frame, pose in zip(found, moved, strict=True)
    ], len(posed) - len(found)
