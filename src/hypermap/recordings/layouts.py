"""Where data sets keep the files of their frames, which carry the frame's number."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from hypermap.perception.recording import Stream

POSES_USE = "where each image was taken"
_NUMBER = re.compile(r"\d+((?:\.[A-Za-z]+)+)$")


@dataclass(frozen=True)
class Files:
    """Files of one kind, such as depth images.

    Attributes:
        folders: below that of the recording; the first with such files is taken.
        name: a pattern of file names, whose one group is the frame's number.
        example: their names as a person would say them.
    """

    folders: tuple[str, ...]
    name: re.Pattern[str]
    example: str

    def find(self, path: Path) -> dict[int, Path]:
        """Return the files of a recording at `path`, by their frames' numbers."""
        places = [path / name for name in self.folders if (path / name).is_dir()]
        found = (dict(sorted(_numbered(place, self.name))) for place in places)
        return next(filter(None, found), {})


@dataclass(frozen=True)
class Layout:
    """How a data set arranges its files.

    Attributes:
        name: of the data set.
        depth: images of 16 bits.
        color: images; a PNG is preferred to a JPEG of the same frame.
        poses: a 4 x 4 matrix in a file for each frame.
        trajectories: files with the poses of all frames; the first that exists is taken.
        depth_scale: units of depth per meter, unless a file of intrinsics says otherwise.
        intrinsics: where they are expected, and how else to give them.
    """

    name: str
    depth: Files
    color: Files
    poses: Files
    trajectories: tuple[str, ...] = ()
    depth_scale: float = 1000.0
    intrinsics: str = (
        "expected camera-intrinsics.txt, intrinsic/intrinsic_depth.txt or camera_intrinsic.json; "
        "or give --intrinsics"
    )


@dataclass(frozen=True)
class FoundFiles:
    """The files of a recording, by their frames' numbers."""

    path: Path
    layout: Layout

    @cached_property
    def depth(self) -> dict[int, Path]:
        """The depth images."""
        return self.layout.depth.find(self.path)

    @cached_property
    def color(self) -> dict[int, Path]:
        """The color images."""
        return self.layout.color.find(self.path)

    @cached_property
    def poses(self) -> dict[int, Path]:
        """The files of one pose each."""
        return self.layout.poses.find(self.path)

    @cached_property
    def trajectory(self) -> Path | None:
        """The file of all poses; None if there is none, or if each has a file of its own."""
        if self.poses:
            return None
        places = (self.path / name for name in self.layout.trajectories)
        return next((place for place in places if place.is_file()), None)

    def streams(self) -> Iterator[Stream]:
        """Yield the files of each kind, named such as `depth/*.png`."""
        for files, kind, use in (
            (self.depth, "depth images", "geometry"),
            (self.color, "color images", "detection of objects"),
            (self.poses, "camera poses", POSES_USE),
        ):
            names = (path.relative_to(self.path).as_posix() for path in files.values())
            for name, count in sorted(Counter(_NUMBER.sub(r"*\1", name) for name in names).items()):
                yield Stream(name, kind, count, use)


_SEVEN_SCENES = Layout(
    "7-Scenes",
    Files(("",), re.compile(r"frame-(\d+)\.depth\.(?:png|pgm)"), "frame-*.depth.png or .pgm"),
    Files(("",), re.compile(r"frame-(\d+)\.color\.(?:jpg|png)"), "frame-*.color.jpg or .color.png"),
    Files(("",), re.compile(r"frame-(\d+)\.pose\.txt"), "frame-*.pose.txt"),
    intrinsics="expected camera-intrinsics.txt, _info.txt or info.txt; or give --intrinsics (the "
    "page of 7-Scenes says 585,585,320,240)",
)
_NO_FILES = Files((), re.compile(r"(\d+)"), "")
_REPLICA = Layout(
    "Replica",
    Files(("results",), re.compile(r"depth(\d+)\.png"), "results/depth*.png"),
    Files(("results",), re.compile(r"frame(\d+)\.(?:jpg|png)"), "results/frame*.jpg or .png"),
    _NO_FILES,
    ("traj.txt",),
    depth_scale=6553.5,
    intrinsics="expected cam_params.json; or give --intrinsics (those of NICE-SLAM's renderings "
    "are 600,600,599.5,339.5)",
)
_FOLDERS = Layout(
    "numbered images",
    Files(("depth",), re.compile(r"(?i)(\d+)\.png"), "depth/*.png"),
    Files(
        ("color", "rgb", "image", "images"),
        re.compile(r"(?i)(\d+)\.(?:jpe?g|png)"),
        "color/*.jpg or .png (or in rgb, image or images)",
    ),
    Files(("pose", "poses"), re.compile(r"(\d+)\.txt"), "pose/*.txt"),
    ("traj.txt", "trajectory.log", "scene/trajectory.log"),
)


def layout_of(path: Path) -> Layout | None:
    """Return the layout of a folder; None if it has none that is known."""
    if any(
        any(_numbered(path, files.name)) for files in (_SEVEN_SCENES.depth, _SEVEN_SCENES.poses)
    ):
        return _SEVEN_SCENES
    for layout in (_REPLICA, _FOLDERS):
        if layout.depth.find(path):
            return layout
    return None


def _numbered(folder: Path, name: re.Pattern[str]) -> Iterator[tuple[int, Path]]:
    for path in folder.iterdir():
        if match := name.fullmatch(path.name):
            yield int(match[1]), path
