"""Finds the intrinsics of a folder of images in the files that data sets keep them in."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hypermap.core.errors import FormatError
from hypermap.perception.frame import Camera
from hypermap.recordings.textfiles import MAX_BYTES, read_matrix

_MATRICES = (  # of depth; those of color are named alike
    "camera-intrinsics.txt",
    "intrinsic/intrinsic_depth.txt",
    "intrinsic_depth.txt",
    "intrinsics_depth.txt",
)
_INFO = ("_info.txt", "info.txt")  # of 3RScan and BundleFusion
_LARGEST_INFO = 2**20  # bytes
_JSON = ("cam_params.json", "camera_primesense.json", "camera_intrinsic.json", "intrinsic.json")


@dataclass(frozen=True, eq=False)
class Intrinsics:
    """What a file says about a camera.

    Attributes:
        path: the file.
        K: pinhole matrix [pixels], shape (3, 3).
        depth_scale: units of depth per meter; None if the file does not say.
        size: columns and rows of its images, likewise.
    """

    path: Path
    K: NDArray[np.float64]
    depth_scale: float | None = None
    size: tuple[float, float] | None = None

    def camera(self, width: int, height: int) -> Camera:
        """Return the camera of images of a size.

        Raises:
            FormatError: If the intrinsics cannot be those of such images.
        """
        try:
            camera = Camera(self.K, width, height)
        except ValueError as error:
            raise FormatError(str(error), path=self.path) from None
        wrong = None
        if not camera.has_center_on_image:
            cx, cy = camera.K[:2, 2]
            wrong = f"the principal point ({cx:g}, {cy:g}) is not on the images of"
        elif self.size is not None and self.size != (width, height):
            wrong = f"the size is {self.size[0]:g} x {self.size[1]:g}, not that of the images,"
        if wrong is not None:
            raise FormatError(
                f"{wrong} {width} x {height} pixels: these intrinsics are for another image size; "
                "give --intrinsics",
                path=self.path,
            )
        return camera


def depth_intrinsics(folder: Path) -> Intrinsics | None:
    """Return the intrinsics of depth, from a file in a folder or one folder up; None without.

    Raises:
        FormatError: If the first file that is found does not contain intrinsics.
    """
    for path in _existing(folder, (*_MATRICES, *_JSON)):
        return _read_json(path) if path.suffix == ".json" else Intrinsics(path, _read_text(path))
    return _read_info(folder, "Depth")


def color_intrinsics(folder: Path) -> Intrinsics | None:
    """Return the intrinsics of color where a file has them apart from depth's, as ScanNet's do.

    Raises:
        FormatError: If the file does not contain intrinsics.
    """
    names = [name.replace("depth", "color") for name in _MATRICES if "depth" in name]
    for path in _existing(folder, names):
        return Intrinsics(path, _read_text(path))
    return _read_info(folder, "Color")


def _existing(folder: Path, names: Sequence[str]) -> Iterator[Path]:
    # Of "." and "..", too, but not of what a link leads to.
    up = Path(os.path.abspath(folder)).parent  # noqa: PTH100
    places = (place / name for place in (folder, up) for name in names)
    return (place for place in places if place.is_file())


def _read_text(path: Path) -> NDArray[np.float64]:
    """Return a matrix of 3 x 3, or the part of one of 4 x 4, in a text file."""
    return read_matrix(path, 3, 4)[:3, :3]


def _read_info(folder: Path, kind: str) -> Intrinsics | None:
    """Return what the file that Voxel Hashing and its successors write says of a camera.

    A file without intrinsics is another one that has this common name.
    """
    key = f"m_calibration{kind}Intrinsic"
    for path in _existing(folder, _INFO):
        if path.stat().st_size > _LARGEST_INFO:
            continue
        lines = path.read_text(encoding="utf-8-sig", errors="replace").splitlines()
        said = {name.strip(): value for name, _, value in (line.partition("=") for line in lines)}
        if key in said:
            return _intrinsics_of(said, kind, path)
    return None


def _intrinsics_of(said: Mapping[str, str], kind: str, path: Path) -> Intrinsics:
    key = f"m_calibration{kind}Intrinsic"
    try:
        K = np.array(said[key].split(), float).reshape(4, 4)[:3, :3]
        scale = float(said["m_depthShift"]) if "m_depthShift" in said else None
        names = [f"m_{kind.lower()}{side}" for side in ("Width", "Height")]
        size = _size_in({name: said.get(name) for name in names}, *names)
        if not np.isfinite(K).all() or (scale is not None and not 0 < scale < math.inf):
            raise ValueError("a number is not one of a camera")
    except ValueError:
        raise FormatError(
            "expected the 16 numbers of a 4 x 4 matrix, and the units of depth per meter as "
            "m_depthShift; give --intrinsics",
            path=path,
            key=key,
        ) from None
    return Intrinsics(path, K, scale, size)


def _read_json(path: Path) -> Intrinsics:
    """Return what a file of NICE-SLAM's Replica or of Open3D says."""
    if path.stat().st_size > MAX_BYTES:
        raise FormatError("too large for a file of intrinsics", path=path)
    try:
        said: Any = json.loads(path.read_text(encoding="utf-8-sig"))
        if "intrinsic_matrix" in said:  # Open3D's, column by column
            K = np.array(said["intrinsic_matrix"], float).reshape(3, 3).T
            return Intrinsics(path, K, size=_size_in(said, "width", "height"))
        camera = said["camera"]
        fx, fy, cx, cy = (float(camera[name]) for name in ("fx", "fy", "cx", "cy"))
        scale = float(camera["scale"]) if "scale" in camera else None
        size = _size_in(camera, "w", "h")
        if scale is not None and not 0 < scale < math.inf:
            raise ValueError("the scale is not positive")
    except (ValueError, TypeError, KeyError, OverflowError, RecursionError):
        raise FormatError(
            "expected the intrinsics fx, fy, cx and cy under camera, or Open3D's intrinsic_matrix; "
            "give --intrinsics",
            path=path,
        ) from None
    return Intrinsics(path, np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]]), scale, size)


def _size_in(said: Any, *names: str) -> tuple[float, float] | None:
    """Return the columns and rows that are said; None if one of them is not."""
    size = [said.get(name) for name in names]
    return None if None in size else (float(size[0]), float(size[1]))
