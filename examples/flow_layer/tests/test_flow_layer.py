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
from PIL import Image

from flow_layer import PLUGIN, FlowLayer
from hypermap.core.errors import FormatError
from hypermap.core.frames import FrameTree, Pose2D, Transform
from hypermap.core.grid import GridGeometry
from hypermap.core.hypermap import Hypermap
from hypermap.formats import open_map, save_map
from hypermap.formats.store import MemoryStore
from hypermap.testing import occupancy_from_text
from hypermap.testing.contract import LayerContract

NAN = math.nan
GRID = GridGeometry(width=3, height=2, resolution=1.0)


def flow() -> FlowLayer:
    return FlowLayer("people", "map", GRID, np.radians([(0, 90, 180), (0, NAN, -135)]))


class TestContract(LayerContract):
    """The laws that hold for every layer."""

    class_name = "FlowLayer"

    @pytest.fixture
    def layer(self) -> FlowLayer:
        rows, cols = np.mgrid[0:6, 0:8]
        cells = -3 + 0.5 * rows + 0.25 * cols
        cells[2, 3] = NAN
        cells[0, 0] = np.pi
        grid = GridGeometry(8, 6, 0.5, Pose2D(-8.0, -20.8, 0.3))
        return FlowLayer("people", "map", grid, cells, settings={"enable_update": True})


@pytest.mark.parametrize(
    ("point", "degrees"),
    [((0.1, 0.9), 0), ((1.5, 0.5), 90), ((2.99, 1.01), -135), ((1.5, 1.5), NAN), ((3.0, 0.5), NAN)],
)
def test_a_point_has_the_heading_of_its_cell(point: Any, degrees: float) -> None:
    np.testing.assert_allclose(np.degrees(flow().value_at(point)), [degrees], rtol=1e-6)


@pytest.mark.parametrize(
    ("given", "label"),
    [(44.6, "45°"), (225, "-135°"), (-180, "180°"), (720.2, "0°"), (-0.4, "0°"), (NAN, "Unknown")],
)
def test_a_label_is_the_heading_in_whole_degrees(given: float, label: str) -> None:
    layer = FlowLayer("x", "map", GridGeometry(1, 1, 1.0), np.radians([[given]]))
    assert layer.label_at([[0.5, 0.5], [5, 5]]).tolist() == [label, "Unknown"]


@pytest.mark.parametrize(
    ("what", "places"),
    [
        ("90°", [(1.5, 0.5)]),
        (math.pi / 2, [(1.5, 0.5)]),
        ("0°", [(0.5, 0.5), (0.5, 1.5)]),
        ("Unknown", [(1.5, 1.5)]),
        (NAN, []),
        ("90", []),
    ],
)
def test_cells_are_found_by_label_or_exact_heading(what: Any, places: Any) -> None:
    assert list(map(tuple, flow().find(what).tolist())) == places


def test_steps_are_summed_by_the_cells_where_they_begin() -> None:
    begins = [(0.5, 0.5), (0.5, 0.5), (1.5, 0.5), (1.5, 0.5), (9, 9)]
    ends = [(1.5, 0.5), (0.5, 1.5), (2.5, 0.5), (0.5, 0.5), (9, 10)]
    layer = FlowLayer.of_steps("people", "map", GRID, begins, ends)
    # East and north make north-east; there and back again make nothing.
    assert layer.label_at([[0.5, 0.5], [1.5, 0.5]]).tolist() == ["45°", "Unknown"]
    assert layer.summary() == "directions in 1 cells"


def test_close_directions_have_close_colors_all_around() -> None:
    grid = GridGeometry(360, 1, 1.0)
    picture = FlowLayer("x", "map", grid, np.radians([range(360)])).picture()
    assert picture is not None
    colors = picture.rgba[0, :, :3].astype(int)
    steps = np.abs(colors - np.roll(colors, 1, axis=0)).sum(axis=1)
    assert 0 < steps.min() <= steps.max() < 10
    assert list(picture.legend) == ["0°", "90°", "180°", "-90°"]
    on_white = 255 - (255 - colors[90]) * 170 / 255
    np.testing.assert_allclose(picture.legend["90°"], on_white, atol=1)


def test_the_picture_leaves_out_what_is_unknown() -> None:
    picture = flow().picture()
    assert picture is not None
    assert (picture.rgba[..., 3] > 0).tolist() == [[True, True, True], [True, False, True]]


@pytest.mark.parametrize(
    ("grid", "cells", "message"),
    [
        (GRID, None, "layer 'x': give both a grid and its cells, or neither"),
        (None, [[1.0]], "layer 'x': give both a grid and its cells, or neither"),
        (GRID, [[1.0]], "cells must have shape (2, 3), got (1, 1)"),
        (GRID, np.full((2, 3), np.inf), "cells must be finite, or NaN where unknown"),
    ],
)
def test_what_is_no_grid_of_headings_is_refused(grid: Any, cells: Any, message: str) -> None:
    with pytest.raises(ValueError) as caught:
        FlowLayer("x", "map", grid, cells)
    assert str(caught.value) == message


def npy(array: Any, **options: Any) -> bytes:
    content = io.BytesIO()
    np.save(content, array, **options)
    return content.getvalue()


def saved() -> dict[str, bytes]:
    store = MemoryStore()
    PLUGIN.save(flow(), store, "people")
    return store.files


NO_NUMBERS = (
    "m.hmap/people.npy: is no .npy file of rows and columns of float32, as numpy.save writes them"
)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("people.npy", None, "m.hmap/people.npy: there is no such file"),
        ("people.yaml", None, "m.hmap/people.yaml: there is no such file"),
        ("people.npy", b"", NO_NUMBERS),
        ("people.npy", npy(np.zeros((2, 3))), NO_NUMBERS),
        ("people.npy", npy(np.zeros(3, np.float32)), NO_NUMBERS),
        ("people.npy", npy(np.zeros((0, 3), np.float32)), NO_NUMBERS),
        ("people.npy", npy(np.zeros((2, 3), np.float32, order="F")), NO_NUMBERS),
        ("people.npy", npy(np.array([[print]]), allow_pickle=True), NO_NUMBERS),
        ("people.npy", npy(np.zeros((2, 3), np.float32))[:-4],
         "m.hmap/people.npy: its 20 bytes are not 2 x 3 numbers"),
        ("people.npy", npy(np.zeros((2, 3), np.float32)).replace(b"(2, 3), }" + 10 * b" ",
                                                                 b"(2, 9999999999), }"),
         NO_NUMBERS),
        ("people.npy", npy(np.zeros((2, 3), np.float32)).replace(b"(2, 3), }      ",
                                                                 b"(2, 3999999), }"),
         "m.hmap/people.npy: its 24 bytes are not 2 x 3999999 numbers"),
        ("people.npy", npy(np.full((2, 3), 3.2, np.float32)),
         "m.hmap/people.npy: holds headings that are not from -pi to pi"),
        ("people.yaml", b"- 1", "m.hmap/people.yaml: expected keys and values"),
        ("people.yaml", b"origin: [0, 0, 0]",
         "m.hmap/people.yaml: resolution: expected a number, found None"),
        ("people.yaml", b"{origin: [0, 0], resolution: 1}",
         "m.hmap/people.yaml: origin: expected 3 numbers, found [0, 0]"),
        ("people.yaml", b"{origin: [0, 0, .nan], resolution: 1}",
         "m.hmap/people.yaml: origin: expected 3 numbers, found [0, 0, nan]"),
        ("people.yaml", b"{origin: [0, 0, 0], resolution: 0}",
         "m.hmap/people.yaml: resolution must be from 1e-06 to 1e+06 m, got 0.0"),
        ("people.yaml", b"{origin: [0, 0, 0], resolution: true}",
         "m.hmap/people.yaml: resolution: expected a number, found True"),
    ],
)  # fmt: skip
def test_a_broken_file_gives_one_clear_error(name: str, content: Any, message: str) -> None:
    files = {**saved(), name: content}
    store = MemoryStore({k: v for k, v in files.items() if v is not None}, "m.hmap")
    with pytest.raises(FormatError) as caught:
        PLUGIN.load(store, "people", "people", "map", {})
    assert str(caught.value).startswith(message)


def test_a_map_with_the_layer_is_saved_opened_and_asked_in_other_frames(tmp_path: Path) -> None:
    frames = FrameTree([Transform("map", "lab", Pose2D(10.0, 0.0, math.pi / 2))])
    layer = FlowLayer("people", "lab", GRID, flow().cells)
    save_map(Hypermap([occupancy_from_text("#."), layer], frames), tmp_path / "m.hmap")
    again = open_map(tmp_path / "m.hmap")
    # (1.5, 0.5) in the lab is (9.5, 1.5) in the map.
    assert again.label_at("people", [[9.5, 1.5], [1.5, 0.5]]).tolist() == ["90°", "Unknown"]
    assert again.label_at("people", [1.5, 0.5], "lab").tolist() == ["90°"]
    np.testing.assert_allclose(again.find("people", "90°"), [(9.5, 1.5)])
    (hit,) = again.nearest("180°", [9.5, 1.5], layer="people")
    assert hit.distance == pytest.approx(1)


def test_without_the_plug_in_a_map_keeps_the_layers_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    save_map(Hypermap([occupancy_from_text("#."), flow()]), tmp_path / "first.hmap")
    with monkeypatch.context() as elsewhere:
        elsewhere.setattr("importlib.metadata.entry_points", lambda **_: [])
        opaque = open_map(tmp_path / "first.hmap")
        assert not isinstance(opaque["people"], FlowLayer)
        save_map(opaque, tmp_path / "second.hmap")
    assert (tmp_path / "first.hmap").read_bytes() == (tmp_path / "second.hmap").read_bytes()


def hypermap(*arguments: object) -> str:
    command = [sys.executable, "-m", "hypermap", *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_commands_know_the_layer(tmp_path: Path) -> None:
    path = tmp_path / "people.hmap"
    save_map(Hypermap([occupancy_from_text("#."), flow()]), path)
    assert "FlowLayer" in hypermap("info", path)
    answers = json.loads(hypermap("query", path, "--layer", "people", "--at", "1.5,0.5", "--json"))
    (answer,) = answers["answers"]
    assert answer["label"] == "90°"
    assert answer["value"] == pytest.approx(math.pi / 2)
    hypermap("render", path, "-o", tmp_path / "people.svg")
    assert "180°" in (tmp_path / "people.svg").read_text(encoding="utf-8")
    hypermap("convert", path, tmp_path / "people.tif", "--layer", "people")
    with Image.open(tmp_path / "people.tif") as picture:
        cells = np.degrees(np.asarray(picture)[::-1])
    np.testing.assert_allclose(cells, [[0, 90, 180], [0, NAN, -135]], atol=1e-4)
