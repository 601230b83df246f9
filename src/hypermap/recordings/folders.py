"""The common base of recordings that are folders of depth and color images."""

from __future__ import annotations

import logging
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from hypermap.core.errors import FileMissing, FormatError, HypermapError
from hypermap.core.occupancy import OccupancyLayer
from hypermap.perception.detectors.origin import FILE
from hypermap.perception.frame import Camera, RgbdFrame
from hypermap.perception.recording import OnBadFrame, PendingFrame, or_report
from hypermap.perception.turning import turned
from hypermap.recordings.options import RecordingOptions
from hypermap.recordings.pictures import (
    decode_color,
    decode_integers,
    depth_in_meters,
    picture_size,
    read_file,
    seen_by,
)

if TYPE_CHECKING:
    from hypermap.perception.registration import Registration

_FIRST = 5  # frames used to find the size; one may be odd or two broken

_log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class Shot:
    """One frame of a folder, not yet read.

    Attributes:
        stamp: of the depth image [s].
        depth: its file.
        color: that of the color image; None if there is none.
        color_stamp: the same [s].
        pose: returns `map_T_camera`, shape (4, 4), or raises a FormatError.
    """

    stamp: float
    depth: Path
    color: Path | None
    color_stamp: float | None
    pose: Callable[[], NDArray[np.float64]]


@dataclass(frozen=True, eq=False)
class ShotReader:
    """Reads the frames of a folder.

    Attributes:
        depth_camera: of all depth images.
        units_per_meter: of their integers.
        color_camera: of color images that have another size, taken from the same place; None if
            they are registered.
        registration: of depth to color; None if depth is already registered.
        rotate: degrees by which to rotate the images clockwise.
    """

    depth_camera: Camera
    units_per_meter: float
    color_camera: Camera | None
    registration: Registration | None
    rotate: int

    def pose(self, shot: Shot) -> NDArray[np.float64]:
        """Return `map_T_camera` of a frame, shape (4, 4), before its images are rotated.

        Raises:
            HypermapError: If its pose cannot be read.
        """
        pose = shot.pose()
        return pose if self.registration is None else self.registration.pose(pose)

    def frame(self, shot: Shot) -> RgbdFrame:
        """Return a frame.

        Raises:
            HypermapError: If its pose or its depth image cannot be read.
        """
        pose, camera, color_camera = self.pose(shot), self.depth_camera, self.color_camera
        depth = load_depth(shot.depth, camera, self.units_per_meter)
        if self.registration is not None:
            depth, camera = self.registration.depth(depth, camera), self.registration.camera
            color_camera = None
        frame = RgbdFrame(
            stamp=shot.stamp,
            depth=depth,
            camera=camera,
            map_T_camera=pose,
            color=partial(load_color, shot.color, camera, color_camera) if shot.color else None,
            color_stamp=shot.color_stamp,
        )
        return turned(frame, self.rotate)


class ImageFolder(ABC):
    """A recording that is a folder of depth and color images with poses."""

    def __init__(self, path: Path, options: RecordingOptions) -> None:
        self._path = path
        self._options = options

    @property
    def path(self) -> Path:
        """The folder."""
        return self._path

    @property
    def frame_id(self) -> str:
        """The name of the map's frame; "map" by default."""
        return self._options.map_frame or "map"

    @property
    def has_detections(self) -> bool:
        """Whether it has recorded detections, so that objects can be mapped without color."""
        return (self._path / FILE).is_file()

    def frames(self, on_bad: OnBadFrame | None = None) -> Iterator[RgbdFrame]:
        """Yield the frames in order of time; see `Recording.frames`.

        Files that give no frame are logged.

        Raises:
            FormatError: If a list, an image, a pose or the intrinsics are broken.
            FileMissing: If one of them is missing.
        """
        for pending in self.pending():
            if (frame := or_report(pending.load, pending.stamp, on_bad)) is not None:
                yield frame

    def pending(self, on_bad: OnBadFrame | None = None) -> Iterator[PendingFrame]:  # noqa: ARG002
        """Yield the frames before they are read; see `PendingRecording.pending`."""
        shots, depth_camera, registration = self._shots(), self._camera, self._registration
        for note in self._left_out:
            _log.warning("%s: %s", self._path, note)
        scale = self._options.depth_scale or self.depth_scale
        reader = ShotReader(
            depth_camera, scale, self._color_camera, registration, self._options.rotate
        )
        for shot in shots:
            try:
                pose = reader.pose(shot)
            except HypermapError:  # `load` will raise it, too
                pose = None
            yield PendingFrame(shot.stamp, pose, partial(reader.frame, shot))

    def occupancy(self) -> OccupancyLayer | None:
        """Return None: such a folder holds no occupancy map."""
        return None

    @property
    @abstractmethod
    def depth_scale(self) -> float:
        """Units of its depth images per meter, unless the options say otherwise."""

    @property
    @abstractmethod
    def _camera(self) -> Camera:
        """The camera of the depth images."""

    @property
    def _color_camera(self) -> Camera | None:
        """That of color, if its images have another size but are taken from the same place."""
        return None

    @property
    def image_size(self) -> tuple[int, int]:
        """Columns and rows of its frames."""
        camera = self._camera if self._registration is None else self._registration.camera
        return self._options.turned_size(camera)

    @cached_property
    def _registration(self) -> Registration | None:
        """The registration of depth to color; None if depth is already registered.

        Raises:
            FormatError: If the color camera is unknown.
        """
        if not self._options.register:
            return None
        colors = [(shot.color, None) for shot in self._shots() if shot.color is not None]
        width, height = usual_size(colors) if colors else (self._camera.width, self._camera.height)
        camera = self._options.color_camera(width, height)
        if camera is None:
            raise FormatError(
                "a folder does not contain the pose and intrinsics of the color camera, which "
                "--register needs; give --color-intrinsics and --depth-transform",
                path=self._path,
            )
        # Imported here: numba is slow to load.
        from hypermap.perception.registration import Registration

        return Registration(camera, self._options.depth_pose())

    def _depth_size(self, pictures: Sequence[tuple[Path, Path | None]]) -> tuple[int, int]:
        """Return columns and rows of the depth images; raises like `usual_size`.

        Color has the same size, unless depth has yet to be registered.
        """
        if self._options.register:
            pictures = [(depth, None) for depth, _ in pictures]
        return usual_size(pictures)

    @property
    @abstractmethod
    def _left_out(self) -> Sequence[str]:
        """Sentences on files that give no frame."""

    @abstractmethod
    def _shots(self) -> Sequence[Shot]:
        """Return the frames in order of time."""


def load_depth(path: Path, camera: Camera, units_per_meter: float) -> NDArray[np.float32]:
    """Return a depth image in meters with NaN for no return, shape (H, W).

    Raises:
        FileMissing: If there is no such file.
        FormatError: If it is not a 16-bit image of the camera's size.
    """
    content = read_file(path)
    try:
        integers = decode_integers(content)
    except FormatError as error:
        raise FormatError(str(error), path=path) from None
    _check_size(path, integers.shape, camera, "the first depth image")
    return depth_in_meters(integers, units_per_meter)


def load_color(path: Path, camera: Camera, color_camera: Camera | None = None) -> NDArray[np.uint8]:
    """Return a color image as `camera` sees it, RGB, uint8, shape (H, W, 3).

    Args:
        path: of the image.
        camera: the one whose pixels are asked for.
        color_camera: that of the image, in the same place; None takes `camera`.

    Raises:
        FileMissing: If there is no such file.
        FormatError: If it is not a color image, or not of the depth image's size.
    """
    content = read_file(path)
    try:
        color = decode_color(content)
    except FormatError as error:
        raise FormatError(str(error), path=path) from None
    if color_camera is not None:
        _check_size(path, color.shape, color_camera, "the first color image")
        return seen_by(color, color_camera.K, camera)
    _check_size(path, color.shape, camera, "the depth image (color must be registered to depth)")
    return color


def usual_size(pictures: Sequence[tuple[Path, Path | None]]) -> tuple[int, int]:
    """Return columns and rows of a recording's frames: the most common of its first good ones.

    Args:
        pictures: depth and color of each frame, at least one.

    Raises:
        FileMissing: If there is no depth image; names the first, as the next error does.
        FormatError: If none is an image, or each one's color has another size.
    """
    sizes: list[tuple[int, int]] = []
    first: HypermapError | None = None
    for depth, color in pictures:
        try:
            sizes.append(_frame_size(depth, color))
        except HypermapError as error:
            first = first or error
        if len(sizes) == _FIRST:
            break
    if not sizes and first is not None:
        raise first
    return Counter(sizes).most_common(1)[0][0]


def _frame_size(depth: Path, color: Path | None) -> tuple[int, int]:
    width, height = _size_of(depth)
    if color is not None and _is_there(color) and _size_of(color) != (width, height):
        color_width, color_height = _size_of(color)
        raise FormatError(
            f"color has {color_width} x {color_height} pixels, but depth in {depth} has "
            f"{width} x {height}; color must be registered to depth and have its size; or give "
            "--register, --color-intrinsics and --depth-transform",
            path=color,
        )
    return width, height


def _size_of(path: Path) -> tuple[int, int]:
    content = read_file(path)
    try:
        return picture_size(content)
    except FormatError as error:
        raise FormatError(str(error), path=path) from None


def absence_of(paths: Sequence[Path], kind: str, source: Path) -> list[str]:
    """Return a sentence on missing files that a recording lists, if there are any.

    Raises:
        FileMissing: If all of them are.
    """
    absent = [path for path in paths if not _is_there(path)]
    if not absent:
        return []
    what = f"{len(absent)} of {len(paths)} {kind} are missing, the first is {absent[0]}"
    if len(absent) == len(paths):
        raise FileMissing(f"{source}: {what}")
    return [what]


def _is_there(path: Path) -> bool:
    try:
        return path.is_file()
    except OSError:  # a list may name anything, such as names that are too long
        return False


def _check_size(path: Path, shape: tuple[int, ...], camera: Camera, other: str) -> None:
    if shape[:2] != (camera.height, camera.width):
        raise FormatError(
            f"the picture has {shape[1]} x {shape[0]} pixels, "
            f"but {other} has {camera.width} x {camera.height}",
            path=path,
        )
