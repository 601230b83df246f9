from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray
from PIL import Image

from hypermap.colors import class_colors
from hypermap.core.errors import FileMissing, HypermapError, LayerNotFound
from hypermap.core.frames import FrameTree, Pose2D, Transform
from hypermap.core.grid import GridGeometry
from hypermap.core.hypermap import Hypermap
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.core.value_layer import ValueLayer
from hypermap.formats import open_map
from hypermap.viewer.picture import compose, render

SVG = "{http://www.w3.org/2000/svg}"
FREE, OCCUPIED = (255, 255, 255), (104, 112, 126)


def room(yaw: float = 0.0) -> Hypermap:
    """A floor of 4 x 2 m whose left half is blocked, with a chair on the right half."""
    cells = np.zeros((20, 40), dtype=np.int8)
    cells[:, :20] = 100
    grid = GridGeometry(width=40, height=20, resolution=0.1)
    occupancy = OccupancyLayer("occupancy", "floor", grid, cells)
    chair = SemanticObject("chair", shapely.box(2.5, 0.5, 3.5, 1.5))
    frames = FrameTree([Transform("map", "floor", Pose2D(yaw=yaw))])
    return Hypermap([SemanticLayer("none", "map"), occupancy, objects(chair)], frames)


def objects(*things: SemanticObject) -> SemanticLayer:
    return SemanticLayer("semantic", "floor", things)


def pixels(path: Path) -> NDArray[np.uint8]:
    with Image.open(path) as image:
        return np.asarray(image.convert("RGB"))


def bounds_of(image: NDArray[np.uint8], color: tuple[int, int, int]) -> tuple[int, int, int, int]:
    """Return left, top, right, bottom of the pixels that are about of a color."""
    near = (np.abs(image.astype(int) - color) <= 3).all(axis=2)
    rows, cols = np.nonzero(near)
    return cols.min(), rows.min(), cols.max(), rows.max()


def chair_color() -> tuple[int, int, int]:
    """The chair's color as it looks over white."""
    mixed = 255 * (0.55 * np.array(class_colors(["chair"])["chair"]) + 0.45)
    red, green, blue = mixed.round().astype(int)
    return red, green, blue


def test_cells_and_shapes_lie_where_the_map_says(tmp_path):
    render(room(), tmp_path / "room.png", labels=False, size=880)
    image = pixels(tmp_path / "room.png")[:, :980]  # without the legend
    left, top, right, bottom = bounds_of(image, OCCUPIED)
    scale = 880 / 4.4  # pixels per meter: the margin is 0.2 m on each side
    assert right - left == pytest.approx(2 * scale, abs=2)
    assert bottom - top == pytest.approx(2 * scale, abs=2)
    chair = bounds_of(image, chair_color())
    expected = (left + 2.5 * scale, top + 0.5 * scale, left + 3.5 * scale, top + 1.5 * scale)
    assert chair == pytest.approx(expected, abs=3)


@pytest.mark.parametrize("turned", [False, True])
def test_contours_lie_where_the_value_is_round(tmp_path, turned):
    yaw = math.pi / 2 if turned else 0.0
    values = np.tile(np.arange(0.05, 4.0, 0.1), (20, 1))  # the value is the layer's x
    layer = ValueLayer("distance", "floor", GridGeometry(40, 20, 0.1), values, "m", 2)
    frames = FrameTree([Transform("map", "floor", Pose2D(yaw=yaw))])
    hypermap = Hypermap([SemanticLayer("none", "map"), layer], frames)
    for name in ("plain", "lines"):
        render(hypermap, tmp_path / f"{name}.png", contours=name == "lines", size=880)
    drawn = (pixels(tmp_path / "plain.png") != pixels(tmp_path / "lines.png")).any(axis=2)
    counts = drawn.sum(axis=1 if turned else 0)
    # The frame is 84 pixels from the left and 92 from the top, with a margin of 0.2 m.
    scale = 880 / 4.4
    meters = np.arange(0.5, 4, 0.5)
    at = 92 + (4.2 - meters) * scale if turned else 84 + (0.2 + meters) * scale
    lines = np.flatnonzero(counts > 250)
    assert {min(range(7), key=lambda i: abs(at[i] - line)) for line in lines} == set(range(7))
    assert all(min(abs(x - line) for x in at) <= 2 for line in lines)

    render(hypermap, tmp_path / "lines.svg", contours=True)
    texts = [node.text for node in ET.parse(tmp_path / "lines.svg").iter(f"{SVG}text")]
    assert {"0.5 m", "3.5 m"} <= set(texts)


def test_lines_of_a_very_fine_grid_are_drawn_of_fewer_cells(monkeypatch):
    monkeypatch.setattr("hypermap.viewer.picture._MOST_CONTOURED", 200)
    values = np.arange(800.0).reshape(20, 40)
    layer = ValueLayer("distance", "map", GridGeometry(40, 20, 0.1), values)
    (drawn,) = compose(Hypermap([layer]), contours=True).contours
    assert drawn.values.shape == (10, 20)
    np.testing.assert_array_equal(layer.value_at(drawn.points_xy.reshape(-1, 2)), drawn.values.flat)


@pytest.mark.parametrize("values", [[[7.0, 7.0], [7.0, 7.0]], [[1.0, 2.0]], [[math.nan] * 2] * 2])
def test_a_field_without_a_slope_has_no_contours(tmp_path, values):
    grid = GridGeometry(2, len(values), 1.0)
    layers = [OccupancyLayer("occupancy", "map", grid, np.zeros(grid.shape, np.int8))]
    hypermap = Hypermap([*layers, ValueLayer("warmth", "map", grid, values, "K")])
    for name in ("plain", "lines"):
        render(hypermap, tmp_path / f"{name}.png", contours=name == "lines", size=300)
    assert (tmp_path / "plain.png").read_bytes() == (tmp_path / "lines.png").read_bytes()


def test_a_turned_layer_is_drawn_turned_in_the_base_frame(tmp_path):
    render(room(yaw=math.pi / 2), tmp_path / "room.png", labels=False, size=880)
    image = pixels(tmp_path / "room.png")
    # Blocked on the left becomes blocked at the bottom, and the chair is above it.
    left, top, right, bottom = bounds_of(image[:, :560], OCCUPIED)
    assert right - left == pytest.approx(400, abs=2)
    assert bottom - top == pytest.approx(400, abs=2)
    assert bounds_of(image[:, :560], chair_color())[3] < top


def test_an_object_on_blocked_cells_keeps_about_its_color(tmp_path):
    chair = SemanticObject("chair", shapely.box(0, 0, 2, 2))
    hypermap = Hypermap([room()["occupancy"], objects(chair)])
    render(hypermap, tmp_path / "room.png", labels=False, size=400)
    image = pixels(tmp_path / "room.png").astype(int)
    center = image[image.shape[0] // 2, 84 + 100]
    assert np.abs(center - chair_color()).max() < 40


def test_the_same_map_gives_the_same_bytes(tmp_path):
    for suffix in ("png", "svg"):
        files = [tmp_path / f"{i}.{suffix}" for i in range(2)]
        for file in files:
            render(room(), file, title="room")
        first, second = (file.read_bytes() for file in files)
        assert first == second


def test_an_svg_holds_title_names_and_legend_as_text(tmp_path):
    names = ["chair", "a $5 <cup> & saucer", "line\nbreak\x00"]
    things = [SemanticObject(n, shapely.box(i, 0, i + 0.9, 0.9)) for i, n in enumerate(names)]
    hypermap = Hypermap([SemanticLayer("semantic", "map", things)])
    render(hypermap, tmp_path / "x.svg", title="My <room>")
    texts = ["".join(t.itertext()) for t in ET.parse(tmp_path / "x.svg").iter(f"{SVG}text")]
    assert texts.count("chair") == 2  # at the object and in the legend
    assert texts.count("a $5 <cup> & saucer") == 2
    assert texts.count("line break") == 2
    assert "My <room>" in texts
    assert "3 objects of 3 classes, frame map" in texts
    assert any(re.fullmatch(r"50 cm|\d m", text) for text in texts)


def test_the_svg_keeps_the_grid_cell_by_cell(tmp_path):
    import base64
    import io

    render(room(), tmp_path / "x.svg")
    [image] = ET.parse(tmp_path / "x.svg").iter(f"{SVG}image")
    href = image.get("{http://www.w3.org/1999/xlink}href")
    assert href is not None
    with Image.open(io.BytesIO(base64.b64decode(href.partition(",")[2]))) as cells:
        assert cells.size == (40, 20)


def test_labels_may_be_left_out(tmp_path):
    render(room(), tmp_path / "x.svg", labels=False)
    texts = ["".join(t.itertext()) for t in ET.parse(tmp_path / "x.svg").iter(f"{SVG}text")]
    assert texts.count("chair") == 1


def test_only_what_is_known_is_in_view_unless_all_is_asked_for():
    cells = np.full((100, 100), -1, dtype=np.int8)
    cells[40:60, 40:60] = 0
    cells[50, 60:90] = 0  # a single ray through a door
    layer = OccupancyLayer("occupancy", "map", GridGeometry(100, 100, 0.1), cells)
    near = SemanticLayer("semantic", "map", [SemanticObject("chair", shapely.box(6, 5, 7, 6))])
    hypermap = Hypermap([layer, near])
    margin = 0.2
    assert compose(hypermap).view == pytest.approx((4 - margin, 4 - margin, 7 + margin, 6 + margin))
    assert compose(hypermap, full=True).view == pytest.approx((-0.3, -0.3, 10.3, 10.3))
    area = shapely.box(1, 1, 3, 2)
    assert compose(hypermap, area=area).view == pytest.approx((0.8, 0.8, 3.2, 2.2))


@pytest.mark.parametrize("area", [shapely.box(1e19, 0, 1e19 + 2, 2), shapely.Polygon()])
def test_an_area_that_is_empty_or_far_away_is_refused(area: shapely.Polygon):
    with pytest.raises(HypermapError, match="the area to draw is farther away than"):
        compose(room(), area=area)


def test_the_layers_and_classes_that_are_drawn_can_be_chosen():
    things = [SemanticObject(n, shapely.box(i, 0, i + 1, 1)) for i, n in enumerate("abca")]
    hypermap = Hypermap([room()["occupancy"], SemanticLayer("semantic", "floor", things)])
    drawing = compose(hypermap, layers=["semantic"], names=["a", "c"])
    assert not drawing.rasters
    assert sorted(drawing.shapes[0].names) == ["a", "a", "c"]
    assert drawing.colors == compose(hypermap).colors
    assert drawing.subtitle == "3 objects of 2 classes, frame floor"
    rooms = SemanticLayer("rooms", "floor", [SemanticObject("hall", shapely.box(0, 0, 5, 5))])
    drawing = compose(Hypermap([*hypermap, rooms]))
    assert drawing.subtitle == "4 objects of 3 classes, 1 room, frame floor"


def test_small_objects_are_drawn_over_large_ones():
    cup = SemanticObject("cup", shapely.box(1, 1, 1.1, 1.1))
    table = SemanticObject("table", shapely.box(0, 0, 2, 2))
    [part] = compose(Hypermap([objects(cup, table)])).shapes
    assert list(part.names) == ["table", "cup"]


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"path": "x.gif"}, HypermapError, "x.gif: a picture is saved as .png or .svg"),
        ({"path": "no/x.png"}, FileMissing, "there is no such folder"),
        ({"layers": ["rooms"]}, LayerNotFound, "there is no layer 'rooms'"),
        ({"names": ["chiar"]}, HypermapError, "no object is called 'chiar'; did you mean 'chair'?"),
        ({"layers": ["none"]}, HypermapError, "there is nothing to draw"),
        (
            {"area": shapely.box(90, 90, 95.5, 95)},
            HypermapError,
            "there is nothing to draw in 90,90,95.5,95: what is drawn lies in ",
        ),
    ],
)
def test_what_cannot_be_drawn_is_said_so(tmp_path, arguments, error, message):
    path = tmp_path / arguments.pop("path", "x.png")
    with pytest.raises(error) as raised:
        render(room(), path, **arguments)
    assert message in str(raised.value)
    assert not path.exists()


@pytest.mark.parametrize(
    "shape",
    [
        shapely.box(0, 0, 3, 3) - shapely.box(1, 1, 2, 2),
        shapely.MultiPolygon([shapely.box(0, 0, 1, 1), shapely.box(2, 0, 3, 1)]),
        shapely.Polygon([(0, 0), (2, 2), (2, 0), (0, 2)]),
        shapely.Polygon([(0, 0), (2, 0), (2, 0), (0, 0)]),
    ],
    ids=["a hole", "two parts", "a crossing outline", "no area"],
)
def test_odd_shapes_are_drawn(tmp_path, shape):
    hypermap = Hypermap([SemanticLayer("semantic", "map", [SemanticObject("chair", shape)])])
    render(hypermap, tmp_path / "x.png", size=200, labels=False)
    image = pixels(tmp_path / "x.png")[:, :300]
    near = (np.abs(image.astype(int) - chair_color()) <= 3).all(axis=2)
    assert near.sum() > 20


def test_a_hole_shows_the_ground(tmp_path):
    shape = shapely.box(0, 0, 3, 3) - shapely.box(1, 1, 2, 2)
    hypermap = Hypermap([SemanticLayer("semantic", "map", [SemanticObject("chair", shape)])])
    render(hypermap, tmp_path / "x.png", size=340, labels=False)
    image = pixels(tmp_path / "x.png")
    left, top, right, bottom = bounds_of(image[:, :430], chair_color())
    assert tuple(image[(top + bottom) // 2, (left + right) // 2]) == (255, 255, 255)


def test_many_classes_have_room_in_the_legend(tmp_path):
    things = [SemanticObject(f"thing {i}", shapely.box(i, 0, i + 1, 1)) for i in range(150)]
    render(Hypermap([SemanticLayer("semantic", "map", things)]), tmp_path / "x.svg", size=600)
    texts = ["".join(t.itertext()) for t in ET.parse(tmp_path / "x.svg").iter(f"{SVG}text")]
    assert any(re.fullmatch(r"and \d+ more", text) for text in texts)


@pytest.mark.parametrize("name", ["lab", "floor", "office", "example"])
def test_the_real_maps_are_drawn(shared_data, tmp_path, name):
    hypermap = open_map(shared_data / "maps" / f"{name}.hmap")
    render(hypermap, tmp_path / "x.png", title=name, size=700)
    image = pixels(tmp_path / "x.png")
    assert 700 <= max(image.shape[:2]) <= 1100
    assert len(np.unique(image.reshape(-1, 3), axis=0)) > 20
