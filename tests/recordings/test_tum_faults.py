"""What is wrong in folders of the TUM RGB-D format is told, with its file and line."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from hypermap.core.errors import FileMissing, FormatError, HypermapError

from .shots import SHOTS, Shot, write_tum
from .tum_tools import content_of, line_of, opened, pgm_of, picture_of, remove, tiff_of

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
            line_of("groundtruth.txt", 3, "1 2 3 inf 0 0 0 1"),
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


def test_a_list_of_color_images_by_another_name_is_told(folder: Path) -> None:
    (folder / "rgb.txt").rename(folder / "color.txt")
    (missing,) = opened(folder).info().missing
    assert missing.endswith("; color.txt is not read: name it rgb.txt")


def test_without_color_there_is_depth_and_info_says_what_is_missing(folder: Path) -> None:
    (folder / "rgb.txt").unlink()
    recording = opened(folder)
    assert [frame.color for frame in recording.frames()] == [None] * 4
    assert recording.info().missing == (
        "rgb.txt is missing: without color images no objects can be detected",
    )
