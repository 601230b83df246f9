"""Options that mend a recording: clocks that differ, depth in another camera, images turned."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from hypermap.core.errors import FormatError
from hypermap.core.trajectory import compose, invert, pose_from_rpy
from hypermap.perception.frame import RgbdFrame
from hypermap.perception.pose_convention import optical_poses
from hypermap.recordings import RecordingOptions, open_recording

from .bag_builder import BagBuilder, add_poses, camera_info, image
from .bag_tools import frames_of
from .shots import INTRINSICS, SHOTS, START, write_seven_scenes, write_tum

DEPTH, COLOR = "/camera/depth/image_raw", "/camera/rgb/image_color"
LARGE = (52.0, 54.0, 31.5, 23.0)  # twice the intrinsics, for images of twice the size
ASIDE = (-0.1, 0.0, 0.0, 0.0, 0.0, 0.0)


def write_two_cameras(
    folder: Path,
    has_tf: bool = True,
    has_info: bool = True,
    right: tuple[float, float, float] = (0.1, 0, 0),
) -> Path:
    """A bag in which the color camera is 10 cm to the right of the depth camera, and larger."""
    with BagBuilder(folder, "mcap") as bag:
        add_poses(bag, SHOTS)
        if has_tf:
            bag.add_tf("/tf_static", START, "camera", "color_camera", right)
        info = "sensor_msgs/msg/CameraInfo"
        bag.add("/camera/depth/camera_info", info, START, camera_info(START))
        if has_info:
            fx, fy, cx, cy = LARGE
            large = camera_info(START, 64, 48) | {"K": [fx, 0, cx, 0, fy, cy, 0, 0, 1]}
            bag.add("/camera/rgb/camera_info", info, START, large)
        for shot in SHOTS:
            depth = image(shot.depth_mm, "16UC1", shot.stamp)
            color = np.repeat(np.repeat(shot.color, 2, axis=0), 2, axis=1)
            bag.add(DEPTH, "sensor_msgs/msg/Image", shot.stamp, depth)
            pixels = image(color, "rgb8", shot.color_stamp, frame="color_camera")
            bag.add(COLOR, "sensor_msgs/msg/Image", shot.color_stamp, pixels)
    return bag.path


def assert_registered(frame: RgbdFrame, map_T_depth: np.ndarray) -> None:
    """Assert that a frame shows the floor and the box, 1.5 and 1.1 m away, as the color camera."""
    assert frame.depth.shape == (48, 64) == frame.color.shape[:2]
    assert frame.camera.K[0, 0] == LARGE[0]
    aside = invert(pose_from_rpy(*ASIDE))
    np.testing.assert_allclose(frame.map_T_camera, compose(map_T_depth, aside), atol=1e-9)
    seen = frame.depth[np.isfinite(frame.depth)]
    assert set(np.unique(seen.round(3))) == {np.float32(1.1), np.float32(1.5)}
    # The box begins at column 10 of 32 and 1.1 m; 10 cm to the left are 52 * 0.1 / 1.1 columns.
    assert np.flatnonzero(frame.depth[24] < 1.2)[0] == pytest.approx(20 - 4.7, abs=1)


def test_a_bag_registers_depth_by_its_camera_info_and_tf(tmp_path: Path) -> None:
    path = write_two_cameras(tmp_path)
    options: dict[str, Any] = {"depth_topic": DEPTH, "color_topic": COLOR}
    (missing,) = open_recording(path, RecordingOptions(**options)).info().missing
    assert "give --register" in missing
    info = open_recording(path, RecordingOptions(**options, register=True)).info()
    assert (info.missing, info.image_size) == ((), (64, 48))
    frames = frames_of(path, **options, register=True)
    assert len(frames) == len(SHOTS)
    assert_registered(frames[0], SHOTS[0].map_T_camera)


def test_tf_may_be_that_of_the_bodies_of_both_cameras(tmp_path: Path) -> None:
    path = write_two_cameras(tmp_path, right=(0, -0.1, 0))
    options = {"depth_topic": DEPTH, "color_topic": COLOR, "register": True}
    frames = frames_of(path, **options, pose_convention="body")
    assert_registered(frames[0], optical_poses(SHOTS[0].map_T_camera, "body"))


@pytest.mark.parametrize(
    ("lack", "given", "words"),
    [
        ({"has_tf": False}, {"color_T_depth": ASIDE}, "give --depth-transform"),
        ({"has_info": False}, {"color_intrinsics": LARGE}, "give --color-intrinsics"),
    ],
)
def test_what_a_bag_lacks_for_it_is_reported_and_may_be_given(
    tmp_path: Path, lack: dict[str, bool], given: dict[str, Any], words: str
) -> None:
    path = write_two_cameras(tmp_path, **lack)
    options = {"depth_topic": DEPTH, "color_topic": COLOR, "register": True}
    (missing,) = open_recording(path, RecordingOptions(**options)).info().missing
    assert words in missing
    assert_registered(frames_of(path, **options, **given)[0], SHOTS[0].map_T_camera)


def test_a_folder_registers_depth_by_what_is_given(tmp_path: Path) -> None:
    folder = write_seven_scenes(tmp_path / "seq-01", SHOTS)
    for path in folder.glob("*.color.png"):
        with Image.open(path) as small:
            small.resize((64, 48)).save(path)
    with pytest.raises(FormatError, match="give --color-intrinsics and --depth-transform"):
        frames_of(folder, register=True)
    options = {"register": True, "color_intrinsics": LARGE, "color_T_depth": ASIDE}
    assert open_recording(folder, RecordingOptions(**options)).info().image_size == (64, 48)
    assert_registered(frames_of(folder, **options)[0], SHOTS[0].map_T_camera)


def test_poses_are_looked_up_later_by_the_time_offset(tmp_path: Path) -> None:
    folder = write_tum(tmp_path / "tum", SHOTS)
    later = frames_of(folder, time_offset=0.1, intrinsics=INTRINSICS)
    assert len(later) == len(SHOTS) - 1  # for the last one there is no pose
    for frame, shot in zip(later, SHOTS[1:], strict=True):
        np.testing.assert_allclose(frame.map_T_camera, shot.map_T_camera, atol=1e-6)
    scenes = write_seven_scenes(tmp_path / "seq-01", SHOTS)
    (between, *_) = frames_of(scenes, time_offset=1 / 60)
    expected = (SHOTS[0].position + SHOTS[1].position) / 2
    np.testing.assert_allclose(between.map_T_camera[:3, 3], expected, atol=1e-6)


def test_images_are_turned_and_their_sizes_with_them(tmp_path: Path) -> None:
    folder = write_seven_scenes(tmp_path / "seq-01", SHOTS)
    options = RecordingOptions(rotate=90)
    assert open_recording(folder, options).info().image_size == (24, 32)
    frame = next(open_recording(folder, options).frames())
    np.testing.assert_array_equal(frame.color, np.rot90(SHOTS[0].color, -1))
