"""Folders in the layout of the 7-Scenes data set."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from hypermap.core.errors import FileMissing, FormatError
from hypermap.core.trajectory import trajectory_of
from hypermap.perception.frame import Camera
from hypermap.perception.recording import RecordingInfo, Stream
from hypermap.recordings.folders import ImageFolder, Shot
from hypermap.recordings.options import RecordingOptions, nearest_rigid
from hypermap.recordings.problems import problems_of
from hypermap.recordings.textfiles import read_matrix

FRAME_RATE = 30.0  # frames per second; the files carry no times
_FILE = re.compile(r"frame-(\d+)\.(color\.jpg|color\.png|depth\.png|pose\.txt)")


@dataclass(frozen=True, eq=False)
class NumberedFrame:
    """The files of one frame, and its pose as recorded, shape (4, 4), or why there is none."""

    number: int
    depth: Path
    color: Path | None
    world_T_camera: NDArray[np.float64] | FormatError

    @property
    def stamp(self) -> float:
        """Seconds since frame 0."""
        return self.number / FRAME_RATE

    def pose(self, options: RecordingOptions) -> NDArray[np.float64]:
        """Return the camera's pose in the map, shape (4, 4).

        Raises:
            FormatError: If its file does not contain one.
        """
        if isinstance(self.world_T_camera, FormatError):
            raise self.world_T_camera
        return options.poses_in_map(self.world_T_camera)


class SevenScenesRecording(ImageFolder):
    """A folder with `frame-000000.color.jpg`, `.depth.png` and `.pose.txt`, and so on.

    Depth has 16 bits, in millimeters, 0 and 65535 for no return. A pose is a 4 x 4 matrix that
    takes camera points to the world, which need not be level (`map_T_world`). The 3 x 3
    matrix of the intrinsics is in `camera-intrinsics.txt`, next to the frames or one folder up.

    Source: Shotton et al., CVPR 2013, and the data set's page.
    """

    depth_scale: ClassVar[float] = 1000.0

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self._frames)

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
        streams = tuple(
            Stream(f"frame-*.{ending}", kind, len(self._files[ending]), use)
            for ending, kind, use in (
                ("depth.png", "depth images", "geometry"),
                ("color.jpg", "color images", "detection of objects"),
                ("color.png", "color images", "detection of objects"),
                ("pose.txt", "camera poses", "where each image was taken"),
            )
            if self._files[ending]
        )
        missing = []
        if not (self._files["color.jpg"] or self._files["color.png"]):
            missing.append(
                "there are no color images frame-*.color.jpg or .color.png: "
                "without them no objects can be detected"
            )
        frames, duration, image_size = 0, 0.0, None
        notes = [f"stamps are frame numbers at {FRAME_RATE:g} Hz"]
        if self._options.map_T_world is None:
            notes.append("the world is taken as level, z up; if it is not, give --world-transform")
        problems = problems_of(self, "_frames", "_camera", "_registration")
        if not problems:
            frames = len(self._frames)
            duration = self._frames[-1].stamp - self._frames[0].stamp
            image_size = self.image_size
            notes += self._left_out
        return RecordingInfo(
            self._path,
            "7-Scenes",
            duration,
            frames,
            image_size,
            streams,
            (*missing, *problems),
            tuple(notes),
        )

    @cached_property
    def _files(self) -> dict[str, dict[int, Path]]:
        """The files of each ending by frame number."""
        files: dict[str, dict[int, Path]] = {
            ending: {} for ending in ("color.jpg", "color.png", "depth.png", "pose.txt")
        }
        for path in self._path.iterdir():
            if match := _FILE.fullmatch(path.name):
                files[match[2]][int(match[1])] = path
        return files

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
        depths, poses = self._files["depth.png"], self._files["pose.txt"]
        colors = self._files["color.png"] | self._files["color.jpg"]
        wanted = [depths, poses, colors] if colors else [depths, poses]
        complete = sorted(set.intersection(*(set(files) for files in wanted)))
        incomplete = len(set(depths) | set(poses) | set(colors)) - len(complete)
        frames, lost = [], 0
        for number in complete:
            pose: NDArray[np.float64] | FormatError | None
            try:
                pose = read_pose(poses[number])
            except FormatError as error:
                pose = error
            if pose is None:
                lost += 1
            else:
                frames.append(NumberedFrame(number, depths[number], colors.get(number), pose))
        if self._options.time_offset:
            frames, left = moved_in_time(
                frames, self._options.time_offset, self._options.max_pose_gap
            )
            lost += left
        wrong = [frame.world_T_camera for frame in frames]
        broken = [error for error in wrong if isinstance(error, FormatError)]
        if frames and len(broken) == len(frames):
            raise broken[0]
        if not frames:
            raise FormatError(
                f"there is no complete frame: {len(depths)} depth images, {len(colors)} color "
                f"images and {len(poses)} poses, {lost} of them without tracking",
                path=self._path,
            )
        notes = []
        if incomplete:
            notes.append(f"{incomplete} frames lack an image or a pose and are left out")
        if broken:
            notes.append(f"poses that cannot be read: {len(broken)}, the first is {broken[0]}")
        if lost:
            past = ", or --time-offset leads past them" if self._options.time_offset else ""
            notes.append(f"{lost} frames have no pose (tracking was lost{past}) and are left out")
        return tuple(frames[:: self._options.every]), tuple(notes)

    @cached_property
    def _camera(self) -> Camera:
        width, height = self._depth_size([(frame.depth, frame.color) for frame in self._frames])
        return self._options.camera(width, height) or self._own_camera(width, height)

    def _own_camera(self, width: int, height: int) -> Camera:
        places = [folder / "camera-intrinsics.txt" for folder in (self._path, self._path.parent)]
        path = next((place for place in places if place.is_file()), None)
        if path is None:
            raise FileMissing(
                f"{places[0]}: there is no such file, nor one folder up; give --intrinsics "
                "(the data set's page says 585,585,320,240)"
            )
        try:
            camera = Camera(read_matrix(path, 3), width, height)
        except ValueError as error:
            raise FormatError(str(error), path=path) from None
        cx, cy = camera.K[:2, 2]
        if not (0 < cx < width and 0 < cy < height):
            raise FormatError(
                f"the principal point ({cx:g}, {cy:g}) is not on the images of {width} x {height} "
                "pixels: these intrinsics are for another image size; give --intrinsics",
                path=path,
            )
        return camera


def moved_in_time(
    frames: list[NumberedFrame], offset: float, max_gap: float
) -> tuple[list[NumberedFrame], int]:
    """Return frames with the poses `offset` [s] later, and how many are skipped without one."""
    posed = [frame for frame in frames if not isinstance(frame.world_T_camera, FormatError)]
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


def read_pose(path: Path) -> NDArray[np.float64] | None:
    """Return the pose in a file, shape (4, 4); None where tracking was lost.

    Raises:
        FormatError: If it is not a 4 x 4 matrix of a rigid transform.
    """
    pose = read_matrix(path, 4)
    if not np.isfinite(pose).all():
        return None
    try:
        return nearest_rigid(pose)
    except ValueError as error:
        raise FormatError(str(error), path=path) from None
