from __future__ import annotations

import contextlib
import io
import os
import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst
from PIL import Image

from hypermap.core.errors import FileMissing, FormatError, HypermapError
from hypermap.core.frames import Pose2D
from hypermap.core.grid import GridGeometry
from hypermap.core.hypermap import Hypermap
from hypermap.core.occupancy import OccupancyLayer
from hypermap.formats import limits, save_map
from hypermap.formats.grid import pictures
from hypermap.formats.grid.map_server import PLUGIN, load_occupancy
from hypermap.formats.grid.pictures import decode_gray
from hypermap.formats.store import MemoryStore

YAML = """\
image: map.png
resolution: 0.05
origin: [-1.0, 2.0, 0.5]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.196
"""


def picture(pixels: Any, mode: str | None = None, kind: str = "PNG", **options: Any) -> bytes:
    image = Image.fromarray(np.asarray(pixels, dtype=np.uint8))
    file = io.BytesIO()
    (image.convert(mode) if mode else image).save(file, kind, **options)
    return file.getvalue()


def load(image: bytes, yaml: str = YAML) -> OccupancyLayer:
    store = MemoryStore({"map.yaml": yaml.encode(), "map.png": image}, where="t.hmap")
    return PLUGIN.load(store, "map", "occupancy", "map", {})


def cells(image: bytes, yaml: str = YAML) -> list[list[int]]:
    layer = load(image, yaml)
    assert layer.cells is not None
    return layer.cells.tolist()  # type: ignore[no-any-return]


def mode(name: str, yaml: str = YAML) -> str:
    return f"{yaml}mode: {name}\n"


# How the map_server table reads, worked out by hand for gray values around the thresholds:
# p = (255 - c) / 255 is 0.651 for c = 89, 0.647 for 90, 0.196 for 205 and 0.192 for 206.
GRAYS = [[0, 89, 90, 205, 206, 255]]
TRINARY = [[100, 100, -1, -1, 0, 0]]


@pytest.mark.parametrize(
    ("yaml", "expected"),
    [
        (YAML, TRINARY),
        (mode("trinary"), TRINARY),
        # 100 * (p - 0.196) / 0.454: for c = 90 99.36, for c = 205 0.017
        (mode("scale"), [[100, 100, 99, 0, 0, 0]]),
        (mode("raw"), GRAYS),
        # negated: c = 255, 166, 165, 50, 49, 0, so p = 0, 0.349, 0.353, 0.804, 0.808, 1
        (YAML.replace("negate: 0", "negate: 1"), [[0, -1, -1, 100, 100, 100]]),
        (mode("raw", YAML.replace("negate: 0", "negate: true")), [[255, 166, 165, 50, 49, 0]]),
        (YAML.replace("0.65", "5.0e-1").replace("0.196", "1e-1"), [[100, 100, 100, -1, -1, 0]]),
    ],
)
def test_gray_values_become_cells_as_map_server_says(yaml: str, expected: list[list[int]]) -> None:
    assert cells(picture(GRAYS), yaml) == expected


def test_the_scale_is_linear_to_100_and_not_to_99() -> None:
    yaml = mode("scale", YAML.replace("0.65", "1").replace("0.196", "0"))
    grays = np.arange(256)[np.newaxis]
    expected = [[round(100 * (255 - c) / 255) for c in range(256)]]
    assert cells(picture(grays), yaml) == expected


def test_the_top_of_a_picture_is_the_far_end_of_the_map() -> None:
    layer = load(picture([[0, 0, 255], [255, 255, 255]]))
    assert layer.grid == GridGeometry(3, 2, 0.05, Pose2D(-1.0, 2.0, 0.5))
    assert layer.cells is not None
    assert layer.cells.tolist() == [[0, 0, 0], [100, 100, 0]]
    assert layer.cells.dtype == np.int8


@pytest.mark.parametrize("name", ["trinary", "scale", "raw"])
def test_what_is_not_fully_opaque_is_unknown(name: str) -> None:
    gray_alpha = np.array([[[0, 255], [0, 254], [0, 0], [255, 255]]])
    free = 255 if name == "raw" else 0
    occupied = 0 if name == "raw" else 100
    assert cells(picture(gray_alpha), mode(name)) == [[occupied, -1, -1, free]]


def rgb(*colors: tuple[int, int, int]) -> list[list[tuple[int, int, int]]]:
    return [list(colors)]


@pytest.mark.parametrize(
    ("image", "expected"),
    [
        # the mean of the channels, not a luminance: 255 / 3 = 85, (255 + 13) / 3 = 89.3
        (picture(rgb((255, 0, 0), (0, 0, 255), (255, 13, 0))), [[85, 85, 89]]),
        (picture(rgb((255, 0, 0), (0, 0, 0)), "P"), [[85, 0]]),
        (picture([[[9, 9, 9, 255], [9, 9, 9, 200]]]), [[9, -1]]),
        (picture([[7, 8]], "P", transparency=8), [[7, -1]]),
        (picture([[7, 8]], transparency=8), [[7, -1]]),
        (picture([[0, 255]], "1"), [[0, 255]]),
        (picture([[7, 8]], "LA"), [[7, 8]]),
        (picture([[7, 8]], kind="BMP"), [[7, 8]]),
        (picture([[7, 8]], kind="TGA"), [[7, 8]]),
        (picture([[7, 8]], kind="GIF"), [[7, 8]]),
        (picture([[7, 8]], kind="TIFF"), [[7, 8]]),
        (picture([[7, 8]], kind="PPM"), [[7, 8]]),
        (picture([[200] * 8] * 8, kind="JPEG"), [[200] * 8] * 8),
        (b"P2\n# by hand\n2 2\n255\n1 2\n3 4\n", [[3, 4], [1, 2]]),
        (b"P5\n2 1\n255\n\x01\xff", [[1, 255]]),
        (b"P5\n2 1\n100\n\x32\x64", [[128, 255]]),  # white is 100
        (b"P5\n2 1\n65535\n\x80\x80\xff\xff", [[128, 255]]),  # 16 bits
        (b"P1\n2 1\n1 0\n", [[0, 255]]),
    ],
)
def test_pictures_of_every_kind_give_their_mean_gray(
    image: bytes, expected: list[list[int]]
) -> None:
    assert cells(image, mode("raw")) == expected


def test_a_picture_of_16_bits_keeps_its_precision_at_the_thresholds() -> None:
    # p of 22950 is exactly (65535 - 22950) / 65535 = 0.64980, of 22930 0.65011
    values = np.array([[22930, 22950]], dtype=np.uint16)
    file = io.BytesIO()
    Image.fromarray(values).save(file, "PNG")
    assert cells(file.getvalue()) == [[100, -1]]


def png_of(width: int, height: int) -> bytes:
    """The start of a PNG that claims a size."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return (
            struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        )

    head = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", b"") + chunk(b"IEND", b"")


def test_a_warning_names_unknown_cells_that_the_threshold_makes_free(
    caplog: pytest.LogCaptureFixture,
) -> None:
    saved_by_nav2 = YAML.replace("0.196", "0.25")
    for image in (picture([[0, 205, 205, 254]]), picture([[0, 205, 205, 254]], mode="RGB")):
        caplog.clear()
        assert cells(image, saved_by_nav2) == [[100, 0, 0, 0]]  # as map_server reads it
        assert caplog.messages == [
            "t.hmap/map.png: 2 cells with the gray 205 are free, because free_thresh is 0.25; "
            "map_saver writes unknown cells with this gray; if they are unknown, set free_thresh "
            "to 0.196"
        ]
    caplog.clear()
    load(picture([[0, 204, 206, 254]]), saved_by_nav2)  # nobody's unknown
    load(picture([[0, 205]]))
    load(picture([[0, 205]]), mode("raw", saved_by_nav2))
    assert not caplog.messages


def test_a_warning_says_what_a_yaw_in_degrees_is_in_radians(
    caplog: pytest.LogCaptureFixture,
) -> None:
    for yaw, count in (("6.28", 0), ("-90", 1)):
        load(picture([[0, 254]]), YAML.replace("-1.0, 2.0, 0.5", f"1, 2, {yaw}"))
        assert len(caplog.messages) == count
    assert caplog.messages[0].endswith("if these are degrees, set it to -1.5708")


@pytest.mark.parametrize(
    ("image", "message"),
    [
        (b"", "t.hmap/map.png: is not a picture"),
        (b"hello, this is no picture at all", "t.hmap/map.png: is not a picture"),
        (
            picture(np.random.default_rng(0).integers(0, 255, (64, 64)))[:2000],
            "t.hmap/map.png: is not an intact picture: image file is truncated",
        ),
        (
            png_of(100_000, 100_000),
            "t.hmap/map.png: has too many cells: Image size (10000000000 pixels) exceeds limit",
        ),
        (
            png_of(12_000, 12_000),
            "t.hmap/map.png: has 12000 x 12000 cells (144 MB in memory), more than the 134,217,728 "
            "that are allowed",
        ),
        (png_of(0, 5), "t.hmap/map.png: is not a picture"),
        (b"P5\n3 1\n255\nab", "t.hmap/map.png: is not an intact picture: "),
        (b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\n", "t.hmap/map.png: is not a picture"),
    ],
)
def test_a_broken_or_huge_picture_is_one_clear_error(image: bytes, message: str) -> None:
    with pytest.raises(FormatError) as error:
        load(image)
    assert str(error.value).startswith(message)


def test_a_picture_of_floating_point_numbers_is_refused() -> None:
    file = io.BytesIO()
    Image.fromarray(np.zeros((2, 2), np.float32)).save(file, "TIFF")
    with pytest.raises(FormatError, match="floating point numbers, not of gray values"):
        load(file.getvalue())


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("image: map.png\n", "", "image: is required, but missing"),
        ("image: map.png", "image: other.png", "there is no such file, only map.yaml, map.png"),
        ("image: map.png", "image: ../map.png", "the file name '../map.png' is not allowed"),
        ("image: map.png", "image: /etc/map.png", "the file name '/etc/map.png' is not allowed"),
        ("0.05", "0", "resolution: input should be greater than or equal to 0.000001, found 0"),
        ("0.05", "-1", "resolution: input should be greater than or equal to 0.000001, found -1"),
        ("0.05", "1e7", "resolution: input should be less than or equal to 1000000, found '1e7'"),
        ("-1.0, 2.0, 0.5", "-1e10, 0, 0", "origin[0]: input should be greater than or equal to"),
        ("0.05", ".nan", "resolution: input should be a finite number, found nan"),
        ("0.05", ".inf", "resolution: input should be a finite number, found inf"),
        ("0.05", "fine", "resolution: input should be a valid number, unable to parse string"),
        ("origin: [-1.0, 2.0, 0.5]\n", "", "origin: is required, but missing"),
        ("2.0, 0.5]", "2.0]", "origin[2]: is required, but missing"),
        ("2.0, 0.5]", "2.0, 0, 0.5]", "origin: at most 3 values are expected, found 4"),
        ("2.0, 0.5]", ".nan, 0.5]", "origin[1]: input should be a finite number, found nan"),
        ("negate: 0", "negate: 7", "negate: input should be a valid boolean"),
        ("resolution: 0.05\n", "", "resolution: is required, but missing"),
        ("0.65", "1.5", "occupied_thresh: input should be less than or equal to 1, found 1.5"),
        ("0.65", ".nan", "occupied_thresh: input should be "),
        ("0.196", "-0.1", "free_thresh: input should be greater than or equal to 0, found -0.1"),
        ("0.65", "0.1", "t.hmap/map.yaml: free_thresh (0.196) must be below occupied_thresh"),
        (
            "negate: 0",
            "negate: 0\nmode: color",
            "mode: input should be 'trinary', 'scale' or",
        ),
        ("negate: 0", "negate: 0\nnegate: 1", "line 5: the key 'negate' appears twice"),
        ("image: map.png", "image: 'map.png", "t.hmap/map.yaml: is not valid YAML: "),
    ],
)
def test_a_wrong_key_is_named_with_its_value(old: str, new: str, message: str) -> None:
    assert old in YAML
    with pytest.raises(FormatError) as error:
        load(picture(GRAYS), YAML.replace(old, new))
    assert message in str(error.value)
    assert str(error.value).startswith("t.hmap")


def test_a_picture_in_the_place_of_its_yaml_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "office.PNG"
    path.write_bytes(b"\x89PNG\r\n\x1a\n")
    with pytest.raises(FormatError, match=r"office\.PNG: is a picture; give the map_server YAML"):
        load_occupancy(path)


def test_a_yaml_file_that_is_a_list_is_refused() -> None:
    with pytest.raises(FormatError) as error:
        load(picture(GRAYS), "- image: map.png\n")
    assert str(error.value) == "t.hmap/map.yaml: expected keys and values, found a list"


def test_thresholds_may_be_equal_where_nothing_is_scaled_between_them() -> None:
    equal = YAML.replace("0.65", "0.5").replace("0.196", "0.5")
    assert cells(picture([[0, 255]]), equal) == [[100, 0]]
    with pytest.raises(FormatError, match="must be below"):
        load(picture([[0, 255]]), mode("scale", equal))


def saved(layer: OccupancyLayer) -> MemoryStore:
    store = MemoryStore()
    PLUGIN.save(layer, store, "map")
    return store


def reloaded(layer: OccupancyLayer) -> OccupancyLayer:
    return PLUGIN.load(saved(layer), "map", layer.name, layer.frame_id, layer.settings)


numbers = st.floats(-1e6, 1e6, allow_nan=False)


@given(
    shape=npst.array_shapes(min_dims=2, max_dims=2, min_side=1, max_side=9),
    highest=st.sampled_from([0, 100, 127, 255]),
    resolution=st.floats(1e-6, 1e3),
    origin=st.builds(Pose2D, numbers, numbers, st.floats(-4, 4)),
    data=st.data(),
)
def test_saving_and_loading_gives_exactly_the_same_map(
    shape: tuple[int, int], highest: int, resolution: float, origin: Pose2D, data: st.DataObject
) -> None:
    values = data.draw(npst.arrays(np.int16, shape, elements=st.integers(-1, highest)))
    grid = GridGeometry(shape[1], shape[0], resolution, origin)
    again = reloaded(OccupancyLayer("occupancy", "map", grid, values))
    assert again.grid == grid
    assert again.cells is not None
    assert (again.cells == values).all()


def test_every_value_survives_in_the_mode_scale() -> None:
    values = np.arange(-1, 101, dtype=np.int8)[np.newaxis]
    layer = OccupancyLayer("occupancy", "map", GridGeometry(102, 1, 0.05), values)
    files = saved(layer).files
    assert files["map.yaml"].decode() == (
        "image: map.png\nresolution: 0.05\norigin: [0.0, 0.0, 0.0]\nnegate: 0\n"
        "occupied_thresh: 1\nfree_thresh: 0\nmode: scale\n"
    )
    image = Image.open(io.BytesIO(files["map.png"]))
    assert image.mode == "LA"
    assert [image.getpixel((col, 0)) for col in (0, 1, 101)] == [(205, 0), (255, 255), (0, 255)]
    again = reloaded(layer).cells
    assert again is not None
    assert again.dtype == np.int8
    assert (again == values).all()


def test_a_raw_map_keeps_values_to_255_and_old_readers_find_unknown_cells() -> None:
    values = np.arange(-1, 256, dtype=np.int16)[np.newaxis]
    layer = OccupancyLayer("occupancy", "map", GridGeometry(257, 1, 0.05), values)
    files = saved(layer).files
    assert b"mode: raw" in files["map.yaml"]
    grays = np.asarray(Image.open(io.BytesIO(files["map.png"])))[0, :, 0]
    # The first program casts the gray value to a signed byte, whatever the alpha.
    old_reader = grays.astype(np.int8)
    assert (old_reader == values[0].astype(np.int8)).all()
    again = reloaded(layer).cells
    assert again is not None
    assert again.dtype == np.int16
    assert (again == values).all()


def test_the_limit_on_cells_is_told_and_can_be_raised(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(limits, "MAX_CELLS", 10)
    content = picture(np.zeros((3, 4)))
    monkeypatch.delenv("HYPERMAP_MAX_CELLS", raising=False)
    with pytest.raises(FormatError, match=r"set HYPERMAP_MAX_CELLS=12 in the environment"):
        load(content)
    monkeypatch.setenv("HYPERMAP_MAX_CELLS", "12")
    assert np.shape(load(content).cells) == (3, 4)
    heavy = picture(np.zeros((3, 4)), kind="WEBP", lossless=True)
    with pytest.raises(FormatError, match=r"more than the 3 that .* HYPERMAP_MAX_CELLS=48"):
        load(heavy)
    monkeypatch.setenv("HYPERMAP_MAX_CELLS", "48")
    assert np.shape(load(heavy).cells) == (3, 4)
    monkeypatch.setenv("HYPERMAP_MAX_CELLS", "many")
    with pytest.raises(HypermapError, match="'many' in the environment must be a whole number"):
        load(content)


def test_a_grid_that_could_not_be_opened_again_is_not_saved_unless_allowed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(limits, "MAX_CELLS", 10)
    layer = OccupancyLayer("big", "map", GridGeometry(4, 3, 0.05), np.zeros((3, 4), np.int8))
    with pytest.raises(HypermapError, match=r"'big' has 12 cells, .* set HYPERMAP_MAX_CELLS=12"):
        saved(layer)
    monkeypatch.setenv("HYPERMAP_MAX_CELLS", "12")
    assert saved(layer).files


def test_a_picture_is_the_same_in_bands(monkeypatch: pytest.MonkeyPatch) -> None:
    shades = np.random.default_rng(0).integers(0, 255, (7, 5, 4)).astype(np.uint8)
    for mode in ("L", "LA", "RGB", "RGBA", "P", "I;16"):
        content = io.BytesIO()
        made = Image.fromarray(shades[..., 0].astype(np.uint16) if mode == "I;16" else shades)
        (made if mode == "I;16" else made.convert(mode)).save(content, "PNG")
        [whole] = decode_gray(content.getvalue(), "map.png")
        with monkeypatch.context() as patched:
            patched.setattr(pictures, "_BAND_PIXELS", 10)
            bands = list(decode_gray(content.getvalue(), "map.png"))
        assert [band.top for band in bands] == [0, 2, 4, 6]
        assert {(band.white, band.height) for band in bands} == {(whole.white, 7)}
        assert (np.concatenate([band.values for band in bands]) == whole.values).all()
        opaque = [band.opaque for band in bands if band.opaque is not None]
        assert len(opaque) == (0 if whole.opaque is None else 4)
        if whole.opaque is not None:
            assert (np.concatenate(opaque) == whole.opaque).all()


def test_the_first_row_of_a_picture_of_several_bands_is_the_top_of_the_map(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(pictures, "_BAND_PIXELS", 4)
    image = picture([[0, 0], [255, 0], [255, 255], [0, 255], [255, 255]])
    assert cells(image) == [[0, 0], [100, 0], [0, 0], [0, 100], [100, 100]]


def test_a_layer_without_cells_writes_nothing() -> None:
    assert saved(PLUGIN.empty("occupancy", "map", {})).files == {}


def test_a_picture_in_a_folder_lies_beside_its_yaml() -> None:
    files = {"maps/map.yaml": YAML.encode(), "maps/map.png": picture([[0, 255]])}
    layer = PLUGIN.load(MemoryStore(files), "maps/map", "occupancy", "map", {})
    again = MemoryStore()
    PLUGIN.save(layer, again, "maps/map")
    assert list(again.files) == ["maps/map.yaml", "maps/map.png"]
    assert b"image: map.png" in again.files["maps/map.yaml"]


def test_a_bare_map_opens_from_the_disk_wherever_its_picture_lies(tmp_path: Path) -> None:
    (tmp_path / "pictures").mkdir()
    image = tmp_path / "pictures" / "floor.png"
    image.write_bytes(picture([[0, 255]]))
    (tmp_path / "maps").mkdir()
    yaml = tmp_path / "maps" / "floor.yaml"
    for place in (str(image), "../pictures/floor.png"):
        yaml.write_text(YAML.replace("map.png", place))
        layer = load_occupancy(yaml, name="floor", frame_id="odom")
        assert (layer.name, layer.frame_id) == ("floor", "odom")
        assert layer.cells is not None
        assert layer.cells.tolist() == [[100, 0]]
        assert layer.settings["file"] == "floor"


@pytest.mark.parametrize("image", ["/home/robot/maps/floor.png", "src/maps/floor.png"])
def test_a_map_that_names_a_folder_of_its_robot_opens_with_the_picture_beside_it(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, image: str
) -> None:
    yaml = tmp_path / "floor.yaml"
    yaml.write_text(YAML.replace("map.png", image))
    with pytest.raises(FormatError, match=f"there is no picture .*{image}"):
        load_occupancy(yaml)
    beside = tmp_path / "floor.png"
    beside.write_bytes(picture([[0, 255]]))
    layer = load_occupancy(yaml)
    assert layer.cells is not None
    assert layer.cells.tolist() == [[100, 0]]
    assert caplog.messages == [
        f"{yaml}: image: there is no {image}; {beside} is taken, which lies here"
    ]


def test_a_whole_hypermap_in_place_of_a_bare_map_is_refused_with_the_remedy(tmp_path: Path) -> None:
    path = tmp_path / "office.hmap"
    layer = OccupancyLayer("occupancy", "map", GridGeometry(1, 1, 0.05), np.zeros((1, 1), np.int8))
    save_map(Hypermap([layer]), path)
    with pytest.raises(FormatError, match=r"is an archive.* --layer occupancy"):
        load_occupancy(path)


def test_thresholds_that_are_missing_are_those_of_map_saver(
    caplog: pytest.LogCaptureFixture,
) -> None:
    without = YAML.replace("occupied_thresh: 0.65\n", "").replace("free_thresh: 0.196\n", "")
    assert cells(picture(GRAYS), without) == TRINARY
    assert caplog.messages == [
        f"t.hmap/map.png: its YAML file has no {key}; taken as {value}, as in maps of map_saver"
        for key, value in (("occupied_thresh", 0.65), ("free_thresh", 0.196))
    ]


def test_a_bare_map_that_is_missing_or_lacks_its_picture_says_so(tmp_path: Path) -> None:
    yaml = tmp_path / "floor.yaml"
    with pytest.raises(FileMissing) as missing:
        load_occupancy(yaml)
    assert str(missing.value) == f"{yaml}: there is no such file"
    yaml.write_text(YAML)
    with pytest.raises(FormatError) as error:
        load_occupancy(yaml)
    assert str(error.value) == f"{yaml}: image: there is no picture {tmp_path / 'map.png'}"
    (tmp_path / "floor.pgm").touch()
    with pytest.raises(FormatError, match=r"there is no picture .*map\.png; there is floor\.pgm$"):
        load_occupancy(yaml)
    yaml.write_text(YAML.replace("map.png", "."))
    with pytest.raises(FormatError) as not_a_picture:
        load_occupancy(yaml)
    assert str(not_a_picture.value) == f"{yaml}: image: {tmp_path}: is a folder, not a file"
    yaml.write_text(YAML.replace("map.png", "x" * 300))  # a name that no file can have
    with pytest.raises(HypermapError, match="xx: cannot be read: File name too long"):
        load_occupancy(yaml)
    with pytest.raises(FormatError) as folder:
        load_occupancy(tmp_path)
    assert str(folder.value) == f"{tmp_path}: is a folder, not a file"
    os.mkfifo(tmp_path / "pipe.yaml")
    with pytest.raises(FormatError) as pipe:
        load_occupancy(tmp_path / "pipe.yaml")
    assert str(pipe.value) == f"{tmp_path / 'pipe.yaml'}: is not a regular file"


@given(st.data())
def test_damage_to_a_picture_never_gives_another_error(data: st.DataObject) -> None:
    kind = data.draw(st.sampled_from(["PNG", "BMP", "TGA", "GIF", "TIFF", "PPM", "JPEG", "PCX"]))
    content = bytearray(picture(np.arange(64).reshape(8, 8), kind=kind))
    for _ in range(data.draw(st.integers(1, 6))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    end = data.draw(st.integers(0, len(content)))
    with contextlib.suppress(FormatError):
        load(bytes(content[:end] if end % 3 else content))
