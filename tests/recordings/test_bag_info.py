"""What is said of a bag: what its topics are used for, what is missing and what was noted."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hypermap.core.errors import FormatError
from hypermap.recordings import RecordingOptions, open_recording

from .bag_builder import (
    CAMERA_INFO,
    COLOR,
    DEPTH,
    IMAGE,
    INFO,
    BagBuilder,
    add_images,
    add_poses,
    camera_info,
    image,
    write_bag,
)
from .bag_tools import without
from .shots import HEIGHT, INTRINSICS, SHOTS, START, WIDTH


def test_info_tells_what_each_topic_is_used_for(tmp_path: Path, kind: str) -> None:
    info = open_recording(write_bag(tmp_path, kind, SHOTS)).info()
    assert info.format == ("ROS 1 bag" if kind == "ros1" else "ROS 2 bag")
    assert info.frames == 4
    assert info.duration == pytest.approx(0.3)
    assert info.image_size == (WIDTH, HEIGHT)
    assert info.missing == ()
    assert info.notes == ()
    assert {(s.name, s.count, s.use) for s in info.streams} == {
        (DEPTH, 4, "geometry"),
        ("/camera/depth_registered/camera_info", 4, "intrinsics"),
        (COLOR, 4, "detection of objects"),
        ("/tf", 4, "where the camera was"),
        ("/tf_static", 2, "where the camera was"),
    }


def with_message(
    topic: str, type_name: str, values: dict[str, Any]
) -> Callable[[BagBuilder], None]:
    """Write a complete bag in which one topic is another."""

    def write(bag: BagBuilder) -> None:
        without(topic)(bag)
        del bag.add
        bag.add(topic, type_name, START, values)

    return write


SMALL = np.zeros((5, 7), np.uint16)
SMALL_COLOR = np.zeros((5, 7, 3), np.uint8)
NO_DEPTH = (
    "there are no depth images (sensor_msgs/Image with 'depth' in the topic's name, or "
    "compressedDepth) and no clouds; name the topic with --depth-topic if it is there, or record it"
)
NO_TF = "there is no tf, so the camera's poses are unknown; record /tf and /tf_static"
NO_INFO = (
    "there is no camera info (sensor_msgs/CameraInfo) for the depth images; record it, or give "
    "--intrinsics"
)


@pytest.mark.parametrize(
    ("write", "options", "missing"),
    [
        (lambda bag: None, {}, [NO_DEPTH, NO_TF]),
        (without(INFO), {}, [NO_INFO]),
        (without("/tf", "/tf_static"), {}, [NO_TF]),
        (without(INFO, "/tf", "/tf_static"), {}, [NO_INFO, NO_TF]),
        (without(DEPTH), {}, [NO_DEPTH]),
        (
            without("/tf_static"),
            {},
            [
                "tf has no frame 'camera', the camera's; it has odom, base; record /tf_static as "
                "well, or name the camera's frame with --camera-frame"
            ],
        ),
        (
            without("/tf_static"),
            {"camera_frame": "base", "map_frame": "world"},
            ["tf has no frame 'world'; it has odom, base (fixed: odom); name one with --map-frame"],
        ),
        (
            lambda bag: [
                bag.add_tf("/tf_static", START, "base", "camera", (0, 0, 1)),
                *(add_images(bag, shot) for shot in SHOTS),
            ],
            {},
            [
                "tf has no frame 'map', and camera frame 'camera' does not move relative to the "
                "root of tf, 'base'; it has base, camera; record /tf as well, or, if the camera "
                "stood still, name its fixed frame with --map-frame"
            ],
        ),
        (
            without("/tf"),
            {},
            [
                "tf has no transform from the camera to the map: frames 'map' and 'camera' are not "
                "connected: the first is below 'map', the second below 'base'; name another "
                "fixed frame with --map-frame"
            ],
        ),
        (
            without(COLOR),
            {},
            [
                "there are neither color images nor recorded detections, and so no objects; "
                "name one with --color-topic or --detections-topic if it is there"
            ],
        ),
        (
            with_message(COLOR, IMAGE, image(SMALL_COLOR, "rgb8", START)),
            {},
            [
                f"color images on {COLOR} have 7 x 5 pixels, but depth images on {DEPTH} have "
                "32 x 24; record depth that is registered to color, give --register, or choose "
                "other topics with --depth-topic and --color-topic"
            ],
        ),
        (
            with_message(INFO, CAMERA_INFO, camera_info(START, 640, 480)),
            {},
            [
                "the camera info is for images of 640 x 480 pixels, but the depth images have "
                "32 x 24; choose another with --camera-info-topic, or give --intrinsics "
                "to `hypermap map`"
            ],
        ),
        (
            with_message(INFO, CAMERA_INFO, {"width": WIDTH, "height": HEIGHT}),
            {},
            [
                "the camera info contains no calibration (focal lengths must be positive, got 0.0, "
                "0.0); calibrate the camera, or give --intrinsics to `hypermap map`"
            ],
        ),
        (
            with_message(DEPTH, IMAGE, image(SMALL, "8UC1", START)),
            {"intrinsics": INTRINSICS},
            ["expected a depth image of encoding 16UC1 or 32FC1, found '8UC1'"],
        ),
        (
            with_message(DEPTH, IMAGE, image(SHOTS[0].depth_mm, "16UC1", START + 10**12)),
            {},
            [
                "no depth image has a color image within 0.02 s (--max-time-difference): depth "
                "images reach from 1600001000.250 to 1600001000.250 s, color images from "
                "1600000000.254 to 1600000000.554 s; the nearest two are 999.696 s apart"
            ],
        ),
        (
            with_message(DEPTH, IMAGE, image(SHOTS[0].depth_mm, "16UC1", START, frame="")),
            {},
            ["the depth messages name no frame; name it with --camera-frame"],
        ),
    ],
)
def test_info_says_what_is_missing_and_what_to_do(
    tmp_path: Path,
    write: Callable[[BagBuilder], None],
    options: dict[str, Any],
    missing: list[str],
) -> None:
    with BagBuilder(tmp_path, "mcap") as bag:
        write(bag)
    recording = open_recording(bag.path, RecordingOptions(**options))
    info = recording.info()
    assert list(info.missing) == missing
    if "no objects" in missing[0]:
        assert len(list(recording.frames())) == 4
    else:
        assert info.frames == 0
        with pytest.raises(FormatError) as caught:
            next(recording.frames())
        assert str(caught.value) == "\n".join([f"{bag.path}: {missing[0]}", *missing[1:]])


def test_distortion_other_frames_and_other_topics_are_noted(tmp_path: Path) -> None:
    with BagBuilder(tmp_path, "ros1") as bag:
        add_poses(bag, SHOTS)
        bag.add(INFO, CAMERA_INFO, START - 1, camera_info(START, distortion=[0.1, 0, 0, 0, 0]))
        for shot in SHOTS:
            depth = image(shot.depth_mm, "16UC1", shot.stamp)
            bag.add(DEPTH, IMAGE, shot.stamp, depth)
            bag.add("/camera/depth/image_raw", IMAGE, shot.stamp, depth)
            color = image(shot.color, "rgb8", shot.color_stamp, frame="color_camera")
            bag.add(COLOR, IMAGE, shot.color_stamp, color)
    recording = open_recording(bag.path)
    assert recording.info().notes == (
        f"{DEPTH} is used; also there: /camera/depth/image_raw (--depth-topic)",
        "color comes from frame 'color_camera', depth from 'camera': if the driver has not "
        "registered them, objects are cut out next to where they are (--register)",
        "the images are rectified: the camera info has lens distortion (plumb_bob)",
    )
    frame = next(recording.frames())
    fx, fy, cx, cy = INTRINSICS
    v, u = np.mgrid[:HEIGHT, :WIDTH]
    x, y = (u - cx) / fx, (v - cy) / fy
    radial = 1 + 0.1 * (x * x + y * y)
    column, row = np.rint(fx * x * radial + cx), np.rint(fy * y * radial + cy)
    is_in = (column >= 0) & (column < WIDTH) & (row >= 0) & (row < HEIGHT)
    raw = np.where(SHOTS[0].depth_mm == 0, np.nan, SHOTS[0].depth_mm / 1000)
    expected = raw[
        np.clip(row, 0, HEIGHT - 1).astype(int), np.clip(column, 0, WIDTH - 1).astype(int)
    ]
    np.testing.assert_allclose(frame.depth, np.where(is_in, expected, np.nan), rtol=1e-6)
    color = np.asarray(frame.color, int)
    np.testing.assert_allclose(color[12, 15], SHOTS[0].color[12, 15], atol=5)  # at the center
    assert (~is_in).sum() > 50
    assert (color[~is_in] == 0).all()


def test_a_lens_that_nobody_knows_is_noted_and_not_corrected(tmp_path: Path) -> None:
    info = camera_info(START, distortion=[0.1, 0, 0, 0, 0]) | {"distortion_model": "wide"}
    with BagBuilder(tmp_path, "ros1") as bag:
        add_poses(bag, SHOTS)
        bag.add(INFO, CAMERA_INFO, START - 1, info)
        for shot in SHOTS:
            bag.add(DEPTH, IMAGE, shot.stamp, image(shot.depth_mm, "16UC1", shot.stamp))
    recording = open_recording(bag.path)
    assert (
        "the lens distortion in the camera info is not corrected: the known models are plumb_bob, "
        "rational_polynomial, equidistant, got 'wide'" in recording.info().notes
    )
    np.testing.assert_array_equal(
        next(recording.frames()).depth,
        np.where(SHOTS[0].depth_mm == 0, np.nan, SHOTS[0].depth_mm.astype(np.float32) / 1000),
    )


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            {"depth_topic": "/camera/depth/imag"},
            "there are no messages on topic '/camera/depth/imag' (--depth-topic); did you mean "
            "'/camera/depth_registered/image_raw'?",
        ),
        (
            {"color_topic": "/tf"},
            "topic /tf (--color-topic) is of the wrong type tf2_msgs/msg/TFMessage",
        ),
    ],
)
def test_a_topic_that_the_options_name_must_be_there(
    tmp_path: Path, options: dict[str, Any], message: str
) -> None:
    path = write_bag(tmp_path, "mcap", SHOTS)
    recording = open_recording(path, RecordingOptions(**options))
    assert recording.info().missing == (f"{path}: {message}",)
    assert len(recording.info().streams) == 5
    with pytest.raises(FormatError):
        len(recording)
