from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hypermap.recordings import RecordingOptions, open_recording
from hypermap.recordings.bag.file import Topic
from hypermap.recordings.bag.topics import (
    CAMERA_INFO,
    CLOUD,
    COMPRESSED,
    DETECTIONS,
    IMAGE,
    OCCUPANCY,
    TRANSFORMS,
    choose_topics,
    may_hold_depth,
)

from .bag_builder import BagBuilder, add_poses, camera_info, compressed, image, picture
from .shots import SHOTS

OPENNI = {
    "/camera/depth/camera_info": CAMERA_INFO,
    "/camera/depth/image_raw": IMAGE,
    "/camera/depth_registered/image_raw": IMAGE,
    "/camera/depth_registered/points": CLOUD,
    "/camera/rgb/camera_info": CAMERA_INFO,
    "/camera/rgb/image_color": IMAGE,
    "/camera/rgb/image_raw": IMAGE,
    "/darknet_ros/detection_image": IMAGE,
    "/darknet_ros/bounding_boxes": DETECTIONS[0],
    "/map": OCCUPANCY,
    "/move_base/local_costmap/costmap": OCCUPANCY,
    "/tf": TRANSFORMS[1],
}
REALSENSE = {
    "/camera/aligned_depth_to_color/camera_info": CAMERA_INFO,
    "/camera/aligned_depth_to_color/image_raw/compressedDepth": COMPRESSED,
    "/camera/color/camera_info": CAMERA_INFO,
    "/camera/color/image_raw/compressed": COMPRESSED,
    "/camera/depth/camera_info": CAMERA_INFO,
    "/camera/depth/image_rect_raw": IMAGE,
    "/camera/infra1/image_rect_raw": IMAGE,
    "/tf": TRANSFORMS[0],
    "/tf_static": TRANSFORMS[0],
}
TWO_CAMERAS = {
    f"/{side}/{kind}": type_name
    for side in ("front", "rear")
    for kind, type_name in {
        "depth/image": IMAGE,
        "depth/camera_info": CAMERA_INFO,
        "rgb/image": IMAGE,
        "rgb/image/compressed": COMPRESSED,
        "detections": DETECTIONS[1],
    }.items()
}
AZURE_KINECT = {
    f"/k4a/{name}/{kind}": type_name
    for name in ("depth", "depth_to_rgb", "ir", "rgb", "rgb_to_depth")
    for kind, type_name in {"image_raw": IMAGE, "camera_info": CAMERA_INFO}.items()
}
CLOUD_ONLY = {"/camera/points": CLOUD, "/camera/rgb/image": IMAGE, "/velodyne_points": CLOUD}
DEPTH_WITHOUT_INFO = {"/camera/depth/image": IMAGE, "/camera/points": CLOUD}


@pytest.mark.parametrize(
    ("topics", "options", "expected"),
    [
        (
            OPENNI,
            {},
            {
                "depth": "/camera/depth_registered/image_raw",
                "cloud": None,
                "color": "/camera/rgb/image_color",
                "camera_info": "/camera/rgb/camera_info",
                "detections": "/darknet_ros/bounding_boxes",
                "occupancy": "/map",
            },
        ),
        (
            REALSENSE,
            {},
            {
                "depth": "/camera/aligned_depth_to_color/image_raw/compressedDepth",
                "color": "/camera/color/image_raw/compressed",
                "camera_info": "/camera/aligned_depth_to_color/camera_info",
                "detections": None,
                "occupancy": None,
            },
        ),
        (
            TWO_CAMERAS,
            {},
            {
                "depth": "/front/depth/image",
                "color": "/front/rgb/image",
                "camera_info": "/front/depth/camera_info",
                "detections": "/front/detections",
            },
        ),
        (
            TWO_CAMERAS,
            {"depth_topic": "/rear/depth/image"},
            {
                "depth": "/rear/depth/image",
                "color": "/rear/rgb/image",
                "camera_info": "/rear/depth/camera_info",
                "detections": "/rear/detections",
            },
        ),
        (
            {**TWO_CAMERAS, "/rear/points": CLOUD},
            {"cloud_topic": "/rear/points"},
            {
                "depth": None,
                "color": "/rear/rgb/image",
                "camera_info": "/rear/depth/camera_info",
                "detections": "/rear/detections",
            },
        ),
        (
            AZURE_KINECT,
            {},
            {
                "depth": "/k4a/depth_to_rgb/image_raw",
                "color": "/k4a/rgb/image_raw",
                "camera_info": "/k4a/depth_to_rgb/camera_info",
            },
        ),
        (
            AZURE_KINECT,
            {"depth_topic": "/k4a/depth/image_raw"},
            {
                "depth": "/k4a/depth/image_raw",
                "color": "/k4a/rgb_to_depth/image_raw",
                "camera_info": "/k4a/depth/camera_info",
            },
        ),
        (CLOUD_ONLY, {}, {"depth": None, "cloud": "/camera/points", "color": "/camera/rgb/image"}),
        (OPENNI, {"cloud_topic": "/camera/depth_registered/points"}, {"depth": None}),
        (DEPTH_WITHOUT_INFO, {}, {"depth": None, "cloud": "/camera/points"}),
        (
            DEPTH_WITHOUT_INFO,
            {"intrinsics": (500, 500, 320, 240)},
            {"depth": "/camera/depth/image", "cloud": None},
        ),
        ({}, {}, {"depth": None, "cloud": None, "color": None, "occupancy": None}),
    ],
)
def test_the_topics_that_fit_are_found(
    topics: dict[str, str], options: dict[str, Any], expected: dict[str, str | None]
) -> None:
    listed = [Topic(name, type_name, 10) for name, type_name in topics.items()]
    chosen = choose_topics(listed, RecordingOptions(**options))
    found = {role: getattr(chosen, role) for role in expected}
    assert {role: topic and topic.name for role, topic in found.items()} == expected


def test_topics_without_messages_do_not_count() -> None:
    topics = [Topic("/depth/a", IMAGE, 0), Topic("/depth/b", IMAGE, 3)]
    chosen = choose_topics(topics, RecordingOptions())
    assert chosen.depth == topics[1]
    assert chosen.notes == ()


def test_a_choice_among_several_is_noted() -> None:
    topics = [Topic(f"/camera_{i}/rgb", IMAGE, 3) for i in range(6)]
    assert choose_topics(topics, RecordingOptions()).notes == (
        "/camera_0/rgb is used; also there: /camera_1/rgb, /camera_2/rgb, /camera_3/rgb and 2 "
        "more (--color-topic)",
    )


@pytest.mark.parametrize("kind", ["ros1", "mcap"])
def test_depth_that_no_name_tells_is_found_by_its_encoding(tmp_path: Path, kind: str) -> None:
    with BagBuilder(tmp_path, kind) as bag:
        add_poses(bag, SHOTS)
        for shot in SHOTS:
            bag.add("/oak/rgb/image_raw", IMAGE, shot.stamp, image(shot.color, "rgb8", shot.stamp))
            depth = image(shot.depth_mm, "16UC1", shot.stamp)
            bag.add("/oak/stereo/image_raw", IMAGE, shot.stamp, depth)
            bag.add("/oak/stereo/camera_info", CAMERA_INFO, shot.stamp, camera_info(shot.stamp))
    recording = open_recording(bag.path)
    for frame, shot in zip(recording.frames(), SHOTS, strict=True):
        assert frame.color is not None
        np.testing.assert_array_equal(frame.color, shot.color)
        np.testing.assert_array_equal(np.nan_to_num(1000 * frame.depth).round(), shot.depth_mm)
    assert recording.info().notes[0] == (
        "/oak/stereo/image_raw is taken as depth, because of its encoding 16UC1"
    )


@pytest.mark.parametrize("kind", ["ros1", "mcap"])
def test_depth_in_png_is_found_where_no_other_depth_is(tmp_path: Path, kind: str) -> None:
    with BagBuilder(tmp_path, kind) as bag:
        add_poses(bag, SHOTS)
        for shot in SHOTS:
            color = image(shot.color, "rgb8", shot.stamp)
            bag.add("/kinect2/qhd/image_color_rect", IMAGE, shot.stamp, color)
            depth = compressed(picture(shot.depth_mm), "16UC1; png compressed ", shot.stamp)
            bag.add("/kinect2/qhd/image_depth_rect/compressed", COMPRESSED, shot.stamp, depth)
            bag.add("/kinect2/qhd/camera_info", CAMERA_INFO, shot.stamp, camera_info(shot.stamp))
    recording = open_recording(bag.path)
    for frame, shot in zip(recording.frames(), SHOTS, strict=True):
        np.testing.assert_array_equal(np.nan_to_num(1000 * frame.depth).round(), shot.depth_mm)
    assert recording.info().notes[0] == (
        "/kinect2/qhd/image_depth_rect/compressed is taken as depth, because of its encoding "
        "16UC1; png compressed"
    )


def test_thermal_images_which_have_16_bits_too_are_not_taken_as_depth() -> None:
    assert may_hold_depth(Topic("/oak/stereo/image_raw", IMAGE, 1))
    assert not may_hold_depth(Topic("/Thermal/image_raw", IMAGE, 1))


TWO_ROBOTS = {
    f"/robot{number}/{name}": type_name
    for number in (1, 2)
    for name, type_name in {
        "camera/depth": IMAGE,
        "map": OCCUPANCY,
        "tf": TRANSFORMS[0],
        "tf_static": TRANSFORMS[0],
    }.items()
}


@pytest.mark.parametrize(
    ("depth", "others", "expected"),
    [
        ("/robot2/camera/depth", (), ["/robot2/tf", "/robot2/tf_static"]),
        ("/robot1/camera/depth", ("/tf",), ["/robot1/tf", "/robot1/tf_static", "/tf"]),
        (
            "/camera/depth",
            ("/tf",),
            ["/robot1/tf", "/robot1/tf_static", "/robot2/tf", "/robot2/tf_static", "/tf"],
        ),
    ],
)
def test_tf_is_that_of_the_robot_with_the_camera(
    depth: str, others: tuple[str, ...], expected: list[str]
) -> None:
    names = {**TWO_ROBOTS, "/camera/depth": IMAGE, **dict.fromkeys(others, TRANSFORMS[0])}
    topics = [Topic(name, kind, 1) for name, kind in names.items()]
    chosen = choose_topics(topics, RecordingOptions(depth_topic=depth))
    assert [topic.name for topic in chosen.transforms] == expected
    said = [note for note in chosen.notes if note.startswith("poses are from")]
    assert len(said) == (depth != "/camera/depth")
    own = "/robot2/map" if depth.startswith("/robot2") else "/robot1/map"
    assert chosen.occupancy is not None
    assert chosen.occupancy.name == own


@pytest.mark.parametrize(
    ("name", "kind", "use"),
    [
        ("map", OCCUPANCY, "occupancy"),
        ("camera/color/image_raw", IMAGE, "color"),
        ("camera/camera_info", CAMERA_INFO, "camera_info"),
        ("darknet_ros/bounding_boxes", DETECTIONS[0], "detections"),
    ],
)
def test_what_another_robot_alone_has_is_not_used(name: str, kind: str, use: str) -> None:
    without_map = {name: kind for name, kind in TWO_ROBOTS.items() if kind != OCCUPANCY}
    names = {**without_map, f"/robot1/{name}": kind}
    topics = [Topic(name, kind, 1) for name, kind in names.items()]
    other = choose_topics(topics, RecordingOptions(depth_topic="/robot2/camera/depth"))
    assert getattr(other, use) is None
    assert f"/robot1/{name} is not used, as of another robot or camera" in "; ".join(other.notes)
    own = choose_topics(topics, RecordingOptions(depth_topic="/robot1/camera/depth"))
    assert getattr(own, use) is not None


@pytest.mark.parametrize("parent", ["", "/robot1"])
def test_detections_of_another_camera_are_not_used(parent: str) -> None:
    names = {f"{parent}{name}": kind for name, kind in TWO_CAMERAS.items()}
    topics = [Topic(name, kind, 1) for name, kind in names.items() if "rear/detec" not in name]
    rear = choose_topics(topics, RecordingOptions(depth_topic=f"{parent}/rear/depth/image"))
    assert rear.detections is None
    assert f"{parent}/front/detections is not used" in "; ".join(rear.notes)
    front = choose_topics(topics, RecordingOptions(depth_topic=f"{parent}/front/depth/image"))
    assert front.detections is not None
    named = RecordingOptions(
        depth_topic=f"{parent}/rear/depth/image", detections_topic=f"{parent}/front/detections"
    )
    assert choose_topics(topics, named).detections is not None


def test_all_topics_of_tf_are_read() -> None:
    topics = [Topic(name, kind, 1) for name, kind in REALSENSE.items()]
    chosen = choose_topics(topics, RecordingOptions())
    assert [topic.name for topic in chosen.transforms] == ["/tf", "/tf_static"]
    assert chosen.use_of(chosen.transforms[1]) == "where the camera was"
    assert chosen.use_of(topics[6]) == ""
