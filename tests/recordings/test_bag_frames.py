"""What is in the frames of a bag."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from hypermap.core.errors import FormatError
from hypermap.recordings import RecordingOptions, open_recording

from .bag_builder import (
    CAMERA_INFO,
    CLOUD,
    COLOR,
    COMPRESSED,
    DEPTH,
    IMAGE,
    BagBuilder,
    add_poses,
    camera_info,
    compressed,
    compressed_depth,
    header,
    image,
    picture,
    write_bag,
)
from .bag_tools import frames_of
from .shots import HEIGHT, INTRINSICS, SHOTS, START, WIDTH, Shot, assert_shows, write_tum


def to_nanoseconds(stamp: float | None) -> int:
    """The desk's stamps count whole microseconds."""
    return round((stamp or 0) * 10**6) * 1000


def test_a_bag_gives_back_the_frames_of_the_image_folder_it_was_made_from(
    tmp_path: Path, kind: str
) -> None:
    folder = write_tum(tmp_path / "folder", SHOTS)
    from_folder = frames_of(folder, depth_scale=1000, intrinsics=INTRINSICS)
    from_bag = frames_of(write_bag(tmp_path, kind, SHOTS))
    assert len(from_folder) == len(from_bag) == len(SHOTS)
    for ours, theirs, shot in zip(from_bag, from_folder, SHOTS, strict=True):
        assert_shows(ours, shot)
        np.testing.assert_array_equal(ours.depth, theirs.depth)
        np.testing.assert_array_equal(ours.color, theirs.color)
        np.testing.assert_allclose(ours.map_T_camera, theirs.map_T_camera, atol=1e-6)
        np.testing.assert_array_equal(ours.camera.K, theirs.camera.K)
        assert (ours.stamp, ours.color_stamp) == (theirs.stamp, theirs.color_stamp)
        assert ours.detections is None


def test_frames_of_the_desk_come_back_from_a_bag(
    tmp_path: Path, kind: str, shared_data: Path
) -> None:
    expected = frames_of(shared_data / "desk", every=40)
    with BagBuilder(tmp_path, kind) as bag:
        for frame in expected:
            stamp, color_stamp = to_nanoseconds(frame.stamp), to_nanoseconds(frame.color_stamp)
            bag.add("/depth/image", IMAGE, stamp, image(frame.depth, "32FC1", stamp))
            info = camera_info(stamp, 640, 480) | {"K": frame.camera.K.ravel()}
            bag.add("/depth/camera_info", CAMERA_INFO, stamp, info)
            bag.add("/rgb/image", IMAGE, color_stamp, image(frame.color, "rgb8", color_stamp))
        for line in (shared_data / "desk/groundtruth.txt").read_text().splitlines()[3:]:
            numbers = [float(word) for word in line.split()]
            stamp = to_nanoseconds(numbers[0])
            bag.add_tf("/tf", stamp, "/world", "/camera", numbers[1:4], numbers[4:])
    found = frames_of(bag.path, map_frame="world")
    assert len(found) == len(expected) == 3
    for ours, theirs in zip(found, expected, strict=True):
        np.testing.assert_array_equal(ours.depth, theirs.depth)
        np.testing.assert_array_equal(ours.color, theirs.color)
        np.testing.assert_allclose(ours.map_T_camera, theirs.map_T_camera, atol=1e-6)


def as_metres(shot: Shot) -> Any:
    meters = np.where(shot.depth_mm == 0, np.nan, shot.depth_mm / 1000).astype(np.float32)
    return IMAGE, image(meters, "32FC1", shot.stamp)


DEPTHS: dict[str, Callable[[Shot], Any]] = {
    "16UC1": lambda s: (IMAGE, image(s.depth_mm, "16UC1", s.stamp)),
    "16UC1 with padded rows": lambda s: (IMAGE, image(s.depth_mm, "16UC1", s.stamp, padding=6)),
    "16UC1 big-endian": lambda s: (IMAGE, image(s.depth_mm.astype(">u2"), "16UC1", s.stamp)),
    "32FC1": as_metres,
    "compressedDepth": lambda s: (COMPRESSED, compressed_depth(s.depth_mm, s.stamp)),
}

COLORS: dict[str, Callable[[Shot], Any]] = {
    "bgr8": lambda s: (IMAGE, image(s.color[..., ::-1], "bgr8", s.color_stamp)),
    "png": lambda s: (COMPRESSED, compressed(picture(s.color), "rgb8; png", s.color_stamp)),
}


@pytest.mark.parametrize(
    ("depth", "color"),
    [*((depth, "png") for depth in DEPTHS), ("16UC1", "bgr8")],
)
def test_every_encoding_gives_the_same_frame(bag: BagBuilder, depth: str, color: str) -> None:
    shots = SHOTS[:2]
    depth_topic = "/camera/depth/image" + ("/compressedDepth" if depth == "compressedDepth" else "")
    with bag:
        add_poses(bag, shots)
        for shot in shots:
            bag.add(depth_topic, DEPTHS[depth](shot)[0], shot.stamp, DEPTHS[depth](shot)[1])
            bag.add("/camera/depth/camera_info", CAMERA_INFO, shot.stamp, camera_info(shot.stamp))
            bag.add("/camera/rgb/image", COLORS[color](shot)[0], shot.stamp, COLORS[color](shot)[1])
    frames = frames_of(bag.path)
    assert len(frames) == 2
    for frame, shot in zip(frames, shots, strict=True):
        assert_shows(frame, shot)


def cloud_message(shot: Shot, with_color: bool) -> dict[str, Any]:
    fx, fy, cx, cy = INTRINSICS
    z = np.where(shot.depth_mm == 0, np.nan, shot.depth_mm / 1000).astype(np.float32)
    v, u = np.mgrid[:HEIGHT, :WIDTH]
    record = np.zeros((HEIGHT, WIDTH), [("rgb", "<u4"), ("z", "<f4"), ("y", "<f4"), ("x", "<f8")])
    record["x"], record["y"], record["z"] = (u - cx) / fx * z, (v - cy) / fy * z, z
    r, g, b = np.moveaxis(shot.color.astype(np.uint32), -1, 0)
    record["rgb"] = r << 16 | g << 8 | b
    kinds = {"rgb": 7, "z": 7, "y": 7, "x": 8}
    return {
        "header": header(shot.stamp),
        "height": HEIGHT,
        "width": WIDTH,
        "fields": [
            {"name": name, "offset": record.dtype.fields[name][1], "datatype": kind, "count": 1}
            for name, kind in kinds.items()
            if with_color or name != "rgb"
        ],
        "point_step": record.dtype.itemsize,
        "row_step": record.dtype.itemsize * WIDTH,
        "data": np.frombuffer(record.tobytes(), np.uint8),
    }


@pytest.mark.parametrize("with_color", [True, False])
def test_organised_clouds_give_frames_and_intrinsics(bag: BagBuilder, with_color: bool) -> None:
    with bag:
        add_poses(bag, SHOTS)
        for shot in SHOTS:
            bag.add("/camera/points", CLOUD, shot.stamp, cloud_message(shot, with_color))
            if not with_color:
                color = image(shot.color, "rgb8", shot.color_stamp)
                bag.add(COLOR, IMAGE, shot.color_stamp, color)
    for frame, shot in zip(frames_of(bag.path), SHOTS, strict=True):
        assert_shows(frame, shot)
        K = frame.camera.K
        assert (K[0, 0], K[1, 1], K[0, 2], K[1, 2]) == pytest.approx(INTRINSICS, abs=1e-3)
        assert frame.cloud is not None
        np.testing.assert_allclose(frame.cloud[5, 7, 0], (7 - 15.5) / 26 * 1.5, rtol=1e-5)
        assert frame.color_stamp == (shot.stamp if with_color else shot.color_stamp) / 10**9


def test_jpeg_color_is_what_pillow_decodes(tmp_path: Path) -> None:
    content = picture(SHOTS[0].color, "jpeg")
    (tmp_path / "picture.jpg").write_bytes(content)
    with BagBuilder(tmp_path, "ros1") as bag:
        add_poses(bag, SHOTS)
        bag.add(DEPTH, IMAGE, START, image(SHOTS[0].depth_mm, "16UC1", START))
        bag.add("/rgb/compressed", COMPRESSED, START, compressed(content, "jpeg", START))
    [frame] = frames_of(bag.path, intrinsics=INTRINSICS)
    with Image.open(tmp_path / "picture.jpg") as expected:
        np.testing.assert_array_equal(frame.color, np.asarray(expected.convert("RGB")))


@pytest.mark.parametrize("transport", ["", "/compressedDepth"])
def test_rectified_images_take_the_rectified_intrinsics(tmp_path: Path, transport: str) -> None:
    info = camera_info(START, distortion=[0.1, 0, 0, 0, 0])
    info["P"] = [30, 0, 16, 0, 0, 31, 12, 0, 0, 0, 1, 0]
    type_, depth = DEPTHS["compressedDepth" if transport else "16UC1"](SHOTS[0])
    with BagBuilder(tmp_path, "mcap") as bag:
        add_poses(bag, SHOTS)
        bag.add("/depth/camera_info", CAMERA_INFO, START, info)
        bag.add("/depth/image_rect" + transport, type_, START, depth)
    [frame] = frames_of(bag.path)
    assert frame.camera.K.tolist() == [[30, 0, 16], [0, 31, 12], [0, 0, 1]]
    np.testing.assert_array_equal(np.isnan(frame.depth), SHOTS[0].depth_mm == 0)  # as it is


@pytest.mark.parametrize(
    ("depth_topic", "color_topic", "is_depth_bent", "is_color_bent"),
    [
        ("/depth/image_raw", "/rgb/image_color", True, True),
        ("/depth/image_rect_raw", "/rgb/image_color", False, True),
        ("/depth/image_raw", "/rgb/image_rect_color", True, False),
        ("/depth/image_raw", "/rgb/image_rect_color/compressed", True, False),
    ],
)
def test_each_image_is_rectified_unless_its_own_name_says_that_it_is(
    tmp_path: Path, depth_topic: str, color_topic: str, is_depth_bent: bool, is_color_bent: bool
) -> None:
    info = camera_info(START, distortion=[0.1, 0, 0, 0, 0])
    fx, fy, cx, cy = INTRINSICS
    info["P"] = [fx, 0, cx, 0, 0, fy, cy, 0, 0, 0, 1, 0]
    type_, color = COLORS["png" if color_topic.endswith("/compressed") else "bgr8"](SHOTS[0])
    with BagBuilder(tmp_path, "mcap") as bag:
        add_poses(bag, SHOTS)
        bag.add("/depth/camera_info", CAMERA_INFO, START, info)
        bag.add(depth_topic, IMAGE, START, image(SHOTS[0].depth_mm, "16UC1", START))
        bag.add(color_topic, type_, START, color)
    [frame] = frames_of(bag.path)
    corner = HEIGHT - 1, WIDTH - 1  # beyond which the lens moves it
    assert np.isnan(frame.depth[corner]) == is_depth_bent
    assert np.array_equal(frame.color[corner], (0, 0, 0)) == is_color_bent
    assert np.array_equal(frame.color, SHOTS[0].color) != is_color_bent


def test_a_damaged_image_is_named_by_topic_and_time(tmp_path: Path) -> None:
    with BagBuilder(tmp_path, "mcap") as bag:
        add_poses(bag, SHOTS)
        for i, shot in enumerate(SHOTS):
            content = picture(shot.color)[: 500 if i == 2 else None]
            depth = image(shot.depth_mm, "16UC1", shot.stamp)
            bag.add("/depth/image", IMAGE, shot.stamp, depth)
            bag.add(
                "/rgb/compressed", COMPRESSED, shot.stamp, compressed(content, "png", shot.stamp)
            )
    _, _, third, *_ = frames_of(bag.path, intrinsics=INTRINSICS)
    with pytest.raises(FormatError) as caught:
        _ = third.color
    where = f"{bag.path}: /depth/image and /rgb/compressed at 1600000000.450 s: "
    assert str(caught.value).startswith(where + "the picture is damaged: ")


@pytest.mark.parametrize("bad", [0, 2])
def test_depth_that_is_damaged_or_of_another_size_costs_its_frame_alone(
    tmp_path: Path, bad: int
) -> None:
    with BagBuilder(tmp_path, "mcap") as bag:
        add_poses(bag, SHOTS)
        for i, shot in enumerate(SHOTS):
            pixels = shot.depth_mm[:12] if i == bad else shot.depth_mm
            bag.add("/depth/image", IMAGE, shot.stamp, image(pixels, "16UC1", shot.stamp))
    recording = open_recording(bag.path, RecordingOptions(intrinsics=INTRINSICS))
    reported: list[tuple[float, str]] = []
    frames = list(recording.frames(lambda stamp, error: reported.append((stamp, str(error)))))
    good = [shot.stamp / 1e9 for i, shot in enumerate(SHOTS) if i != bad]
    assert [frame.stamp for frame in frames] == pytest.approx(good)
    [(stamp, message)] = reported
    assert stamp == pytest.approx(SHOTS[bad].stamp / 1e9)
    assert "the depth image has 32 x 12 pixels" in message
    with pytest.raises(FormatError):
        list(recording.frames())
