"""Folders of the TUM RGB-D format: what their frames show."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image
from scipy.spatial.transform import Rotation, Slerp

from hypermap.core.errors import FormatError
from hypermap.recordings import open_recording
from hypermap.recordings.tum import default_camera

from .shots import SHOTS, assert_shows
from .tum_tools import opened, pgm_of, tiff_of


def test_the_frames_of_a_folder_are_what_was_written(folder: Path) -> None:
    recording = opened(folder)
    frames = list(recording.frames())
    assert len(recording) == len(frames) == len(SHOTS)
    for frame, shot in zip(frames, SHOTS, strict=True):
        assert_shows(frame, shot)
        assert frame.stamp == shot.stamp / 10**9
        assert frame.color_stamp == shot.color_stamp / 10**9
    assert recording.occupancy() is None


def test_info_tells_of_a_complete_recording(folder: Path) -> None:
    info = opened(folder).info()
    assert info.format == "TUM RGB-D"
    assert (info.frames, info.image_size) == (4, (32, 24))
    assert info.duration == pytest.approx(0.3, abs=1e-6)
    assert [(s.name, s.count) for s in info.streams] == [
        ("depth.txt", 4),
        ("rgb.txt", 4),
        ("groundtruth.txt", 4),
    ]
    assert info.missing == ()
    assert info.notes == ()


def test_the_desk_is_read_whole_with_interpolated_poses(shared_data: Path) -> None:
    recording = open_recording(shared_data / "desk")
    info = recording.info()
    assert (info.frames, info.image_size, info.missing) == (116, (640, 480), ())
    assert info.duration == pytest.approx(23.96, abs=0.01)
    assert info.notes == (
        "the folder names no intrinsics: those that the benchmark recommends for all its cameras "
        "are taken, 525,525,319.5,239.5 without distortion (--intrinsics)",
    )

    frame = next(recording.frames())
    assert frame.camera.K.tolist() == [[525, 0, 319.5], [0, 525, 239.5], [0, 0, 1]]
    assert frame.color_stamp == 1305031229.528748
    with Image.open(shared_data / "desk/depth/1305031229.528784.png") as image:
        raw = np.asarray(image).astype(float)
    np.testing.assert_allclose(frame.depth, np.where(raw == 0, np.nan, raw / 5000), rtol=1e-6)

    table = np.loadtxt(shared_data / "desk/groundtruth.txt")
    after = np.searchsorted(table[:, 0], 1305031229.528784)
    pair = table[after - 1 : after + 1]
    rotation = Slerp(pair[:, 0], Rotation.from_quat(pair[:, 4:]))(1305031229.528784)
    position = [np.interp(1305031229.528784, pair[:, 0], pair[:, 1 + k]) for k in range(3)]
    np.testing.assert_allclose(frame.map_T_camera[:3, :3], rotation.as_matrix(), atol=1e-6)
    np.testing.assert_allclose(frame.map_T_camera[:3, 3], position, atol=1e-6)


@settings(
    deadline=None, max_examples=10, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(seed=st.integers(0, 2**31))
def test_the_order_of_the_lines_does_not_matter(folder: Path, seed: int) -> None:
    random = np.random.default_rng(seed)
    for name in ("rgb.txt", "depth.txt", "groundtruth.txt"):
        lines = (folder / name).read_text().splitlines()
        random.shuffle(lines)
        (folder / name).write_text("\n".join(lines))
    for frame, shot in zip(opened(folder).frames(), SHOTS, strict=True):
        assert_shows(frame, shot)


def test_commas_may_separate_stamps_from_names_as_in_the_lists_of_euroc(folder: Path) -> None:
    for name in ("rgb.txt", "depth.txt"):
        lines = [line.split() for line in (folder / name).read_text().splitlines()]
        lines = [line for line in lines if line[0] != "#"]
        text = "#timestamp [ns],filename\n" + "\n".join(",".join(line) for line in lines)
        (folder / name).write_text(text)
    for frame, shot in zip(opened(folder).frames(), SHOTS, strict=True):
        assert_shows(frame, shot)


@pytest.mark.parametrize("digits", [9, 6, 3])
@pytest.mark.parametrize("names", [("depth.txt", "rgb.txt", "groundtruth.txt"), ("rgb.txt",)])
def test_stamps_may_count_parts_of_a_second_since_1970(
    folder: Path, digits: int, names: tuple[str, ...]
) -> None:
    whole = [frame.stamp for frame in opened(folder).frames()]
    for name in names:
        lines = (
            line.split() for line in (folder / name).read_text().splitlines() if line[0] != "#"
        )
        counted = [" ".join([f"{float(stamp) * 10**digits:.0f}", *rest]) for stamp, *rest in lines]
        (folder / name).write_text("\n".join(counted))
    assert [frame.stamp for frame in opened(folder).frames()] == pytest.approx(whole, abs=1e-3)


def test_16_bit_depth_may_be_pgm_or_tiff(folder: Path) -> None:
    pgm_of("depth/*", 65_535)(folder)
    assert float(np.nanmax(next(opened(folder).frames()).depth)) == 1.5
    tiff_of("depth/*", np.full((24, 32), 1500, np.uint16))(folder)
    assert float(np.nanmax(next(opened(folder).frames()).depth)) == 1.5


@pytest.mark.parametrize("depth_first", [True, False])
def test_a_list_of_pairs_stands_in_for_two_lists(folder: Path, depth_first: bool) -> None:
    lists = [(folder / name).read_text().splitlines() for name in ("depth.txt", "rgb.txt")]
    pairs = zip(*(lists if depth_first else lists[::-1]), strict=True)
    (folder / "associations.txt").write_text("# pairs\n" + "\n".join(map(" ".join, pairs)) + "\n")
    for name in ("depth.txt", "rgb.txt"):
        (folder / name).unlink()
    recording = opened(folder)
    assert recording.info().missing == ()
    assert recording.info().streams[0].name == "associations.txt"
    for frame, shot in zip(recording.frames(), SHOTS, strict=True):
        assert_shows(frame, shot)


def test_what_else_lies_in_a_folder_as_downloaded_changes_nothing(folder: Path) -> None:
    (folder / "accelerometer.txt").write_text("# timestamp ax ay az\n1600000000.2 0 0 9.81\n")
    poses = folder / "groundtruth.txt"
    before, after = "1599999999.9 0 0 0 0 0 0 1\n", "1600000009 0 0 0 0 0 0 1\n"
    comments = "# ground truth trajectory\n# file: 'a.bag'\n"
    poses.write_text(comments + before + poses.read_text() + after)
    for frame, shot in zip(opened(folder).frames(), SHOTS, strict=True):
        assert_shows(frame, shot)


def test_every_second_frame(folder: Path) -> None:
    for frame, shot in zip(opened(folder, every=2).frames(), SHOTS[::2], strict=True):
        assert_shows(frame, shot)


@pytest.mark.parametrize(
    ("size", "K"),
    [
        ((640, 480), [[525, 0, 319.5], [0, 525, 239.5], [0, 0, 1]]),
        ((320, 240), [[262.5, 0, 159.5], [0, 262.5, 119.5], [0, 0, 1]]),
    ],
)
def test_the_default_camera_scales_with_the_image(
    size: tuple[int, int], K: list[list[float]]
) -> None:
    assert default_camera(*size, Path("x")).K.tolist() == K


def test_color_is_decoded_when_it_is_asked_for_and_kept(folder: Path) -> None:
    path = min(folder.glob("rgb/*"))
    whole = path.read_bytes()
    path.write_bytes(whole[:-50])
    frame = next(opened(folder).frames())
    with pytest.raises(FormatError, match="the picture is damaged"):
        _ = frame.color
    path.write_bytes(whole)
    assert frame.color is not None
    path.unlink()
    assert_shows(frame, SHOTS[0])


def test_what_existed_is_untouched(folder: Path, tmp_path: Path) -> None:
    copy = tmp_path / "copy"
    shutil.copytree(folder, copy)
    list(opened(folder).frames())
    for path in copy.rglob("*.*"):
        if path.is_file():
            assert path.read_bytes() == (folder / path.relative_to(copy)).read_bytes()


def test_lists_may_begin_with_a_byte_order_mark(folder: Path) -> None:
    expected = [frame.map_T_camera for frame in opened(folder).frames()]
    for name in ("rgb.txt", "depth.txt", "groundtruth.txt"):
        lines = (folder / name).read_text().splitlines()
        kept = [line for line in lines if not line.startswith("#")]
        (folder / name).write_text("\n".join(kept), encoding="utf-8-sig")
    read = [frame.map_T_camera for frame in opened(folder).frames()]
    assert np.array_equal(read, expected)
