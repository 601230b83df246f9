"""Points and colors from organized `sensor_msgs/PointCloud2`."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hypermap.core.errors import FormatError
from hypermap.perception.frame import Camera
from hypermap.recordings.messages.header import octets

_KINDS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}  # PointField
_MAX_FIT_ERROR = 1.0  # pixels


def points_of_cloud(
    message: Any,
) -> tuple[NDArray[np.float32], NDArray[np.uint8] | None]:
    """Return the points of an organized cloud, and their colors if it has any.

    Returns:
        Points in the cloud's frame [m], float32, NaN for no return, shape (H, W, 3), and RGB,
        uint8, of the same shape, from a packed field `rgb` or `rgba`.

    Raises:
        FormatError: If the cloud is not organized, has no x, y, z, or its data is too short.
    """
    pixels = _records(message)
    points = np.stack([pixels[name].astype(np.float32) for name in "xyz"], axis=-1)
    points[~(np.isfinite(points).all(axis=-1) & (points[..., 2] > 0))] = np.nan
    packed = next((name for name in ("rgb", "rgba") if name in (pixels.dtype.names or ())), None)
    if packed is None:
        return points, None
    rgb = pixels[packed].astype(np.uint32)
    return points, np.stack([rgb >> 16, rgb >> 8, rgb], axis=-1).astype(np.uint8)


def fit_camera(points: NDArray[np.float32]) -> Camera:
    """Return the pinhole camera that saw an organized cloud, shape (H, W, 3).

    Each point gives u = fx x/z + cx and v = fy y/z + cy; the four numbers are the least-squares
    solution.

    Raises:
        FormatError: If the points do not come from a pinhole camera that looks along z.
    """
    height, width = points.shape[:2]
    v, u = np.nonzero(np.isfinite(points[..., 2]))
    seen = points[v, u].astype(np.float64)
    intrinsics, worst = [], 0.0
    for pixel, along in ((u, seen[:, 0] / seen[:, 2]), (v, seen[:, 1] / seen[:, 2])):
        if len(along) < 2 or np.ptp(along) < 1e-6:
            raise FormatError("the cloud has too few points to find the camera's intrinsics")
        focal, center = np.polyfit(along, pixel, 1)
        worst = max(worst, float(np.abs(focal * along + center - pixel).max()))
        intrinsics.append((focal, center))
    (fx, cx), (fy, cy) = intrinsics
    if worst > _MAX_FIT_ERROR or fx <= 0 or fy <= 0:
        raise FormatError(
            "the cloud does not come from a camera that looks along the z axis of its frame "
            "(x right, y down); give the intrinsics with --intrinsics if it does"
        )
    return Camera.from_intrinsics(fx, fy, cx, cy, width=width, height=height)


def _records(message: Any) -> NDArray[Any]:
    """Return the fields x, y, z and the packed color of each point, shape (H, W)."""
    height, width = message.height, message.width
    if height < 2 or width < 2:
        raise FormatError(
            f"the cloud is not organized: it has {height} x {width} points, and its neighbors "
            "are unknown; record the camera's organized cloud or its depth image"
        )
    names, formats, offsets = _point_fields(message)
    ends = [at + np.dtype(kind).itemsize for at, kind in zip(offsets, formats, strict=True)]
    if (
        max(ends) > message.point_step
        or message.row_step < width * message.point_step
        or len(message.data) < height * message.row_step
    ):
        raise FormatError(
            f"the cloud's {len(message.data)} bytes do not hold {height} rows of "
            f"{message.row_step} bytes with {width} points of {message.point_step} bytes"
        )
    dtype = np.dtype(
        {
            "names": names,
            "formats": formats,
            "offsets": offsets,
            "itemsize": message.point_step,
        }
    )
    return np.ndarray(
        (height, width),
        dtype,
        buffer=np.ascontiguousarray(octets(message.data)),
        strides=(message.row_step, message.point_step),
    )


def _point_fields(message: Any) -> tuple[list[str], list[str], list[int]]:
    """Return name, numpy type and offset of each of x, y, z and color in the bytes of a point."""
    names, formats, offsets = list[str](), list[str](), list[int]()
    order = ">" if message.is_bigendian else "<"
    for field in message.fields:
        kind = _KINDS.get(field.datatype, "")
        if field.name in ("x", "y", "z"):
            if not kind.startswith("f"):
                raise FormatError(f"field {field.name!r} of the cloud is not a float")
        elif field.name in ("rgb", "rgba"):
            kind = "u4"  # a float32 `rgb` holds the same four bytes
        else:
            continue
        names.append(field.name)
        formats.append(order + kind)
        offsets.append(field.offset)
    if not {"x", "y", "z"} <= set(names):
        found = ", ".join(field.name for field in message.fields) or "none"
        raise FormatError(f"the cloud needs the fields x, y, z; found {found}")
    return names, formats, offsets
