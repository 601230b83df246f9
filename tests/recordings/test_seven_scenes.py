from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from hypermap.core.errors import FileMissing, FormatError, HypermapError
from hypermap.recordings import RecordingOptions, open_recording

from .shots import INTRINSICS, SHOTS, assert_broken, assert_shows, write_seven_scenes


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_seven_scenes(tmp_path / "seq-01", SHOTS)


def test_the_frames_of_a_folder_are_what_was_written(folder: Path) -> None:
    recording = open_recording(folder)
    frames = list(recording.frames())
    assert len(recording) == len(frames) == len(SHOTS)
    for i, (frame, shot) in enumerate(zip(frames, SHOTS, strict=True)):
        assert_shows(frame, shot)
        assert frame.stamp == frame.color_stamp == i / 30
        K = frame.camera.K
        assert (K[0, 0], K[1, 1], K[0, 2], K[1, 2]) == INTRINSICS


def test_info_tells_of_a_complete_recording(folder: Path) -> None:
    info = open_recording(folder).info()
    assert info.format == "7-Scenes"
    assert (info.frames, info.image_size, info.missing) == (4, (32, 24), ())
    assert info.duration == pytest.approx(0.1)
    assert [(s.name, s.count) for s in info.streams] == [
        ("frame-*.depth.png", 4),
        ("frame-*.color.png", 4),
        ("frame-*.pose.txt", 4),
    ]
    assert info.notes == (
        "stamps are frame numbers at 30 Hz",
        "the world is taken as level, z up; if it is not, give --level auto or --world-transform",
    )


def test_jpeg_color_and_intrinsics_one_folder_up(folder: Path) -> None:
    for path in folder.glob("*.color.png"):
        with Image.open(path) as image:
            image.save(path.with_suffix(".jpg"), quality=100)
        path.unlink()
    (folder / "camera-intrinsics.txt").rename(folder.parent / "camera-intrinsics.txt")
    frame = next(open_recording(folder).frames())
    with Image.open(folder / "frame-000000.color.jpg") as image:
        np.testing.assert_array_equal(frame.color, np.asarray(image))


def write_info(path: Path, **said: str) -> None:
    """Write the file of 3RScan and BundleFusion that tells of both cameras."""
    fx, fy, cx, cy = INTRINSICS
    rest = "0 0 0 1 0 0 0 0 1"
    color = f"{2 * fx} 0 {2 * cx + 0.5} 0 0 {2 * fy} {2 * cy + 0.5}"
    lines = {
        "m_versionNumber": "4",
        "m_colorWidth": "64",
        "m_colorHeight": "48",
        "m_depthWidth": "32",
        "m_depthHeight": "24",
        "m_depthShift": "2000",
        "m_calibrationColorIntrinsic": f"{color} {rest}",
        "m_calibrationDepthIntrinsic": f"{fx} 0 {cx} 0 0 {fy} {cy} {rest}",
    } | said
    path.write_text("\n".join(f"{name} = {value} " for name, value in lines.items()))


@pytest.mark.parametrize("name", ["_info.txt", "info.txt"])
def test_3rscan_and_bundlefusion_tell_of_both_cameras_in_one_file(folder: Path, name: str) -> None:
    (folder / "camera-intrinsics.txt").unlink()
    write_info(folder / name)
    for i, shot in enumerate(SHOTS):
        Image.fromarray(shot.depth_mm).save(folder / f"frame-{i:06d}.depth.pgm")
        (folder / f"frame-{i:06d}.depth.png").unlink()
        with Image.open(folder / f"frame-{i:06d}.color.png") as image:
            image.resize((64, 48), Image.Resampling.NEAREST).save(image.filename)
    for frame, shot in zip(open_recording(folder).frames(), SHOTS, strict=True):
        K = frame.camera.K
        assert (K[0, 0], K[1, 1], K[0, 2], K[1, 2]) == INTRINSICS
        np.testing.assert_array_equal(frame.color, shot.color)
        with_return = np.isfinite(frame.depth)
        assert with_return.any()
        np.testing.assert_allclose(frame.depth[with_return], shot.depth_mm[with_return] / 2000)


def test_another_file_named_info_is_no_file_of_intrinsics(folder: Path) -> None:
    (folder / "info.txt").write_text("recorded on Monday\n")
    assert open_recording(folder).info().missing == ()


@pytest.mark.parametrize(
    "said",
    [
        {"m_calibrationDepthIntrinsic": "570 570 320 240"},
        {"m_depthShift": "0"},
        {"m_depthWidth": "many"},
    ],
)
def test_intrinsics_that_are_none_are_an_error_that_names_the_file(
    folder: Path, said: dict[str, str]
) -> None:
    (folder / "camera-intrinsics.txt").unlink()
    write_info(folder / "info.txt", **said)
    missing = open_recording(folder).info().missing[0]
    assert missing.startswith(f"{folder}/info.txt: m_calibration")
    assert "expected the 16 numbers of a 4 x 4 matrix" in missing


def test_depth_of_0_and_65535_is_no_return(folder: Path) -> None:
    depth = SHOTS[0].depth_mm.copy()
    depth[2, 2:5] = 0, 65535, 65534
    Image.fromarray(depth).save(folder / "frame-000000.depth.png")
    frame = next(open_recording(folder).frames())
    np.testing.assert_array_equal(frame.depth[2, 2:5], np.float32([np.nan, np.nan, 65.534]))


def test_a_world_that_is_not_level_is_turned_by_an_option(folder: Path) -> None:
    # The world's y axis points down and its origin lies 1.2 m above the floor.
    options = RecordingOptions(map_T_world=(0, 0, 1.2, -math.pi / 2, 0, 0))
    frame = next(open_recording(folder, options).frames())
    x, y, z = SHOTS[0].position
    assert frame.map_T_camera[:3, 3] == pytest.approx([x, z, 1.2 - y])


def test_frames_without_tracking_or_an_image_are_counted(folder: Path) -> None:
    for i, word in enumerate(["nan", "-inf", "-1.#IND"]):
        row = f"{word} 0 0 0\n"
        (folder / f"frame-{i:06d}.pose.txt").write_text(row + "0 1 0 0\n0 0 1 0\n0 0 0 1\n")
    (folder / "frame-000000.color.png").unlink()
    recording = open_recording(folder)
    [frame] = recording.frames()
    assert frame.stamp == 3 / 30
    assert recording.info().notes[2:] == (
        "left out, without an image or a pose: 1 frame",
        "left out, without a pose (tracking was lost): 2 frames",
    )


def test_without_color_there_is_depth_and_info_says_what_is_missing(folder: Path) -> None:
    for path in folder.glob("*.color.png"):
        path.unlink()
    recording = open_recording(folder)
    assert [frame.color for frame in recording.frames()] == [None] * 4
    assert recording.info().missing == (
        "there are no color images frame-*.color.jpg or .color.png: without them no objects can "
        "be detected",
    )


def text_of(name: str, text: str) -> Callable[[Path], object]:
    return lambda folder: (folder / name).write_text(text)


def remove_all(pattern: str) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        for path in folder.glob(pattern):
            path.unlink()

    return change


@pytest.mark.parametrize(
    ("change", "kind", "message"),
    [
        (
            remove_all("camera-intrinsics.txt"),
            FileMissing,
            "{}: there are no intrinsics, here or one folder up: expected camera-intrinsics.txt, "
            "_info.txt or info.txt; or give --intrinsics (the page of 7-Scenes says "
            "585,585,320,240)",
        ),
        (
            text_of("camera-intrinsics.txt", "585 585 320 240"),
            FormatError,
            "{}/camera-intrinsics.txt: expected 3 rows of 3 or 4 rows of 4 numbers, found rows of "
            "these lengths: 4",
        ),
        (
            text_of("camera-intrinsics.txt", "0 0 1\n0 1 1\n0 0 1\n"),
            FormatError,
            "{}/camera-intrinsics.txt: focal lengths must be positive, got 0.0, 1.0",
        ),
        (
            text_of("camera-intrinsics.txt", "585 0 320\n0 585 240\n0 0 1\n"),
            FormatError,
            "{}/camera-intrinsics.txt: the principal point (320, 240) is not on the images of 32 x "
            "24 pixels: these intrinsics are for another image size; give --intrinsics",
        ),
        (
            text_of("camera-intrinsics.txt", ""),
            FormatError,
            "{}/camera-intrinsics.txt: expected 3 rows of 3 or 4 rows of 4 numbers, found rows of "
            "these lengths: none",
        ),
        (
            remove_all("*.pose.txt"),
            FileMissing,
            "{}: there are no camera poses, expected frame-*.pose.txt; SLAM estimates them",
        ),
        (
            remove_all("*.depth.png"),
            FormatError,
            "{}: there is no complete frame: 0 depth images, 4 color images and 4 poses, 0 of "
            "them without tracking",
        ),
    ],
)
def test_broken_folders_are_errors_that_info_tells(
    folder: Path, change: Callable[[Path], None], kind: type[HypermapError], message: str
) -> None:
    change(folder)
    assert_broken(folder, kind, message.replace("{}", str(folder)))


def test_poses_may_have_commas_and_be_of_another_convention(folder: Path) -> None:
    true = [frame.map_T_camera for frame in open_recording(folder).frames()]
    for path in folder.glob("*.pose.txt"):
        inverse = np.linalg.inv(np.loadtxt(path))
        np.savetxt(path, inverse, delimiter=",")
    options = RecordingOptions(pose_convention="world-to-camera")
    for frame, pose in zip(open_recording(folder, options).frames(), true, strict=True):
        np.testing.assert_allclose(frame.map_T_camera, pose, atol=1e-6)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("1 0 0 0\n0 one 0 0\n", "line 2: expected numbers, found '0 one 0 0'"),
        (
            "2 0 0 0\n0 2 0 0\n0 0 2 0\n0 0 0 1\n",
            "the matrix stretches by 2, 2, 2, so it is not a rotation",
        ),
    ],
)
def test_a_broken_pose_costs_its_frame_alone(folder: Path, text: str, problem: str) -> None:
    message = f"{folder}/frame-000002.pose.txt: {problem}"
    text_of("frame-000002.pose.txt", text)(folder)
    info = open_recording(folder).info()
    assert info.missing == ()
    assert f"poses that cannot be read: 1, the first is {message}" in info.notes
    reported: list[str] = []
    frames = list(open_recording(folder).frames(lambda _, error: reported.append(str(error))))
    assert len(frames) == 3
    assert reported == [message]
    with pytest.raises(FormatError) as caught:
        list(open_recording(folder).frames())
    assert str(caught.value) == message
    for number in (0, 1, 3):
        text_of(f"frame-00000{number}.pose.txt", text)(folder)
    assert open_recording(folder).info().missing == (message.replace("000002", "000000"),)


@pytest.mark.parametrize("digits", [2, 4, 7])
def test_poses_of_rounded_numbers_are_made_rigid(folder: Path, digits: int) -> None:
    for i, shot in enumerate(SHOTS):
        lines = ("".join(f"{number: .{digits}f}\t " for number in row) for row in shot.map_T_camera)
        (folder / f"frame-{i:06d}.pose.txt").write_text("\n".join(lines) + "\n\n")
    for frame, shot in zip(open_recording(folder).frames(), SHOTS, strict=True):
        rotation = frame.map_T_camera[:3, :3]
        np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
        np.testing.assert_allclose(frame.map_T_camera, shot.map_T_camera, atol=10.0**-digits)


def test_depth_and_color_of_different_size_from_the_start_are_reported_by_info(
    folder: Path,
) -> None:
    path = folder / "frame-000000.color.png"
    for color in folder.glob("*.color.png"):
        Image.fromarray(np.zeros((48, 64, 3), np.uint8)).save(color)
    assert open_recording(folder).info().missing == (
        f"{path}: color has 64 x 48 pixels, but depth in {folder}/frame-000000.depth.png has "
        "32 x 24; color must be registered to depth and have its size; or give --register, "
        "--color-intrinsics and --depth-transform",
    )


def test_depth_and_color_of_different_size_are_an_error(folder: Path) -> None:
    path = folder / "frame-000001.color.png"
    Image.fromarray(np.zeros((48, 64, 3), np.uint8)).save(path)
    frames = open_recording(folder).frames()
    next(frames)
    second = next(frames)
    with pytest.raises(FormatError) as caught:
        _ = second.color
    assert str(caught.value) == (
        f"{path}: the picture has 64 x 48 pixels, but the depth image (color must be registered "
        "to depth) has 32 x 24"
    )
