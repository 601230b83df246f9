from __future__ import annotations

import io
import json
import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from PIL import Image

from hypermap.core.errors import FormatError
from hypermap.core.frames import FrameTree, Pose2D, Transform
from hypermap.core.grid import GridGeometry
from hypermap.core.hypermap import Hypermap
from hypermap.formats import open_map, save_map
from hypermap.formats.store import MemoryStore
from hypermap.testing import occupancy_from_text
from hypermap.testing.contract import LayerContract
from value_layer import PLUGIN, ValueLayer

NAN = math.nan
GRID = GridGeometry(width=3, height=2, resolution=1.0)


def warmth(cells: Any = ((20, 22, 24), (20, NAN, 28)), **others: Any) -> ValueLayer:
    return ValueLayer("warmth", "map", GRID, cells, unit="°C", **others)


class TestContract(LayerContract):
    """The laws that hold for every layer."""

    class_name = "ValueLayer"

    @pytest.fixture
    def layer(self) -> ValueLayer:
        rows, cols = np.mgrid[0:6, 0:8]
        cells = 18 + 0.5 * rows + 0.25 * cols
        cells[2, 3] = NAN
        grid = GridGeometry(8, 6, 0.5, Pose2D(-8.0, -20.8, 0.3))
        return ValueLayer("warmth", "map", grid, cells, unit="°C", settings={"enable_update": True})


@pytest.mark.parametrize(
    ("point", "value"),
    [
        ((0.5, 0.5), 20),  # at a center, its own number
        ((1.0, 0.5), 21),  # half way between two centers
        ((0.75, 0.5), 20.5),
        ((0.5, 1.0), 20),  # half way up
        ((2.5, 1.0), 26),
        ((0.1, 0.5), 20),  # beyond the outermost centers, the outermost cells go on
        ((2.99, 0.01), 24),
        ((0.0, 0.0), 20),
        ((1.0, 0.75), 20.8571428),  # (0.75 * 21 + 0.125 * 20) / 0.875, the unknown one left out
        ((1.5, 1.5), NAN),  # in the cell without a number
        ((3.0, 0.5), NAN),  # off the grid
        ((-0.01, 0.5), NAN),
        ((1e9, 1e9), NAN),
    ],
)
def test_numbers_are_interpolated_between_the_centres(point: Any, value: float) -> None:
    np.testing.assert_allclose(warmth().value_at(point), [value], rtol=1e-6)


def test_a_plane_is_interpolated_exactly() -> None:
    grid = GridGeometry(10, 8, 0.25, Pose2D(3.0, -1.0, 0.7))
    rows, cols = np.indices(grid.shape)
    layer = ValueLayer("plane", "map", grid, 5 + 2.0 * rows - 3.0 * cols)
    positions = np.random.default_rng(1).uniform((0.5, 0.5), (7.5, 9.5), (200, 2))
    points = grid.origin.apply(positions[:, ::-1] * grid.resolution)
    expected = 5 + 2.0 * (positions[:, 0] - 0.5) - 3.0 * (positions[:, 1] - 0.5)
    np.testing.assert_allclose(layer.value_at(points), expected, atol=1e-4)


@pytest.mark.parametrize(
    ("unit", "decimals", "label"),
    [("°C", 1, "21.5 °C"), ("dBm", 0, "21 dBm"), ("", 2, "21.46"), ("m/s", 3, "21.460 m/s")],
)
def test_a_label_is_the_rounded_number_with_its_unit(unit: str, decimals: int, label: str) -> None:
    layer = ValueLayer("x", "map", GridGeometry(1, 1, 1.0), [[21.46]], unit, decimals)
    assert layer.label_at([[0.5, 0.5], [5, 5]]).tolist() == [label, "Unknown"]


@pytest.mark.parametrize(
    ("what", "places"),
    [
        ("20.0 °C", [(0.5, 0.5), (0.5, 1.5)]),
        (20, [(0.5, 0.5), (0.5, 1.5)]),
        (28.0, [(2.5, 1.5)]),
        ("Unknown", [(1.5, 1.5)]),
        (NAN, []),
        (21, []),  # interpolated somewhere, but in no cell
        ("20 °C", []),
    ],
)
def test_cells_are_found_by_label_or_exact_number(what: Any, places: Any) -> None:
    assert list(map(tuple, warmth().find(what).tolist())) == places


def test_a_number_is_found_to_the_precision_of_float32() -> None:
    layer = warmth([[21.3, 0, 0], [0, 0, 0.1]])
    assert layer.find(21.3).tolist() == [[0.5, 0.5]]
    assert layer.find(0.1).tolist() == [[2.5, 1.5]]


def test_the_picture_runs_from_dark_to_bright_and_leaves_out_what_is_unknown() -> None:
    picture = warmth().picture()
    assert picture is not None
    brightness = picture.rgba[..., :3].sum(axis=2).tolist()
    assert brightness[0][0] == brightness[1][0] < brightness[0][1] < brightness[0][2]
    assert (picture.rgba[..., 3] > 0).tolist() == [[True, True, True], [True, False, True]]
    assert list(picture.legend) == ["28.0 °C", "26.0 °C", "24.0 °C", "22.0 °C", "20.0 °C"]
    for label, cell in (("20.0 °C", picture.rgba[0, 0]), ("28.0 °C", picture.rgba[1, 2])):
        *color, alpha = cell.astype(float)
        on_white = np.array(color) * alpha / 255 + 255 - alpha
        np.testing.assert_allclose(picture.legend[label], on_white, atol=1)


@pytest.mark.parametrize(
    ("cells", "legend"), [([[7, 7, 7], [7, 7, NAN]], ["7.0 °C"]), ([[NAN] * 3] * 2, [])]
)
def test_a_picture_of_one_number_or_none_has_a_short_legend(cells: Any, legend: Any) -> None:
    picture = warmth(cells).picture()
    assert picture is not None
    assert list(picture.legend) == legend


@pytest.mark.parametrize(
    ("grid", "cells", "message"),
    [
        (GRID, None, "layer 'x': give both a grid and its cells, or neither"),
        (None, [[1.0]], "layer 'x': give both a grid and its cells, or neither"),
        (GRID, [[1.0]], "cells must have shape (2, 3), got (1, 1)"),
        (GRID, np.full((2, 3), np.inf), "cells must be finite, or NaN where nothing is known"),
    ],
)
def test_what_is_no_grid_of_numbers_is_refused(grid: Any, cells: Any, message: str) -> None:
    with pytest.raises(ValueError) as caught:
        ValueLayer("x", "map", grid, cells)
    assert str(caught.value) == message


def npy(array: Any, **options: Any) -> bytes:
    content = io.BytesIO()
    np.save(content, array, **options)
    return content.getvalue()


def saved() -> dict[str, bytes]:
    store = MemoryStore()
    PLUGIN.save(warmth(), store, "warmth")
    return store.files


NO_NUMBERS = (
    "m.hmap/warmth.npy: is no .npy file of rows and columns of float32, as numpy.save writes them"
)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("warmth.npy", None, "m.hmap/warmth.npy: there is no such file"),
        ("warmth.yaml", None, "m.hmap/warmth.yaml: there is no such file"),
        ("warmth.npy", b"", NO_NUMBERS),
        ("warmth.npy", npy(np.zeros((2, 3))), NO_NUMBERS),
        ("warmth.npy", npy(np.zeros(3, np.float32)), NO_NUMBERS),
        ("warmth.npy", npy(np.zeros((0, 3), np.float32)), NO_NUMBERS),
        ("warmth.npy", npy(np.zeros((2, 3), np.float32, order="F")), NO_NUMBERS),
        ("warmth.npy", npy(np.array([[print]]), allow_pickle=True), NO_NUMBERS),
        ("warmth.npy", npy(np.zeros((2, 3), np.float32))[:-4],
         "m.hmap/warmth.npy: its 20 bytes are not 2 x 3 numbers"),
        ("warmth.npy", npy(np.zeros((2, 3), np.float32)).replace(b"(2, 3), }" + 10 * b" ",
                                                                 b"(2, 9999999999), }"),
         NO_NUMBERS),
        ("warmth.npy", npy(np.zeros((2, 3), np.float32)).replace(b"(2, 3), }      ",
                                                                 b"(2, 3999999), }"),
         "m.hmap/warmth.npy: its 24 bytes are not 2 x 3999999 numbers"),
        ("warmth.npy", npy(np.full((2, 3), np.inf, np.float32)),
         "m.hmap/warmth.npy: holds infinite numbers"),
        ("warmth.yaml", b"- 1", "m.hmap/warmth.yaml: expected keys and values"),
        ("warmth.yaml", b"origin: [0, 0, 0]",
         "m.hmap/warmth.yaml: resolution: expected a number, found None"),
        ("warmth.yaml", b"{origin: [0, 0], resolution: 1}",
         "m.hmap/warmth.yaml: origin: expected 3 numbers, found [0, 0]"),
        ("warmth.yaml", b"{origin: [0, 0, .nan], resolution: 1}",
         "m.hmap/warmth.yaml: origin: expected 3 numbers, found [0, 0, nan]"),
        ("warmth.yaml", b"{origin: [0, 0, 0], resolution: 0}",
         "m.hmap/warmth.yaml: resolution must be from 1e-06 to 1e+06 m, got 0.0"),
        ("warmth.yaml", b"{origin: [0, 0, 0], resolution: true}",
         "m.hmap/warmth.yaml: resolution: expected a number, found True"),
        ("warmth.yaml", b"{origin: [0, 0, 0], resolution: 1, unit: [C]}",
         "m.hmap/warmth.yaml: unit: expected text, found ['C']"),
        ("warmth.yaml", b"{origin: [0, 0, 0], resolution: 1, decimals: 99}",
         "m.hmap/warmth.yaml: decimals: expected a number from 0 to 9, found 99"),
    ],
)  # fmt: skip
def test_a_broken_file_gives_one_clear_error(name: str, content: Any, message: str) -> None:
    files = {**saved(), name: content}
    store = MemoryStore({k: v for k, v in files.items() if v is not None}, "m.hmap")
    with pytest.raises(FormatError) as caught:
        PLUGIN.load(store, "warmth", "warmth", "map", {})
    assert str(caught.value).startswith(message)


def test_unit_and_decimals_may_be_left_out() -> None:
    store = MemoryStore({**saved(), "warmth.yaml": b"{origin: [0, 0, 0], resolution: 1}"})
    layer = PLUGIN.load(store, "warmth", "warmth", "map", {})
    assert layer.label_at([0.5, 0.5]).tolist() == ["20.0"]


def test_a_map_with_the_layer_is_saved_opened_and_asked_in_other_frames(tmp_path: Path) -> None:
    frames = FrameTree([Transform("map", "lab", Pose2D(10.0, 0.0, math.pi / 2))])
    layer = ValueLayer("warmth", "lab", GRID, warmth().cells, "°C", 1)
    save_map(Hypermap([occupancy_from_text("#."), layer], frames), tmp_path / "m.hmap")
    again = open_map(tmp_path / "m.hmap")
    # (0.5, 0.5) in the lab is (9.5, 0.5) in the map.
    assert again.label_at("warmth", [[9.5, 0.5], [0.5, 0.5]]).tolist() == ["20.0 °C", "Unknown"]
    assert again.label_at("warmth", [0.5, 0.5], "lab").tolist() == ["20.0 °C"]
    np.testing.assert_allclose(again.find("warmth", 28), [(8.5, 2.5)])
    (hit,) = again.nearest("24.0 °C", [9.5, 0.5], layer="warmth")
    np.testing.assert_allclose(hit.point_xy, (9.5, 2.5))
    assert hit.distance == pytest.approx(2)
    hits = again.values_in("warmth", shapely.box(9, 0, 10, 3))
    assert hits.values.tolist() == [20, 22, 24]


def test_without_the_plug_in_a_map_keeps_the_layers_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    save_map(Hypermap([occupancy_from_text("#."), warmth()]), tmp_path / "first.hmap")
    with monkeypatch.context() as elsewhere:
        elsewhere.setattr("importlib.metadata.entry_points", lambda **_: [])
        opaque = open_map(tmp_path / "first.hmap")
        assert not isinstance(opaque["warmth"], ValueLayer)
        save_map(opaque, tmp_path / "second.hmap")
    assert (tmp_path / "first.hmap").read_bytes() == (tmp_path / "second.hmap").read_bytes()


def hypermap(*arguments: object) -> str:
    command = [sys.executable, "-m", "hypermap", *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_commands_know_the_layer(tmp_path: Path) -> None:
    path = tmp_path / "warm.hmap"
    save_map(Hypermap([occupancy_from_text("#."), warmth()]), path)
    assert "ValueLayer" in hypermap("info", path)
    answers = json.loads(hypermap("query", path, "--layer", "warmth", "--at", "1,0.5", "--json"))
    (answer,) = answers["answers"]
    assert (answer["label"], answer["value"]) == ("21.0 °C", 21)
    found = json.loads(hypermap("query", path, "--layer", "warmth", "--name", "28.0 °C", "--json"))
    (place,) = found["answers"]
    assert (place["x"], place["y"]) == (2.5, 1.5)
    hypermap("render", path, "-o", tmp_path / "warm.svg")
    assert "28.0 °C" in (tmp_path / "warm.svg").read_text(encoding="utf-8")
    hypermap("convert", path, tmp_path / "warm.tif", "--layer", "warmth")
    with Image.open(tmp_path / "warm.tif") as picture:
        cells = np.asarray(picture)[::-1]
    assert np.array_equal(cells, [[20, 22, 24], [20, NAN, 28]], equal_nan=True)
