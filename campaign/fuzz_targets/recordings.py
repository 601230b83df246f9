"""Recordings: folders of images, bags, and the messages in them."""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from campaign.fuzz_targets.target import Target, of_tests, target_of_files
from campaign.mutation import mutate_bytes, mutate_text
from hypermap import HypermapError
from hypermap.recordings.messages.camera import camera_of_info
from hypermap.recordings.messages.clouds import fit_camera, points_of_cloud
from hypermap.recordings.messages.compressed_depth import depth_of_compressed
from hypermap.recordings.messages.detections import detections_of
from hypermap.recordings.messages.images import (
    color_of_compressed,
    color_of_image,
    depth_of_image,
)
from hypermap.recordings.messages.occupancy import occupancy_of_grid
from hypermap.recordings.messages.transforms import TransformLog
from hypermap.recordings.open import open_recording
from hypermap.recordings.options import RecordingOptions
from hypermap.recordings.samples import read_table
from hypermap.ros import typestore


def _read(path: Path, _: bytes = b"") -> None:
    recording = open_recording(path, RecordingOptions(intrinsics=(26.0, 27.0, 15.5, 11.25)))
    recording.info()
    with contextlib.suppress(HypermapError):
        recording.occupancy()
    len(recording)
    problems: list[HypermapError] = []
    for frame in itertools.islice(recording.frames(lambda _, e: problems.append(e)), 3):
        with contextlib.suppress(HypermapError):
            frame.color  # noqa: B018 - is decoded when it is asked for


def samples(folder: Path) -> Target:
    """A table of measured values, with places and with a limit."""
    path = folder / "samples.csv"

    def ask(data: bytes) -> None:
        path.write_bytes(data)
        for limit in (None, -95.0):
            read_table(path, censored_below=limit)

    rows = b"x,y,value,stamp\n0.5,1,-60,12.5\n1,2,,13\n3,4,nan,\n"
    return Target(ask, [rows], mutate_text)


def tum(folder: Path) -> Target:
    """A folder as TUM RGB-D has it."""
    return _folder_of_images(folder, "tum")


def seven_scenes(folder: Path) -> Target:
    """A folder as 7-Scenes has it."""
    return _folder_of_images(folder, "seven_scenes")


def scannet(folder: Path) -> Target:
    """A folder as ScanNet's SensReader exports it."""
    return _folder_of_images(folder, "scannet")


def replica(folder: Path) -> Target:
    """A folder as Replica has it."""
    return _folder_of_images(folder, "replica")


def redwood(folder: Path) -> Target:
    """A folder as Open3D's reconstruction system has it."""
    return _folder_of_images(folder, "redwood")


def _folder_of_images(folder: Path, kind: str) -> Target:
    shots = of_tests("recordings.shots")
    made = getattr(shots, f"write_{kind}")(folder / "made", shots.make_shots(3))
    parts = {str(p.relative_to(made)): p.read_bytes() for p in made.rglob("*") if p.is_file()}
    return target_of_files(parts, _read, folder)


def ros1_bag(folder: Path) -> Target:
    """A bag of ROS 1, which is one file."""
    bag, path = _bag(folder, "ros1"), folder / "files.bag"

    def ask(data: bytes) -> None:
        path.write_bytes(data)
        _read(path)

    return Target(ask, [bag.read_bytes()], mutate_bytes)


def ros2_db3(folder: Path) -> Target:
    """A bag of ROS 2 in SQLite."""
    return _folder_of_bag(folder, "db3")


def ros2_mcap(folder: Path) -> Target:
    """A bag of ROS 2 in MCAP."""
    return _folder_of_bag(folder, "mcap")


def _folder_of_bag(folder: Path, kind: str) -> Target:
    parts = {path.name: path.read_bytes() for path in sorted(_bag(folder, kind).iterdir())}
    return target_of_files(parts, _read, folder)


def _bag(folder: Path, kind: str) -> Path:
    """Return a new bag of two frames: a file or a folder."""
    (folder / "made").mkdir()
    shots = of_tests("recordings.shots").make_shots(2)
    bag: Path = of_tests("recordings.bag_builder").write_bag(folder / "made", kind, shots)
    return bag


def sensor_messages(_: Path) -> Target:
    """Images, clouds, intrinsics, grids, transforms and detections, as CDR."""
    builder = of_tests("recordings.bag_builder")
    store, readers = builder.type_store("db3"), _readers_of_messages(builder)
    corpus = [
        bytes([number]) + bytes(store.serialize_cdr(builder.build(store, name, values), name))
        for number, (_, name, values) in enumerate(readers)
    ]

    def ask(data: bytes) -> None:
        if not data:
            return
        read, name, _ = readers[data[0] % len(readers)]
        message = typestore.decode(data[1:], typestore.message_class(name.replace("/msg/", "/")))
        read(message)

    return Target(ask, corpus, mutate_bytes)


def _readers_of_messages(
    builder: Any,
) -> list[tuple[Callable[[Any], object], str, dict[str, Any]]]:
    """Return what reads messages, their types, and an example of each."""
    shot = of_tests("recordings.shots").make_shots(1)[0]
    depth, color = shot.depth_mm[:6, :8], shot.color[:6, :8]
    png = builder.picture(color)
    box = {"bounding_boxes": [{"probability": 0.5, "xmax": 5, "ymax": 6, "class_id": "cup"}]}
    pose = {"header": builder.header(shot.stamp, "map"), "child_frame_id": "camera"}
    pose |= {"transform": {"rotation": {"w": 1.0}}}
    return [
        (lambda m: depth_of_image(m, 1000.0), builder.IMAGE, builder.image(depth, "16UC1", 1)),
        (color_of_image, builder.IMAGE, builder.image(color, "rgb8", 1)),
        (color_of_image, builder.IMAGE, builder.image(color[..., 0], "bayer_rggb8", 1)),
        (color_of_compressed, builder.COMPRESSED, builder.compressed(png, "png", 1)),
        (
            lambda m: depth_of_compressed(m, 1000.0),
            builder.COMPRESSED,
            builder.compressed_depth(depth, 1),
        ),
        (lambda m: fit_camera(points_of_cloud(m)[0]), builder.CLOUD, _cloud(builder, shot.stamp)),
        (lambda m: camera_of_info(m, 32, 24, True), builder.CAMERA_INFO, builder.camera_info(1)),
        (occupancy_of_grid, builder.GRID, builder.grid([0, 100, -1, 0, 0, 5])),
        (detections_of, builder.DARKNET, box),
        (detections_of, builder.VISION, {}),
        (_follow_transforms, builder.TF, {"transforms": [pose]}),
    ]


def _cloud(builder: Any, stamp: float) -> dict[str, Any]:
    """Return the fields of a small organized cloud."""
    xyz = np.ones((4, 4, 4), np.float32)
    fields = [{"name": n, "offset": 4 * i, "datatype": 7, "count": 1} for i, n in enumerate("xyz")]
    cloud = {"height": 4, "width": 4, "fields": fields, "point_step": 16, "row_step": 64}
    return {**cloud, "data": xyz.view(np.uint8).ravel(), "header": builder.header(stamp)}


def _follow_transforms(message: Any) -> None:
    log = TransformLog()
    log.add(message, is_static=False)
    frames, _ = log.frames(max_gap=1.0)
    frames.motion("map", "camera").at([1.0])
