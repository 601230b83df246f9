from __future__ import annotations

import shutil
import sqlite3
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from bag_builder import (
    CAMERA_INFO,
    CLOUD,
    COMPRESSED,
    DARKNET,
    GRID,
    IMAGE,
    KINDS,
    VISION,
    BagBuilder,
    add_images,
    add_poses,
    camera_info,
    compressed,
    compressed_depth,
    header,
    image,
    picture,
    write_bag,
)
from PIL import Image
from shots import HEIGHT, INTRINSICS, START, WIDTH, Shot, assert_shows, make_shots, write_tum

from hypermap.core.errors import FormatError
from hypermap.perception.frame import RgbdFrame
from hypermap.recordings import RecordingOptions, open_recording

SHOTS = make_shots()
DEPTH = "/camera/depth_registered/image_raw"
COLOR = "/camera/rgb/image_color"


def frames_of(path: Path, **options: Any) -> list[RgbdFrame]:
    return list(open_recording(path, RecordingOptions(**options)).frames())


def to_nanoseconds(stamp: float | None) -> int:
    """The desk's stamps count whole microseconds."""
    return round((stamp or 0) * 10**6) * 1000


@pytest.fixture(params=KINDS)
def kind(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def bag(tmp_path: Path, kind: str) -> BagBuilder:
    return BagBuilder(tmp_path, kind)


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
    metres = np.where(shot.depth_mm == 0, np.nan, shot.depth_mm / 1000).astype(np.float32)
    return IMAGE, image(metres, "32FC1", shot.stamp)


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


def test_poses_between_two_transforms_are_interpolated(bag: BagBuilder) -> None:
    shot = SHOTS[0]
    with bag:
        bag.add_tf("/tf", shot.stamp - 10**8, "map", "camera", (0, 0, 1))
        bag.add_tf("/tf", shot.stamp + 3 * 10**8, "map", "camera", (4, 0, 1))
        add_images(bag, shot)
    [frame] = frames_of(bag.path)
    assert frame.map_T_camera[:3, 3] == pytest.approx([1, 0, 1], abs=1e-5)


def test_frames_with_leading_slashes_and_out_of_order_transforms_are_understood(
    tmp_path: Path, kind: str
) -> None:
    with BagBuilder(tmp_path, kind) as bag:
        add_poses(bag, SHOTS[::-1], slash="/")
        for shot in SHOTS:
            add_images(bag, shot)
    for frame, shot in zip(frames_of(bag.path), SHOTS, strict=True):
        assert_shows(frame, shot)


def test_images_that_were_recorded_late_and_out_of_order_find_each_other(bag: BagBuilder) -> None:
    order = [2, 0, 3, 1]
    with bag:
        add_poses(bag, SHOTS)
        for k, i in enumerate(order):
            shot, log_time = SHOTS[i], START + 10**9 * k
            bag.add(COLOR, IMAGE, log_time, image(shot.color, "rgb8", shot.color_stamp))
            bag.add(DEPTH, IMAGE, log_time + 5, image(shot.depth_mm, "16UC1", shot.stamp))
            if k == 0:  # a message that was sent twice
                bag.add(DEPTH, IMAGE, log_time + 6, image(shot.depth_mm, "16UC1", shot.stamp))
    recording = open_recording(bag.path, RecordingOptions(intrinsics=INTRINSICS))
    for frame, shot in zip(recording.frames(), SHOTS, strict=True):
        assert_shows(frame, shot)
    assert "1 images repeat a stamp and are left out" in recording.info().notes


def test_a_message_without_a_stamp_takes_the_time_of_recording(bag: BagBuilder) -> None:
    shot = SHOTS[1]
    with bag:
        add_poses(bag, SHOTS)
        bag.add(DEPTH, IMAGE, shot.stamp, image(shot.depth_mm, "16UC1", 0))
        bag.add(COLOR, IMAGE, shot.color_stamp, image(shot.color, "rgb8", 0))
    [frame] = frames_of(bag.path, intrinsics=INTRINSICS)
    assert_shows(frame, shot)


def darknet(kind: str, shot: Shot) -> Any:
    box = {"probability": 0.75, "xmin": 3, "ymin": 4, "xmax": 9, "ymax": 8}
    box["Class" if kind == "ros1" else "class_id"] = "cup"
    stamps = {"header": header(shot.stamp + 10**8), "image_header": header(shot.color_stamp)}
    return stamps | {"bounding_boxes": [box]}


def vision(kind: str, shot: Shot) -> Any:
    if kind == "ros1":
        results: Any = [{"id": 3, "score": 0.25}, {"id": 41, "score": 0.75}]
        center: Any = {"x": 6.0, "y": 6.0}
    else:
        likely = {"hypothesis": {"class_id": "cup", "score": 0.75}}
        results = [{"hypothesis": {"class_id": "cat", "score": 0.25}}, likely]
        center = {"position": {"x": 6.0, "y": 6.0}}
    found = {"results": results, "bbox": {"center": center, "size_x": 6.0, "size_y": 4.0}}
    nothing = {"bbox": {"center": center, "size_x": 6.0, "size_y": 4.0}}
    return {"header": header(shot.color_stamp), "detections": [nothing, found]}


@pytest.mark.parametrize(("type_name", "make"), [(DARKNET, darknet), (VISION, vision)])
@pytest.mark.parametrize("kind", [*KINDS, "db3 without definitions"])
def test_recorded_detections_go_with_the_image_they_were_made_from(
    tmp_path: Path, kind: str, type_name: str, make: Callable[[str, Shot], Any]
) -> None:
    kind, _, is_without = kind.partition(" without ")
    bag = BagBuilder(tmp_path, kind)
    with bag:
        add_poses(bag, SHOTS)
        for shot in SHOTS:
            add_images(bag, shot)
        late = SHOTS[-1].stamp + 10**9
        bag.add("/boxes", type_name, late, make(bag.kind, SHOTS[2]))
    if is_without:  # as ROS 2 wrote them before Iron
        [file] = bag.path.glob("*.db3")
        with sqlite3.connect(file) as database:
            database.execute("DELETE FROM message_definitions")
    recording = open_recording(bag.path)
    found = [frame.detections for frame in recording.frames()]
    assert [detections is None for detections in found] == [True, True, False, True]
    assert found[2] is not None
    is_number = type_name == VISION and bag.kind == "ros1"
    assert found[2].names.tolist() == ["41" if is_number else "cup"]
    assert found[2].scores.tolist() == [0.75]
    assert found[2].xyxy.tolist() == [[3, 4, 9, 8]]
    notes = recording.info().notes
    assert "1 of 4 frames have recorded detections" in notes
    by_number = "the recorded detections name classes by number, and so will the map"
    assert (by_number in notes) == is_number


def grid(cells: list[int], frame: str = "map", width: int = 3) -> dict[str, Any]:
    half = np.sqrt(0.5)
    return {
        "header": header(START, frame),
        "info": {
            "resolution": 0.5,
            "width": width,
            "height": 2,
            "origin": {
                "position": {"x": 1.0, "y": 2.0},
                "orientation": {"z": half, "w": half},
            },
        },
        "data": cells,
    }


def test_the_last_occupancy_map_becomes_a_layer(bag: BagBuilder) -> None:
    with bag:
        bag.add("/move_base/costmap", GRID, START, grid([100] * 6))
        bag.add("/map", GRID, START, grid([-1] * 6))
        bag.add("/map", GRID, START + 5, grid([0, 100, -1, 0, 50, 0], "/map"))
    layer = open_recording(bag.path).occupancy()
    assert layer is not None
    assert layer.frame_id == "map"
    assert layer.cells is not None
    assert layer.cells.tolist() == [[0, 100, -1], [0, 50, 0]]
    assert layer.grid is not None
    assert layer.grid.origin.yaw == pytest.approx(np.pi / 2)
    assert layer.grid.centers([0], [0])[0] == pytest.approx([0.75, 2.25])


def test_a_map_in_another_frame_is_left_out_and_noted(tmp_path: Path) -> None:
    with BagBuilder(tmp_path, "mcap") as bag:
        bag.add("/map", GRID, START, grid([0] * 6, "floor_2"))
    recording = open_recording(bag.path)
    assert recording.occupancy() is None
    note = "the map on /map is left out: it is not in frame 'map'"
    assert note in recording.info().notes


def test_a_map_with_too_few_cells_is_an_error_that_names_the_topic(tmp_path: Path) -> None:
    with BagBuilder(tmp_path, "mcap") as bag:
        bag.add("/map", GRID, START, grid([0] * 6, width=4))
    with pytest.raises(FormatError) as caught:
        open_recording(bag.path).occupancy()
    assert str(caught.value) == f"{bag.path}: /map: the map of 4 x 2 cells holds 6 numbers"


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


def test_every_nth_frame_and_frames_outside_the_poses_are_counted(tmp_path: Path) -> None:
    with BagBuilder(tmp_path, "mcap") as bag:
        add_poses(bag, SHOTS[:3])
        for shot in SHOTS:
            add_images(bag, shot)
    recording = open_recording(bag.path, RecordingOptions(every=2))
    assert len(recording) == len(list(recording.frames())) == 2
    assert recording.info().notes == (
        "1 of 4 frames lie outside the poses, or in a gap between poses longer than "
        "1 s (--max-pose-gap), and are left out",
    )


def without(*topics: str) -> Callable[[BagBuilder], None]:
    """Write a complete bag but for some topics."""

    def write(bag: BagBuilder) -> None:
        add = bag.add
        bag.add = lambda topic, *rest: None if topic in topics else add(topic, *rest)  # type: ignore[method-assign]
        add_poses(bag, SHOTS)
        for shot in SHOTS:
            add_images(bag, shot)

    return write


def with_message(
    topic: str, type_name: str, values: dict[str, Any]
) -> Callable[[BagBuilder], None]:
    """Write a complete bag in which one topic is another."""

    def write(bag: BagBuilder) -> None:
        without(topic)(bag)
        del bag.add
        bag.add(topic, type_name, START, values)

    return write


INFO = "/camera/depth_registered/camera_info"
SMALL = np.zeros((5, 7), np.uint16)
SMALL_COLOR = np.zeros((5, 7, 3), np.uint8)
NO_DEPTH = (
    "there are no depth images (sensor_msgs/Image with 'depth' in the topic's name, or "
    "compressedDepth) and no clouds; name the topic with --depth-topic if it is there, or record it"
)
NO_TF = "there is no tf, so that nothing tells where the camera was; record /tf and /tf_static"
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
                "tf has no frame 'map', and camera frame 'camera' does not move against the root "
                "of tf, 'base'; it has base, camera; record /tf as well, or, if the camera stood "
                "still, name its fixed frame with --map-frame"
            ],
        ),
        (
            without("/tf"),
            {},
            [
                "tf does not lead from the camera to the map: frames 'map' and 'camera' are not "
                "connected: the first hangs below 'map', the second below 'base'; name another "
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
                "32 x 24; record depth that is registered to color, or choose other topics with "
                "--depth-topic and --color-topic"
            ],
        ),
        (
            with_message(INFO, CAMERA_INFO, camera_info(START, 640, 480)),
            {},
            [
                "the camera info is for images of 640 x 480 pixels, but the depth images have "
                "32 x 24; choose another with --camera-info-topic, or give --intrinsics"
            ],
        ),
        (
            with_message(INFO, CAMERA_INFO, {"width": WIDTH, "height": HEIGHT}),
            {},
            [
                "the camera info holds no calibration (focal lengths must be positive, got 0.0, "
                "0.0); give --intrinsics"
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
                "1600000000.254 to 1600000000.554 s"
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


def test_depth_and_poses_that_do_not_overlap_name_both_times(tmp_path: Path) -> None:
    with BagBuilder(tmp_path, "ros1") as bag:
        bag.add_tf("/tf", 5 * 10**9, "map", "camera", (0, 0, 0))
        bag.add_tf("/tf", 7 * 10**9, "map", "camera", (0, 0, 0))
        add_images(bag, SHOTS[0])
    assert open_recording(bag.path).info().missing == (
        "no frame has a pose: depth images reach from 1600000000.250 to 1600000000.250 s, poses "
        "from 5.000 to 7.000 s; gaps of up to 1 s between poses are bridged (--max-pose-gap)",
    )


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
        "registered them, objects are cut out beside where they are",
        "the lens distortion that the camera info tells is not corrected",
    )
    assert_shows(next(recording.frames()), SHOTS[0])


def test_rectified_images_take_the_rectified_intrinsics(tmp_path: Path) -> None:
    info = camera_info(START, distortion=[0.1, 0, 0, 0, 0])
    info["P"] = [30, 0, 16, 0, 0, 31, 12, 0, 0, 0, 1, 0]
    with BagBuilder(tmp_path, "mcap") as bag:
        add_poses(bag, SHOTS)
        bag.add("/depth/camera_info", CAMERA_INFO, START, info)
        depth = image(SHOTS[0].depth_mm, "16UC1", START)
        bag.add("/depth/image_rect", IMAGE, START, depth)
    [frame] = frames_of(bag.path)
    assert frame.camera.K.tolist() == [[30, 0, 16], [0, 31, 12], [0, 0, 1]]


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
    frames = open_recording(bag.path, RecordingOptions(intrinsics=INTRINSICS)).frames()
    next(frames), next(frames)
    third = next(frames)
    with pytest.raises(FormatError) as caught:
        _ = third.color
    where = f"{bag.path}: /depth/image and /rgb/compressed at 1600000000.450 s: "
    assert str(caught.value).startswith(where + "the picture is damaged: ")


def storage_file(path: Path) -> Path:
    return path if path.is_file() else next(p for p in path.iterdir() if p.suffix != ".yaml")


REPAIR = {"ros1": "rosbag reindex", "db3": "ros2 bag reindex", "mcap": "mcap recover"}


def test_a_bag_that_was_cut_off_is_an_error_with_a_remedy(tmp_path: Path, kind: str) -> None:
    file = storage_file(write_bag(tmp_path, kind, SHOTS))
    content = file.read_bytes()
    cut = tmp_path / ("cut" + file.suffix)
    cut.write_bytes(content[: len(content) * 2 // 3])
    recording = open_recording(cut)
    with pytest.raises(FormatError) as caught:
        list(recording.frames())
    assert str(caught.value).startswith(f"{cut}: the bag cannot be read (")
    assert f"`{REPAIR[kind]}` may repair it" in str(caught.value)
    assert recording.info().missing == (str(caught.value),)


@pytest.mark.parametrize("content", [b"", b"this is not a bag\n" * 100])
def test_a_foreign_file_is_an_error_that_info_tells(
    tmp_path: Path, kind: str, content: bytes
) -> None:
    path = tmp_path / {"ros1": "a.bag", "db3": "a.db3", "mcap": "a.mcap"}[kind]
    path.write_bytes(content)
    [problem] = open_recording(path).info().missing
    assert problem.startswith(f"{path}: the bag cannot be read (")


def test_a_folder_without_metadata_is_read_from_its_only_file(tmp_path: Path) -> None:
    path = write_bag(tmp_path, "mcap", SHOTS)
    (path / "metadata.yaml").unlink()
    for frame, shot in zip(frames_of(path), SHOTS, strict=True):
        assert_shows(frame, shot)


def test_a_single_storage_file_is_read_without_its_folder(tmp_path: Path) -> None:
    for kind in ("db3", "mcap"):
        file = storage_file(write_bag(tmp_path / kind, kind, SHOTS))
        for frame, shot in zip(frames_of(file), SHOTS, strict=True):
            assert_shows(frame, shot)


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


def test_a_bag_is_streamed_with_few_messages_in_memory(tmp_path: Path) -> None:
    with BagBuilder(tmp_path, "mcap") as bag:
        bag.add_tf("/tf", START, "map", "camera", (0, 0, 0))
        bag.add_tf("/tf", START + 10**9, "map", "camera", (0, 0, 0))
        depth, color = np.ones((2, 2), np.uint16), np.ones((2, 2, 3), np.uint8)
        stamps = [START + 10**6 * i for i in range(400)]
        for stamp in stamps:
            bag.add("/rgb/image", IMAGE, START, image(color, "rgb8", stamp))
        for stamp in stamps:
            bag.add("/depth/image", IMAGE, START + 1, image(depth, "16UC1", stamp))
    options = RecordingOptions(intrinsics=INTRINSICS)
    with pytest.raises(FormatError, match="belong together lie more than 300 frames apart"):
        next(open_recording(bag.path, options).frames())
    few = RecordingOptions(intrinsics=INTRINSICS, every=2)  # what is not wanted is not kept
    assert sum(1 for _ in open_recording(bag.path, few).frames()) == 200


def test_the_map_frame_may_have_another_name(tmp_path: Path) -> None:
    path = write_bag(tmp_path, "ros1", SHOTS, root="world")
    for frame, shot in zip(frames_of(path, map_frame="/world"), SHOTS, strict=True):
        assert_shows(frame, shot)


@pytest.mark.parametrize("slash", ["", "/"])
def test_without_a_frame_map_the_root_above_the_camera_is_taken_and_said(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, slash: str
) -> None:
    with BagBuilder(tmp_path, "ros1") as bag:
        add_poses(bag, SHOTS, root="world", slash=slash)
        bag.add_tf("/tf_static", START, "elsewhere", "something", (0, 0, 0))
        bag.add("/map", GRID, START, grid([0] * 6, slash + "world"))
        for shot in SHOTS:
            add_images(bag, shot)
    recording = open_recording(bag.path)
    note = (
        "tf has no frame 'map': the map is made in 'world', the root above the camera, whose z "
        "axis must point up (--map-frame)"
    )
    assert recording.info().notes == (note,)
    assert caplog.messages == []
    for frame, shot in zip(recording.frames(), SHOTS, strict=True):
        assert_shows(frame, shot)
    assert caplog.messages == [f"{bag.path}: {note}"]
    assert recording.frame_id == "world"
    layer = recording.occupancy()
    assert layer is not None
    assert layer.frame_id == "world"


def test_a_camera_that_stood_still_needs_a_frame_by_name(tmp_path: Path) -> None:
    with BagBuilder(tmp_path, "mcap") as bag:
        bag.add_tf("/tf_static", START, "base", "camera", (0, 0, 1))
        for shot in SHOTS:
            add_images(bag, shot)
    [*frames] = frames_of(bag.path, map_frame="base")
    assert [frame.map_T_camera[2, 3] for frame in frames] == [1.0] * 4


def write_parts(folder: Path, kind: str, names: list[str]) -> Path:
    """Write a bag in parts, of which the first has tf and each one more shot."""
    (folder / "work").mkdir(parents=True)
    for i, name in enumerate(names):
        with BagBuilder(folder / "work", kind, f"part_{i}") as bag:
            if i == 0:
                add_poses(bag, SHOTS)
            if i < len(SHOTS):
                add_images(bag, SHOTS[i])
        storage_file(bag.path).rename(folder / name)
    shutil.rmtree(folder / "work")
    return folder


@pytest.mark.parametrize(
    ("kind", "names"),
    [
        ("ros1", [f"drive_{i}.bag" for i in range(4)]),
        ("ros1", [f"desk_2026-11-21-07-10-{50 + i}_{i + 9}.bag" for i in range(5)]),
        ("mcap", [f"rosbag2_2026_11_21-07_10_51_{i}.mcap" for i in range(4)]),
        ("db3", [f"drive_{i}.db3" for i in range(4)]),
    ],
)
def test_the_parts_of_a_bag_are_read_in_order_of_their_numbers(
    tmp_path: Path, kind: str, names: list[str]
) -> None:
    folder = write_parts(tmp_path / "parts", kind, names)
    recording = open_recording(folder)
    info = recording.info()
    assert info.format == ("ROS 1 bag" if kind == "ros1" else "ROS 2 bag")
    assert info.missing == ()
    assert {(s.name, s.count) for s in info.streams} >= {(DEPTH, 4), ("/tf_static", 2)}
    for frame, shot in zip(recording.frames(), SHOTS, strict=True):
        assert_shows(frame, shot)


@pytest.mark.parametrize("kind", ["db3", "mcap"])
def test_a_ros2_bag_in_parts_is_read_by_its_metadata(tmp_path: Path, kind: str) -> None:
    names = [f"drive_{i}.{kind}" for i in range(4)]
    folder = write_parts(tmp_path / "drive", kind, names)
    with BagBuilder(tmp_path, kind, "whole") as bag:
        without()(bag)
    metadata = yaml.safe_load((bag.path / "metadata.yaml").read_text())
    metadata["rosbag2_bagfile_information"]["relative_file_paths"] = names
    (folder / "metadata.yaml").write_text(yaml.safe_dump(metadata))
    assert open_recording(folder).info().missing == ()
    for frame, shot in zip(frames_of(folder), SHOTS, strict=True):
        assert_shows(frame, shot)


@pytest.mark.parametrize(
    ("names", "listed"),
    [
        (["a.bag", "b.bag"], "a.bag, b.bag"),
        (["a_0.bag", "b_1.bag"], "a_0.bag, b_1.bag"),
        (["a_0.bag", "a_1.bag", "other.bag"], "a_0.bag, a_1.bag, other.bag"),
        ([f"{i}_7.bag" for i in range(5)], "0_7.bag, 1_7.bag, 2_7.bag, 3_7.bag, ..."),
        (["a_0.bag", "a_1.mcap"], "a_0.bag, a_1.mcap"),
    ],
)
def test_several_bags_that_are_not_parts_of_one_are_an_error(
    tmp_path: Path, names: list[str], listed: str
) -> None:
    for name in names:
        (tmp_path / name).touch()
    assert open_recording(tmp_path).info().missing == (
        f"{tmp_path}: there are {len(names)} bags that are not the parts of one, which would be "
        f"called NAME_0, NAME_1 and so on: {listed}; name one of them",
    )


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
