"""Writes a recording as a folder in the layout of the TUM RGB-D benchmark."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from hypermap.core.errors import FileMissing, FormatError, HypermapError
from hypermap.formats.atomic import why_not_written
from hypermap.formats.grid.png import encode_drawn
from hypermap.perception.detectors.recorded import RecordedDetections
from hypermap.perception.frame import RgbdFrame
from hypermap.perception.recording import Recording

DEPTH_SCALE = 5000.0  # units per meter


def write_tum(
    recording: Recording, folder: str | Path, on_frame: Callable[[], None] = lambda: None
) -> None:
    """Write a recording with color as a folder that `hypermap map` can read.

    The folder holds `rgb/`, `depth/` (16 bits, 5000 to the meter, 0 for no return), `rgb.txt`,
    `depth.txt`, `groundtruth.txt` with the camera's pose at each frame, and `detections.json` if
    the frames have detections. Where a frame has no pose, there is none in the list. The folder
    appears when it is complete, or not at all. The layout has no
    place for intrinsics: readers assume a Kinect's, scaled to the images' width.

    Args:
        recording: its frames need color.
        folder: new, or empty.
        on_frame: called after each frame.

    Raises:
        FormatError: If the folder holds something already, or a frame has no color.
        FileMissing: If the folder's parent does not exist.
        HypermapError: If it cannot be written, as on a full disk.
    """
    folder = Path(folder)
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise FormatError("it already exists; name a new or an empty folder", path=folder)
    if not folder.parent.is_dir():
        raise FileMissing(f"{folder.parent}: there is no such folder")
    partial = folder.with_name(f".{folder.name}.{os.getpid()}")
    try:
        partial.mkdir()
        _write(recording, partial, on_frame)
        partial.replace(folder)
    except HypermapError:
        raise  # FileMissing, which is an OSError too
    except OSError as error:
        raise HypermapError(f"{folder}: cannot be written: {why_not_written(error)}") from error
    finally:
        shutil.rmtree(partial, ignore_errors=True)


def _write(recording: Recording, folder: Path, on_frame: Callable[[], None]) -> None:
    (folder / "rgb").mkdir()
    (folder / "depth").mkdir()
    depth_lines, color_lines, pose_lines = ["# depth images"], ["# color images"], ["# poses"]
    depth_lines.append("# timestamp filename")
    color_lines.append("# timestamp filename")
    pose_lines.append("# timestamp tx ty tz qx qy qz qw")
    detections = None
    for frame in recording.frames():
        if frame.color is None or frame.color_stamp is None:
            raise FormatError("it has no color", path=recording.path, key=f"{frame.stamp:.6f} s")
        depth_name, color_name = f"{frame.stamp:.6f}", f"{frame.color_stamp:.6f}"
        (folder / f"depth/{depth_name}.png").write_bytes(encode_drawn(depth_units(frame.depth)))
        (folder / f"rgb/{color_name}.png").write_bytes(encode_drawn(frame.color))
        depth_lines.append(f"{depth_name} depth/{depth_name}.png")
        color_lines.append(f"{color_name} rgb/{color_name}.png")
        if np.isfinite(frame.map_T_camera).all():
            pose_lines.append(f"{depth_name} {_pose_text(frame)}")
        if frame.detections is not None:
            if detections is None:
                detections = RecordedDetections((frame.camera.width, frame.camera.height))
            detections.add(float(color_name), frame.detections)
        on_frame()
    for name, lines in (
        ("depth.txt", depth_lines),
        ("rgb.txt", color_lines),
        ("groundtruth.txt", pose_lines),
    ):
        (folder / name).write_text("\n".join(lines) + "\n", encoding="utf-8")
    if detections is not None:
        detections.save(folder / "detections.json")


def depth_units(depth: NDArray[np.float32]) -> NDArray[np.uint16]:
    """Return depth, (H, W), as the benchmark's images hold it; 0 for none or beyond 13.1 m."""
    units = np.round(np.nan_to_num(depth, nan=0.0, posinf=0.0) * DEPTH_SCALE)
    units[units > np.iinfo(np.uint16).max] = 0
    return units.astype(np.uint16)


def _pose_text(frame: RgbdFrame) -> str:
    quat_xyzw = Rotation.from_matrix(frame.map_T_camera[:3, :3]).as_quat()
    return " ".join(f"{number:.9f}" for number in (*frame.map_T_camera[:3, 3], *quat_xyzw))
