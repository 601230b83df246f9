"""Folders of images whose names contain the number of their frame, besides those of 7-Scenes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from hypermap.core.errors import FileMissing, FormatError, HypermapError
from hypermap.recordings import RecordingOptions, open_recording

from .shots import (
    INTRINSICS,
    SHOTS,
    Shot,
    assert_broken,
    assert_shows,
    write_redwood,
    write_replica,
    write_scannet,
)

Write = Callable[[Path, list[Shot]], Path]


@pytest.mark.parametrize(
    ("write", "kind", "names"),
    [
        (write_scannet, "numbered images", ["depth/*.png", "color/*.png", "pose/*.txt"]),
        (write_replica, "Replica", ["results/depth*.png", "results/frame*.png", "traj.txt"]),
        (
            write_redwood,
            "numbered images",
            ["depth/*.png", "color/*.png", "scene/trajectory.log"],
        ),
    ],
)
def test_the_frames_of_a_folder_are_what_was_written(
    tmp_path: Path, write: Write, kind: str, names: list[str]
) -> None:
    recording = open_recording(write(tmp_path / "scene", SHOTS))
    info = recording.info()
    assert (info.format, info.frames, info.image_size, info.missing) == (kind, 4, (32, 24), ())
    assert [(s.name, s.count) for s in info.streams] == [(name, 4) for name in names]
    for frame, shot in zip(recording.frames(), SHOTS, strict=True):
        assert_shows(frame, shot)
        K = frame.camera.K
        assert (K[0, 0], K[1, 1], K[0, 2], K[1, 2]) == INTRINSICS


@pytest.mark.parametrize("first", [0, 1])
def test_poses_in_the_order_of_text_are_told(tmp_path: Path, first: int) -> None:
    shots = [SHOTS[0]] * 40
    folder = write_replica(tmp_path / "scene", shots)
    told = "traj.txt seem to be in the order 0, 1, 10, 11, ..., 2 of files sorted as text"
    poses = np.tile(np.eye(4), (len(shots), 1, 1))
    poses[:, 0, 3] = np.cumsum(np.random.default_rng(0).uniform(0, 0.1, len(shots)))
    numbers = range(first, first + len(shots))
    for order, is_told in ((sorted(numbers, key=str), True), (list(numbers), False)):
        np.savetxt(folder / "traj.txt", [poses[i - first].ravel() for i in order])
        assert (told in " ".join(open_recording(folder).info().notes)) == is_told


def test_color_of_another_camera_is_seen_by_the_depth_camera(tmp_path: Path) -> None:
    folder = write_scannet(tmp_path / "scene", SHOTS)
    # The color camera sees half as far to each side, at the same size of a pixel: a red picture.
    K = np.diag([26.0, 27.0, 1.0])
    K[:2, 2] = 7.5, 5.25
    np.savetxt(folder / "intrinsic/intrinsic_color.txt", K)
    red = np.zeros((12, 16, 3), np.uint8) + np.uint8([255, 0, 0])
    for path in folder.glob("color/*.png"):
        Image.fromarray(red).save(path)
    frame = next(open_recording(folder).frames())
    assert frame.color is not None
    inside = np.zeros((24, 32), bool)
    inside[6:18, 8:24] = True
    assert (frame.color[inside] == [255, 0, 0]).all()
    assert not frame.color[~inside].any()


def test_depth_can_be_registered_to_color_with_the_files_of_both_cameras(tmp_path: Path) -> None:
    folder = write_scannet(tmp_path / "scene", SHOTS)
    options = RecordingOptions(register=True, color_intrinsics=(52, 54, 31.5, 23))
    frame = next(open_recording(folder, options).frames())
    assert frame.depth.shape == (48, 64)
    np.testing.assert_array_equal(frame.color, SHOTS[0].color.repeat(2, 0).repeat(2, 1))


@pytest.mark.parametrize(
    ("write", "first", "kept"),
    [(write_replica, "results/{}{:06d}.png", [0, 2, 3]), (write_redwood, "{}/{:05d}.png", [2, 4])],
)
def test_poses_of_one_file_belong_to_the_images_of_their_number(
    tmp_path: Path, write: Write, first: str, kept: list[int]
) -> None:
    folder = write(tmp_path / "scene", SHOTS)
    start = 0 if write is write_replica else 1
    depth, color = ("depth", "frame") if write is write_replica else ("depth", "color")
    for number in {start + i for i in range(4)} - set(kept):
        (folder / first.format(depth, number)).unlink()
        (folder / first.format(color, number)).unlink()
    recording = open_recording(folder)
    for frame, number in zip(recording.frames(), kept, strict=True):
        assert_shows(frame, SHOTS[number - start])
    notes = recording.info().notes
    lost = {3: "1 frame", 2: "2 frames"}[len(kept)]
    assert f"left out, without an image or a pose: {lost}" in notes


@pytest.mark.parametrize(("first", "count"), [(0, 3), (1, 2), (1, 3)])
def test_images_after_the_last_pose_of_one_file_are_left_out(
    tmp_path: Path, first: int, count: int
) -> None:
    folder = write_redwood(tmp_path / "scene", SHOTS)  # from 1 on
    for name in ("depth", "color"):
        for number in range(1, 5):
            path = folder / name / f"{number:05d}.png"
            path.rename(path.with_name(f"{number + first - 1}.png"))
    log = folder / "scene/trajectory.log"
    log.write_text("".join(log.read_text().splitlines(keepends=True)[: 5 * count]))
    recording = open_recording(folder)
    for frame, shot in zip(recording.frames(), SHOTS[:count], strict=True):
        assert_shows(frame, shot)
    assert (
        f"trajectory.log has {count} poses for 4 depth images: they are taken as those of the "
        f"images {first} to {first + count - 1}; if they are of others, the images must be named "
        f"by the number of their pose, from {first}"
    ) in recording.info().notes


def test_intrinsics_may_lie_one_folder_up_as_those_of_all_scenes_of_replica(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = write_replica(tmp_path / "room0", SHOTS)
    (folder / "cam_params.json").rename(tmp_path / "cam_params.json")
    assert_shows(next(open_recording(folder).frames()), SHOTS[0])
    monkeypatch.chdir(folder)
    assert_shows(next(open_recording(".").frames()), SHOTS[0])


@pytest.mark.parametrize("name", ["rgb", "image", "images"])
def test_a_folder_without_images_does_not_hide_another_one_with_them(
    tmp_path: Path, name: str
) -> None:
    folder = write_redwood(tmp_path / "scene", SHOTS)
    (folder / "color").rename(folder / name)
    (folder / "color").mkdir()
    for path in (folder / name).iterdir():
        path.rename(path.with_suffix(".PNG"))
    recording = open_recording(folder)
    assert_shows(next(recording.frames()), SHOTS[0])
    streams = recording.info().streams
    assert (f"{name}/*.PNG", 4) in [(stream.name, stream.count) for stream in streams]


@pytest.mark.parametrize("ticks", [10**3, 10**6, 10**9])
def test_numbers_that_are_times_are_read_as_such(tmp_path: Path, ticks: int) -> None:
    folder = write_scannet(tmp_path / "scene", SHOTS)
    for name in ("color", "depth", "pose"):
        for path in (folder / name).iterdir():
            number = 1_600_000_000 * ticks + int(path.stem) * ticks // 10
            path.rename(path.with_stem(str(number)))
    recording = open_recording(folder)
    stamps = [frame.stamp for frame in recording.frames()]
    np.testing.assert_allclose(np.subtract(stamps, 1.6e9), [0, 0.1, 0.2, 0.3], atol=1e-6)
    assert "stamps are the times in the names of the files" in recording.info().notes


def test_a_pose_whose_file_is_a_dangling_link_costs_its_own_frame_only(tmp_path: Path) -> None:
    folder = write_scannet(tmp_path / "scene", SHOTS)
    (folder / "pose/1.txt").unlink()
    (folder / "pose/1.txt").symlink_to(tmp_path / "nothing")
    bad: list[float] = []
    recording = open_recording(folder)
    assert len(list(recording.frames(lambda stamp, _: bad.append(stamp)))) == 3
    assert bad == [pytest.approx(1 / 30)]
    said = f"poses that cannot be read: 1, the first is {folder}/pose/1.txt: there is no such file"
    assert said in recording.info().notes


def test_frames_without_tracking_are_left_out(tmp_path: Path) -> None:
    folder = write_replica(tmp_path / "room0", SHOTS)
    lines = (folder / "traj.txt").read_text().splitlines()
    lines[1] = " ".join(["-inf"] * 16)
    (folder / "traj.txt").write_text("\n".join(lines))
    recording = open_recording(folder)
    assert len(recording) == 3
    said = "left out, without a pose (tracking was lost): 1 frame"
    assert said in recording.info().notes


def test_depth_of_replica_has_its_own_scale_where_no_file_says_another(tmp_path: Path) -> None:
    folder = write_replica(tmp_path / "room0", SHOTS)
    (folder / "cam_params.json").unlink()
    frame = next(open_recording(folder, RecordingOptions(intrinsics=INTRINSICS)).frames())
    assert frame.depth[-1, -1] == pytest.approx(5 * 1500 / 6553.5)


def test_poses_of_one_file_may_lack_the_last_row_of_each_matrix_as_those_of_kitti(
    tmp_path: Path,
) -> None:
    folder = write_replica(tmp_path / "room0", SHOTS)
    path = folder / "traj.txt"
    np.savetxt(path, np.loadtxt(path)[:, :12])
    for frame, shot in zip(open_recording(folder).frames(), SHOTS, strict=True):
        assert_shows(frame, shot)


def rewrite(name: str, text: str) -> Callable[[Path], object]:
    return lambda folder: (folder / name).write_text(text)


@pytest.mark.parametrize(
    ("write", "change", "kind", "message"),
    [
        (
            write_replica,
            lambda folder: (folder / "traj.txt").unlink(),
            FileMissing,
            "{}: there are no camera poses, expected traj.txt; SLAM estimates them",
        ),
        (
            write_replica,
            rewrite("traj.txt", "1 0 0 0\n"),
            FormatError,
            "{}/traj.txt: line 1: expected 16 or 12 numbers in each line, row by row of a 4 x 4 "
            "matrix",
        ),
        (
            write_replica,
            rewrite("traj.txt", " 1 0 0 0 0 1 0 0 0 0 1 0\n 1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1\n"),
            FormatError,
            "{}/traj.txt: line 2: expected 16 or 12 numbers in each line, row by row of a 4 x 4 "
            "matrix",
        ),
        (
            write_replica,
            lambda folder: (folder / "cam_params.json").unlink(),
            FileMissing,
            "{}: there are no intrinsics, here or one folder up: expected cam_params.json; or give "
            "--intrinsics (those of NICE-SLAM's renderings are 600,600,599.5,339.5)",
        ),
        (
            write_replica,
            rewrite("cam_params.json", '{"camera": {"fx": 1}}'),
            FormatError,
            "{}/cam_params.json: expected the intrinsics fx, fy, cx and cy under camera, or "
            "Open3D's intrinsic_matrix; give --intrinsics",
        ),
        (
            write_redwood,
            rewrite("scene/trajectory.log", "0 0 1\n" + "1 0 0 0\n" * 4 + "1 1 2\n1 0 0\n"),
            FormatError,
            "{}/scene/trajectory.log: line 7: expected groups of three numbers and four rows of "
            "four, row by row of a 4 x 4 matrix",
        ),
        (
            write_redwood,
            rewrite("scene/trajectory.log", "0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n"),
            FormatError,
            "{}/scene/trajectory.log: line 4: expected groups of three numbers and four rows of "
            "four, row by row of a 4 x 4 matrix",
        ),
        (
            write_redwood,
            rewrite("camera_intrinsic.json", '{"intrinsic_matrix": [1, 2]}'),
            FormatError,
            "{}/camera_intrinsic.json: expected the intrinsics fx, fy, cx and cy under camera, or "
            "Open3D's intrinsic_matrix; give --intrinsics",
        ),
        (
            write_redwood,
            rewrite("camera_intrinsic.json", f'{{"intrinsic_matrix": [{9**999}]}}'),
            FormatError,
            "{}/camera_intrinsic.json: expected the intrinsics fx, fy, cx and cy under camera, or "
            "Open3D's intrinsic_matrix; give --intrinsics",
        ),
        (
            write_redwood,
            rewrite(
                "camera_intrinsic.json",
                '{"width": 40, "height": 24, "intrinsic_matrix": [26, 0, 0, 0, 27, 0, 15, 11, 1]}',
            ),
            FormatError,
            "{}/camera_intrinsic.json: the size is 40 x 24, not that of the images, 32 x 24 "
            "pixels: these intrinsics are for another image size; give --intrinsics",
        ),
        (
            write_scannet,
            rewrite("intrinsic/intrinsic_depth.txt", "1 2\n3 4\n"),
            FormatError,
            "{}/intrinsic/intrinsic_depth.txt: expected 3 rows of 3 or 4 rows of 4 numbers, found "
            "rows of these lengths: 2, 2",
        ),
        (
            write_scannet,
            rewrite("intrinsic/intrinsic_color.txt", "9 0 99\n0 9 5\n0 0 1\n"),
            FormatError,
            "{}/intrinsic/intrinsic_color.txt: the principal point (99, 5) is not on the images of "
            "64 x 48 pixels: these intrinsics are for another image size; give --intrinsics",
        ),
    ],
)
def test_broken_folders_are_errors_that_info_tells(
    tmp_path: Path,
    write: Write,
    change: Callable[[Path], object],
    kind: type[HypermapError],
    message: str,
) -> None:
    folder = write(tmp_path / "scene", SHOTS)
    change(folder)
    assert_broken(folder, kind, message.replace("{}", str(folder)))
