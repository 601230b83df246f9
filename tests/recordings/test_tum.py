from __future__ import annotations

import re
import shutil
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image
from scipy.spatial.transform import Rotation, Slerp

from hypermap.core.errors import FileMissing, FormatError, HypermapError
from hypermap.perception.recording import Recording
from hypermap.recordings import RecordingOptions, open_recording
from hypermap.recordings.tum import default_camera, read_trajectory

from .shots import INTRINSICS, SHOTS, Shot, assert_shows, write_tum


def opened(folder: Path, **options: object) -> Recording:
    known = {"depth_scale": 1000.0, "intrinsics": INTRINSICS} | options
    return open_recording(folder, RecordingOptions(**known))  # type: ignore[arg-type]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_tum(tmp_path / "recording", SHOTS)


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


def test_poses_out_of_order_and_repeated_are_sorted_out_and_noted(folder: Path) -> None:
    path = folder / "groundtruth.txt"
    lines = path.read_text().splitlines()[1:]
    path.write_text("\n".join([*lines[::-1], lines[0]]))
    assert opened(folder).info().notes == (
        "the stamps of groundtruth.txt were out of order and have been sorted",
        "1 pose of groundtruth.txt left out: with the stamp of another",
    )


def test_commas_may_separate_stamps_from_names_as_in_the_lists_of_euroc(folder: Path) -> None:
    for name in ("rgb.txt", "depth.txt"):
        lines = [line.split() for line in (folder / name).read_text().splitlines()]
        lines = [line for line in lines if line[0] != "#"]
        text = "#timestamp [ns],filename\n" + "\n".join(",".join(line) for line in lines)
        (folder / name).write_text(text)
    for frame, shot in zip(opened(folder).frames(), SHOTS, strict=True):
        assert_shows(frame, shot)


def test_commas_may_separate_the_numbers_of_poses(folder: Path) -> None:
    before = [frame.map_T_camera for frame in opened(folder).frames()]
    path = folder / "groundtruth.txt"
    path.write_text(path.read_text().replace(" ", ", "))
    after = [frame.map_T_camera for frame in opened(folder).frames()]
    np.testing.assert_array_equal(after, before)


EUROC = (
    "#timestamp [ns], p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], "
    "q_RS_z []"
)


def as_euroc(folder: Path, header: str, others: str = "", since: float = 0.0) -> Path:
    """Rewrite the poses of a folder as EuRoC has them, w first, with stamps since some time [s]."""
    path = folder / "groundtruth.txt"
    rows = [line.split() for line in path.read_text().splitlines() if not line.startswith("#")]
    lines = (
        ",".join((f"{(float(row[0]) - since) * 1e9:.0f}", *row[1:4], row[7], *row[4:7])) + others
        for row in rows
    )
    path.write_text("\n".join((header, *lines)))
    return path


@pytest.mark.parametrize(("more", "others"), [("", ""), (", v_RS_R_x [m s^-1]", ",0.5")])
def test_the_header_of_a_trajectory_tells_its_columns_as_in_euroc(
    folder: Path, more: str, others: str
) -> None:
    before = [frame.map_T_camera for frame in opened(folder).frames()]
    path = as_euroc(folder, EUROC + more, others)
    after = [frame.map_T_camera for frame in opened(folder).frames()]
    np.testing.assert_allclose(after, before, atol=1e-6)
    (note,) = read_trajectory(path, 1.0)[1]
    assert "its header names the columns timestamp [ns], p_RS_R_x [m]" in note
    assert note.endswith("; 1 column more left out") == bool(more)


def test_the_header_of_a_trajectory_tells_the_unit_of_its_stamps(folder: Path) -> None:
    path = folder / "groundtruth.txt"
    whole = read_trajectory(path, 1.0)[0].stamps
    as_euroc(folder, EUROC, since=whole[0] - 5.0)  # since the start of a computer
    stamps = read_trajectory(path, 1.0)[0].stamps
    assert stamps == pytest.approx(whole - whole[0] + 5.0, abs=1e-6)


def test_the_units_of_a_header_may_be_spelled_out(folder: Path) -> None:
    path = folder / "groundtruth.txt"
    known, _ = read_trajectory(path, 1.0)
    header = "# timestamp [sec], x [meters], y [Meters], z [meter], qx, qy, qz, qw\n"
    path.write_text(header + path.read_text())
    trajectory, notes = read_trajectory(path, 1.0)
    np.testing.assert_array_equal(trajectory.stamps, known.stamps)
    np.testing.assert_array_equal(trajectory.positions, known.positions)
    assert notes == ()


@pytest.mark.parametrize(
    ("header", "others", "message"),
    [
        (EUROC, ",0.5", "line 2: expected 8 numbers, as its header says, found 9"),
        (
            EUROC.replace("_x [m]", "_x [mm]"),
            "",
            "header: the column 'p_RS_R_x [mm]' has the unit 'mm', known are: m",
        ),
        (EUROC.replace("[ns]", "[min]"), "", "'timestamp [min]' has the unit 'min', known are: s"),
    ],
)
def test_a_header_that_does_not_fit_is_an_error(
    folder: Path, header: str, others: str, message: str
) -> None:
    path = as_euroc(folder, header, others)
    with pytest.raises(FormatError, match=re.escape(message)):
        read_trajectory(path, 1.0)


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


def test_stamps_since_the_start_of_a_computer_are_of_one_unit(folder: Path) -> None:
    """Counted in ns, they pass after 100 s what would be ms since 1970."""
    path, stamps = folder / "groundtruth.txt", np.arange(95e9, 105e9, 1e8)
    path.write_text("\n".join(f"{stamp:.0f} {stamp / 1e9} 0 1 0 0 0 1" for stamp in stamps))
    trajectory, notes = read_trajectory(path, 1.0)
    np.testing.assert_allclose(trajectory.stamps, stamps)
    assert notes == ()


def test_16_bit_depth_may_be_pgm_or_tiff(folder: Path) -> None:
    pgm_of("depth/*", 65_535)(folder)
    assert float(np.nanmax(next(opened(folder).frames()).depth)) == 1.5
    tiff_of("depth/*", np.full((24, 32), 1500, np.uint16))(folder)
    assert float(np.nanmax(next(opened(folder).frames()).depth)) == 1.5


def test_poses_of_another_convention_are_read_on_request(folder: Path) -> None:
    true = [frame.map_T_camera for frame in opened(folder).frames()]
    path = folder / "groundtruth.txt"
    rows = [line.split() for line in path.read_text().splitlines() if not line.startswith("#")]
    path.write_text("\n".join(" ".join((*row[:4], row[7], *row[4:7])) for row in rows))
    read = opened(folder, pose_convention="w-first").frames()
    for frame, pose in zip(read, true, strict=True):
        np.testing.assert_allclose(frame.map_T_camera, pose, atol=1e-9)


def test_without_color_there_is_depth_and_info_says_what_is_missing(folder: Path) -> None:
    (folder / "rgb.txt").unlink()
    recording = opened(folder)
    assert [frame.color for frame in recording.frames()] == [None] * 4
    assert recording.info().missing == (
        "rgb.txt is missing: without color images no objects can be detected",
    )


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


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("# nothing\n", "the list is empty"),
        (
            "1 a/1.png 1 b/1.png\n",
            "line 1: expected stamp, file, stamp, file, with one file named depth, found "
            "'1 a/1.png 1 b/1.png'",
        ),
        (
            "1 depth/1.png\n",
            "line 1: expected stamp, file, stamp, file, with one file named depth, found "
            "'1 depth/1.png'",
        ),
        ("x rgb/1.png 1 depth/1.png\n", "line 1: expected numbers, found 'x'"),
    ],
)
def test_a_broken_list_of_pairs_is_an_error(folder: Path, text: str, message: str) -> None:
    (folder / "depth.txt").unlink()
    path = folder / "associations.txt"
    path.write_text(text)
    with pytest.raises(FormatError) as caught:
        len(opened(folder))
    assert str(caught.value) == f"{path}: {message}"


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


def line_of(name: str, number: int, text: str) -> Callable[[Path], None]:
    """Replace a line of a list."""

    def change(folder: Path) -> None:
        lines = (folder / name).read_text().splitlines()
        lines[number - 1] = text
        (folder / name).write_text("\n".join(lines))

    return change


def content_of(pattern: str, content: bytes | None) -> Callable[[Path], None]:
    """Replace the content of the first file that fits; cut it off for None."""

    def change(folder: Path) -> None:
        path = min(folder.glob(pattern))
        path.write_bytes(path.read_bytes()[:60] if content is None else content)

    return change


def picture_of(pattern: str, pixels: np.ndarray) -> Callable[[Path], None]:
    return lambda folder: Image.fromarray(pixels).save(min(folder.glob(pattern)))


def pgm_of(pattern: str, most: int) -> Callable[[Path], None]:
    """Replace the first file that fits by a PGM with this largest value."""
    header = f"P5 32 24 {most}\n".encode()
    return content_of(pattern, header + np.full((24, 32), 1500, ">u2").tobytes())


def tiff_of(pattern: str, pixels: np.ndarray) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        Image.fromarray(pixels).save(min(folder.glob(pattern)), format="TIFF")

    return change


def remove(pattern: str) -> Callable[[Path], None]:
    return lambda folder: min(folder.glob(pattern)).unlink()


NO_POSES = (
    "{}/groundtruth.txt: there is no such file, and so no camera poses; SLAM estimates them: copy "
    "its trajectory here under this name, such as CameraTrajectory.txt of ORB-SLAM"
)
NO_DEPTH = (
    "{}/depth.txt: there is no such list, and so no depth images, without which nothing can be "
    "mapped; write one if there are any: in each line a stamp and the image's name"
)
D0, C0 = "1600000000.250000000", "1600000000.254000000"


@pytest.mark.parametrize(
    ("change", "kind", "message"),
    [
        (remove("depth.txt"), FileMissing, NO_DEPTH),
        (remove("groundtruth.txt"), FileMissing, NO_POSES),
        (
            remove("depth/*"),
            FileMissing,
            f"{{}}/depth/{D0}.png: there is no such file",
        ),
        (
            remove("rgb/*"),
            FileMissing,
            f"{{}}/rgb/{C0}.png: there is no such file",
        ),
        (content_of("depth.txt", b"# nothing\n"), FormatError, "{}/depth.txt: the list is empty"),
        (
            content_of("rgb.txt", b"\xff\xfe\x00"),
            FormatError,
            "{}/rgb.txt: is not text in UTF-8; if it is text, save it in this encoding",
        ),
        (
            content_of("groundtruth.txt", b"\n"),
            FormatError,
            "{}/groundtruth.txt: there are no poses in it",
        ),
        (
            line_of("depth.txt", 2, "1600000000.35"),
            FormatError,
            "{}/depth.txt: line 2: expected a stamp and a file name, found '1600000000.35'",
        ),
        (
            line_of("rgb.txt", 3, "soon rgb/x.png"),
            FormatError,
            "{}/rgb.txt: line 3: expected numbers, found 'soon'",
        ),
        (
            line_of("rgb.txt", 3, "inf rgb/x.png"),
            FormatError,
            "{}/rgb.txt: line 3: there is a number that is not finite",
        ),
        (
            line_of("groundtruth.txt", 2, "1 2 3 4 5 6 7"),
            FormatError,
            "{}/groundtruth.txt: line 2: expected 8 numbers (stamp tx ty tz qx qy qz qw), found 7",
        ),
        (
            line_of("groundtruth.txt", 2, "1 2 3 4 0 0 0 1 17"),
            FormatError,
            "{}/groundtruth.txt: line 2: expected 8 numbers (stamp tx ty tz qx qy qz qw), found 9; "
            "RTAB-Map writes 8 with --poses_format 10",
        ),
        (
            line_of("groundtruth.txt", 3, "1 2 3 nan 0 0 0 1"),
            FormatError,
            "{}/groundtruth.txt: line 3: there is a number that is not finite",
        ),
        (
            line_of("groundtruth.txt", 3, "1 2 3 4 0 0 0 0"),
            FormatError,
            "{}/groundtruth.txt: line 3: the quaternion is zero",
        ),
        (
            content_of("groundtruth.txt", b"5 1 2 3 0 0 0 1\n6 1 2 3 0 0 0 1\n"),
            FormatError,
            "{}: no frame has a pose: depth images reach from 1600000000.250 to 1600000000.550 s, "
            "poses from 5.000 to 6.000 s; if their clocks differ by a few seconds, give "
            "--time-offset; by more, convert the stamps of the poses",
        ),
        (
            picture_of("depth/*", np.zeros((24, 32), np.uint8)),
            FormatError,
            f"{{}}/depth/{D0}.png: expected a depth image of 16 bits, found a picture of mode L "
            "(8 bits)",
        ),
        (
            tiff_of("depth/*", np.full((24, 32), 1.5, np.float32)),
            FormatError,
            f"{{}}/depth/{D0}.png: expected a depth image of 16 bits, found a picture of "
            "floating-point numbers",
        ),
        (
            tiff_of("depth/*", np.full((24, 32), 70_000, np.int32)),
            FormatError,
            f"{{}}/depth/{D0}.png: expected a depth image of 16 bits, found numbers from 70000 to "
            "70000",
        ),
        (
            pgm_of("depth/*", 10_000),
            FormatError,
            f"{{}}/depth/{D0}.png: a depth image in PGM must be binary with a largest value of "
            "65535: by another one its numbers are scaled",
        ),
        (
            picture_of("rgb/*", np.zeros((12, 16, 3), np.uint8)),
            FormatError,
            f"{{}}/rgb/{C0}.png: the picture has 16 x 12 pixels, but the depth image (color must "
            "be registered to depth) has 32 x 24",
        ),
        (
            picture_of("rgb/*", np.zeros((24, 32), np.uint16)),
            FormatError,
            f"{{}}/rgb/{C0}.png: expected a color picture of 8 bits, found mode I;16",
        ),
        (
            content_of("rgb/*", b"GIF but not really"),
            FormatError,
            f"{{}}/rgb/{C0}.png: this is not a picture that can be read",
        ),
        (
            content_of("rgb/*", None),
            FormatError,
            f"{{}}/rgb/{C0}.png: the picture is damaged: image file is truncated",
        ),
        (
            content_of("depth/*", None),
            FormatError,
            f"{{}}/depth/{D0}.png: the picture is damaged: image file is truncated",
        ),
    ],
)
def test_broken_folders_are_errors_that_name_file_and_line(
    folder: Path, change: Callable[[Path], None], kind: type[HypermapError], message: str
) -> None:
    change(folder)
    with pytest.raises(kind) as caught:
        _ = [frame.color for frame in opened(folder).frames()]
    assert str(caught.value).startswith(message.replace("{}", str(folder)))
    if "/depth/" not in message and "/rgb/" not in message:  # what is wrong before any picture
        info = opened(folder).info()
        assert str(caught.value) in info.missing
        assert info.frames == 0


@pytest.mark.parametrize("name", ["/dev/zero", "rgb/" + "1" * 300 + ".png", "rgb", "."])
@pytest.mark.parametrize("line", [1, 2])
def test_a_list_may_name_what_is_no_picture_and_costs_its_frame_alone(
    folder: Path, name: str, line: int
) -> None:
    stamp = (folder / "rgb.txt").read_text().splitlines()[line - 1].split()[0]
    line_of("rgb.txt", line, f"{stamp} {name}")(folder)
    for number, frame in enumerate(opened(folder).frames(), start=1):
        if number == line:
            with pytest.raises(HypermapError, match=r"no such file|not a regular file|too long"):
                _ = frame.color
        else:
            assert frame.color is not None
    assert "1 of 4 color images are missing" in " ".join(opened(folder).info().notes)


@pytest.mark.parametrize("kind", ["depth", "rgb"])
def test_info_tells_of_images_that_are_missing(folder: Path, kind: str) -> None:
    name = "depth" if kind == "depth" else "color"
    paths = sorted(folder.glob(f"{kind}/*"))
    first = paths[0]
    first.unlink()
    info = opened(folder).info()
    assert info.missing == ()
    assert f"1 of 4 {name} images are missing, the first is {first}" in info.notes
    for path in paths[1:]:
        path.unlink()
    expected = f"{folder}: 4 of 4 {name} images are missing, the first is {first}"
    assert opened(folder).info().missing == (expected,)


def test_frames_that_cannot_be_read_are_reported_where_somebody_listens(folder: Path) -> None:
    first, second, third, _ = sorted(folder.glob("depth/*"))
    first.unlink()
    second.write_bytes(second.read_bytes()[:-50])
    Image.fromarray(np.ones((12, 16), np.uint16)).save(third)
    reported: list[tuple[float, str]] = []
    frames = list(opened(folder).frames(lambda stamp, error: reported.append((stamp, str(error)))))
    assert [frame.stamp for frame in frames] == pytest.approx([SHOTS[3].stamp / 1e9])
    assert [stamp for stamp, _ in reported] == pytest.approx(
        [shot.stamp / 1e9 for shot in SHOTS[:3]]
    )
    for (_, message), path in zip(reported, (first, second, third), strict=True):
        assert message.startswith(f"{path}: ")


def test_info_tells_all_that_is_wrong_at_once(folder: Path) -> None:
    for name in ("rgb.txt", "groundtruth.txt"):
        (folder / name).unlink()
    line_of("depth.txt", 1, "1 2 3\nx")(folder)
    info = opened(folder).info()
    assert info.missing == (
        "rgb.txt is missing: without color images no objects can be detected",
        f"{folder}/depth.txt: line 2: expected a stamp and a file name, found 'x'",
        NO_POSES.format(folder),
    )
    assert [(s.name, s.count) for s in info.streams] == [("depth.txt", 5)]


def test_images_of_unknown_shape_need_intrinsics(tmp_path: Path) -> None:
    wide = [
        Shot(s.stamp, s.color_stamp, s.depth_mm[:10], s.color[:10], s.position, s.quat_xyzw)
        for s in SHOTS
    ]
    folder = write_tum(tmp_path / "wide", wide)
    recording = opened(folder, intrinsics=None)
    message = (
        f"{folder}: the images have 32 x 10 pixels, for which no intrinsics are known; "
        "give them with --intrinsics"
    )
    assert recording.info().missing == (message,)
    with pytest.raises(FormatError) as caught:
        next(recording.frames())
    assert str(caught.value) == message


def test_a_picture_that_claims_too_many_pixels_is_refused(folder: Path) -> None:
    path = min(folder.glob("rgb/*"))
    content = bytearray(path.read_bytes())
    content[16:24] = (100_000).to_bytes(4, "big") * 2  # width and height
    content[29:33] = zlib.crc32(bytes(content[12:29])).to_bytes(4, "big")
    path.write_bytes(content)
    with pytest.raises(FormatError, match="the picture is damaged: Image size"):
        _ = next(opened(folder).frames()).color


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


def test_a_list_of_color_images_by_another_name_is_told(folder: Path) -> None:
    (folder / "rgb.txt").rename(folder / "color.txt")
    (missing,) = opened(folder).info().missing
    assert missing.endswith("; color.txt is not read: name it rgb.txt")
