"""Folders in the layout of the TUM RGB-D benchmark."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path

import numpy as np

from hypermap.core.errors import FileMissing, FormatError, HypermapError
from hypermap.core.stamps import in_seconds
from hypermap.core.trajectory import Trajectory
from hypermap.perception.frame import Camera
from hypermap.perception.recording import RecordingInfo, Stream
from hypermap.recordings.folders import ImageFolder, Shot, absence_of
from hypermap.recordings.image_lists import (
    ImageList,
    read_associations,
    read_image_list,
)
from hypermap.recordings.pairing import FramePlan, plan_frames
from hypermap.recordings.problems import problems_of
from hypermap.recordings.textfiles import (
    check_finite,
    parse_numbers,
    read_header,
    read_lines,
    words_of,
)
from hypermap.text import counted

_TICKS = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}
_SPELLED_OUT = {
    "s": ("sec", "secs", "second", "seconds"),
    "m": ("meter", "meters", "metre", "metres"),
}
_UNIT_OF = {word: unit for unit, words in _SPELLED_OUT.items() for word in words}
_COLUMNS = (  # names of a stamp, a position and a quaternion, as p_RS_R_x, q_RS_w, tx, qw
    r"t|time|stamp|time_?stamp",
    *(rf"((p|t|pos|position)[_.]?(\w+[_.])?)?{axis}" for axis in "xyz"),
    *(rf"q(uat|uaternion)?[_.]?(\w+[_.])?{axis}" for axis in "xyzw"),
)
_OTHER_FORMS = {  # by how many numbers they have in a line
    9: "; RTAB-Map writes 8 with --poses_format 10",
    12: "; matrices, as of KITTI, have no stamps: write them in this form",
}


class TumRecording(ImageFolder):
    """A folder with `rgb.txt`, `depth.txt` and `groundtruth.txt`.

    `associations.txt` may replace the two lists. Their stamps are associated one to one, and
    poses are interpolated in the ground truth. Depth has 16 bits, 5000 to the meter, 0 and
    65535 for no return.

    Source: the benchmark's page on file formats (Sturm et al., IROS 2012).
    """

    depth_scale = 5000.0

    def __len__(self) -> int:
        """Return the number of frames."""
        _ = self._absence  # an error if no image is there
        return len(self._plan)

    @property
    def _left_out(self) -> tuple[str, ...]:
        return (*self._trajectory[1], *self._plan.notes)

    def _shots(self) -> list[Shot]:
        plan, depth, color = self._plan, self._depth, self._color
        return [
            Shot(
                stamp=float(depth.stamps[d]),
                depth=depth.paths[d],
                color=color.paths[c] if color else None,
                color_stamp=float(color.stamps[c]) if color else None,
                pose=partial(np.asarray, pose),
            )
            for d, c, pose in zip(plan.depth, plan.color, plan.map_T_camera, strict=True)
        ]

    def info(self) -> RecordingInfo:
        """Return what is in the folder and what is missing."""
        streams, missing, notes = [], [], []
        for name, kind, use in (
            ("depth.txt", "depth images", "geometry"),
            ("rgb.txt", "color images", "detection of objects"),
            ("associations.txt", "pairs of images", "geometry and detection of objects"),
            ("groundtruth.txt", "camera poses", "where each image was taken"),
        ):
            if (self._path / name).is_file():
                count = sum(1 for _ in _tolerant(self._path / name))
                streams.append(Stream(name, kind, count, use if count else ""))
        has_color = any((self._path / name).is_file() for name in ("rgb.txt", "associations.txt"))
        if not has_color and not self.has_detections:
            is_there = (self._path / "color.txt").is_file()  # as in OpenLORIS
            hint = "; color.txt is not read: name it rgb.txt" if is_there else ""
            missing.append(
                f"rgb.txt is missing: without color images no objects can be detected{hint}"
            )
        problems = problems_of(
            self, "_depth", "_color", "_trajectory", "_plan", "_absence", "_camera", "_registration"
        )
        missing += problems
        frames, duration, image_size = 0, 0.0, None
        if not problems:
            stamps = self._depth.stamps[self._plan.depth]
            frames, duration = len(stamps), float(stamps[-1] - stamps[0])
            image_size = self.image_size
            notes += [*self._trajectory[1], *self._plan.notes, *self._absence]
            if self._options.intrinsics is None:
                K = self._camera.K
                notes.append(
                    "the folder names no intrinsics: those that the benchmark recommends for all "
                    f"its cameras are taken, {K[0, 0]:g},{K[1, 1]:g},{K[0, 2]:g},{K[1, 2]:g} "
                    "without distortion (--intrinsics)"
                )
        return RecordingInfo(
            self._path,
            "TUM RGB-D",
            duration,
            frames,
            image_size,
            tuple(streams),
            tuple(missing),
            tuple(notes),
        )

    @cached_property
    def _depth(self) -> ImageList:
        if self._associations is not None:
            return self._associations[0]
        path = self._path / "depth.txt"
        if not path.is_file():
            raise FileMissing(
                f"{path}: there is no such list, and so no depth images, without which nothing can "
                "be mapped; write one if there are any: in each line a stamp and the image's name"
            )
        return read_image_list(path)

    @cached_property
    def _color(self) -> ImageList | None:
        if self._associations is not None:
            return self._associations[1]
        path = self._path / "rgb.txt"
        return read_image_list(path) if path.is_file() else None

    @cached_property
    def _associations(self) -> tuple[ImageList, ImageList] | None:
        """The list of pairs that replaces the two lists if there is no `depth.txt`."""
        path = self._path / "associations.txt"
        is_needed = path.is_file() and not (self._path / "depth.txt").is_file()
        return read_associations(path) if is_needed else None

    @cached_property
    def _trajectory(self) -> tuple[Trajectory, tuple[str, ...]]:
        path = self._path / "groundtruth.txt"
        if not path.is_file():
            raise FileMissing(
                f"{path}: there is no such file, and so no camera poses; SLAM estimates them: copy "
                "its trajectory here under this name, such as CameraTrajectory.txt of ORB-SLAM"
            )
        return read_trajectory(path, self._options.max_pose_gap)

    @cached_property
    def _plan(self) -> FramePlan:
        (trajectory, _), depth, color = self._trajectory, self._depth, self._color
        span = (float(trajectory.stamps[0]), float(trajectory.stamps[-1]))
        color_stamps = None if color is None else color.stamps
        try:
            return plan_frames(depth.stamps, color_stamps, trajectory, span, self._options)
        except FormatError as error:
            raise FormatError(str(error), path=self._path) from None

    @cached_property
    def _absence(self) -> list[str]:
        """Sentences on listed images that are missing; an error if all are."""
        depth, color, plan = self._depth.paths, self._color, self._plan
        absent = absence_of([depth[i] for i in plan.depth], "depth images", self._path)
        if color is not None:
            absent += absence_of([color.paths[i] for i in plan.color], "color images", self._path)
        return absent

    @cached_property
    def _camera(self) -> Camera:
        _ = self._absence  # an error if no image is there
        depth, color, plan = self._depth.paths, self._color, self._plan
        pairs = [
            (depth[d], color.paths[c] if color else None)
            for d, c in zip(plan.depth, plan.color, strict=True)
        ]
        width, height = self._depth_size(pairs)
        return self._options.camera(width, height) or default_camera(width, height, self._path)


def default_camera(width: int, height: int, path: Path) -> Camera:
    """Return the camera that the benchmark recommends, for images scaled from 640 x 480.

    Raises:
        FormatError: If the aspect ratio is not 4:3, as with the benchmark's cameras.
    """
    if 3 * width != 4 * height:
        raise FormatError(
            f"the images have {width} x {height} pixels, for which no intrinsics are known; "
            "give them with --intrinsics",
            path=path,
        )
    focal = 525.0 * width / 640
    return Camera.from_intrinsics(
        focal, focal, (width - 1) / 2, (height - 1) / 2, width=width, height=height
    )


def read_trajectory(path: Path, max_gap: float) -> tuple[Trajectory, tuple[str, ...]]:
    """Return the poses of a trajectory file in order of time, and notes on what was amiss.

    A line has a stamp, a position and a quaternion, x first, as in TUM RGB-D. A comment above the
    numbers that names all columns, with commas between, may say otherwise, as in EuRoC. Poses with
    NaN, which programs write while tracking is lost, are left out.

    Raises:
        FileMissing: If there is no file.
        FormatError: If a line is not a stamp, a position and a quaternion, or there is none.
    """
    rows, lost = [], 0
    header = _Header.of(read_header(path), path)
    for key, text in read_lines(path):
        numbers = parse_numbers(words_of(text), path, key)
        if header is not None:
            numbers = header.pose_in(numbers, path, key)
        elif len(numbers) != 8:
            raise FormatError(
                f"expected 8 numbers (stamp tx ty tz qx qy qz qw), found {len(numbers)}"
                + _OTHER_FORMS.get(len(numbers), ""),
                path=path,
                key=key,
            )
        if math.isfinite(numbers[0]) and any(map(math.isnan, numbers)):
            lost += 1
            continue
        check_finite(numbers, path, key)
        if not any(numbers[4:]):
            raise FormatError("the quaternion is zero", path=path, key=key)
        rows.append(numbers)
    if not rows:
        all_lost = f"all poses in it are NaN ({lost}), so tracking never worked"
        raise FormatError(all_lost if lost else "there are no poses in it", path=path)
    table = np.array(rows)
    ticks = None if header is None else header.ticks
    table[:, 0] = in_seconds(table[:, 0]) if ticks is None else table[:, 0] / ticks
    _, order = np.unique(table[:, 0], return_index=True)
    notes = [] if header is None or header.is_usual else [f"{path.name}: {header}"]
    if lost:
        notes.append(f"{counted(lost, 'pose')} of {path.name} left out: NaN, as of lost tracking")
    if (np.diff(table[:, 0]) < 0).any():
        notes.append(f"the stamps of {path.name} were out of order and have been sorted")
    if len(order) < len(table):
        repeated = counted(len(table) - len(order), "pose")
        notes.append(f"{repeated} of {path.name} left out: with the stamp of another")
    table = table[order]
    return Trajectory(table[:, 0], table[:, 1:4], table[:, 4:], max_gap), tuple(notes)


@dataclass(frozen=True)
class _Header:
    """Where a trajectory file has its numbers, by the names of its columns.

    Attributes:
        names: of all columns.
        columns: those of the stamp, x, y, z, and of the quaternion, x, y, z, w.
        ticks: stamps per second; None if the header does not say it.
    """

    names: list[str]
    columns: list[int]
    ticks: float | None

    @classmethod
    def of(cls, names: list[str], path: Path) -> _Header | None:
        """Return it; None if the names do not tell each of these columns.

        Raises:
            FormatError: If stamps or positions have another unit than we know.
        """
        plain = [re.sub(r"\[.*", "", name).strip().lower() for name in names]
        found = [[i for i, name in enumerate(plain) if re.fullmatch(p, name)] for p in _COLUMNS]
        if any(len(places) != 1 for places in found):
            return None
        columns = [places[0] for places in found]
        units = ["".join(re.findall(r"\[(.*)\]", names[i])).strip().lower() for i in columns]
        units = [_UNIT_OF.get(unit, unit) for unit in units]
        for i, known in ((0, _TICKS), (1, ("m",)), (2, ("m",)), (3, ("m",))):
            if units[i] and units[i] not in known:
                raise FormatError(
                    f"the column {names[columns[i]]!r} has the unit {units[i]!r}, known are: "
                    f"{', '.join(known)}",
                    path=path,
                    key="header",
                )
        return cls(names, columns, _TICKS.get(units[0]))

    @property
    def is_usual(self) -> bool:
        """Whether the columns are those that a file without such a header has."""
        return self.columns == list(range(8)) == list(range(len(self.names)))

    def pose_in(self, numbers: list[float], path: Path, key: str) -> list[float]:
        """Return the numbers of a line in the usual order."""
        if len(numbers) != len(self.names):
            raise FormatError(
                f"expected {len(self.names)} numbers, as its header says, found {len(numbers)}",
                path=path,
                key=key,
            )
        return [numbers[i] for i in self.columns]

    def __str__(self) -> str:
        others = len(self.names) - len(self.columns)
        left_out = f"; {counted(others, 'column')} more left out" if others else ""
        told = ", ".join(self.names[i] for i in self.columns)
        return f"its header names the columns {told}{left_out}"


def _tolerant(path: Path) -> Iterator[tuple[str, str]]:
    """Yield a list's lines up to the first that cannot be read."""
    try:
        yield from read_lines(path)
    except HypermapError:
        return
