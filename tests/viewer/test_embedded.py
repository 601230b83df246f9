"""What a page without a server holds: pictures and shapes, by place and by color."""

from __future__ import annotations

import base64
import io
import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from hypermap.core.frames import Pose2D
from hypermap.core.grid import GridGeometry
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.testing import occupancy_from_text, square
from hypermap.viewer.live.embedded_raster import EmbeddedRaster, embed_raster
from hypermap.viewer.live.embedded_shapes import embed_shapes

BASE = Pose2D()
ROOM = """
###?
#..?
####
"""


def said_at(raster: EmbeddedRaster, x: float, y: float) -> dict[str, object] | None:
    """Return what the pixel under a point of the base frame says, as the page finds it."""
    x0, _, _, y1 = raster.bounds
    row, col = math.floor((y1 - y) / raster.resolution), math.floor((x - x0) / raster.resolution)
    height, width = raster.rgba.shape[:2]
    if not (0 <= row < height and 0 <= col < width):
        return None
    return raster.says.get(raster.rgba[row, col].tobytes().hex())


def embedded(layer: OccupancyLayer, pose: Pose2D = BASE, **options: int) -> EmbeddedRaster:
    raster = embed_raster(layer, pose, **options)
    assert raster is not None
    return raster


@given(
    st.integers(0, 2**32 - 1),
    st.integers(1, 12),
    st.integers(1, 12),
    st.builds(Pose2D, st.floats(-50, 50), st.floats(-50, 50)),
    st.builds(Pose2D, st.floats(-50, 50), st.floats(-50, 50)),
)
def test_every_cell_says_what_the_layer_says(
    seed: int, width: int, height: int, origin: Pose2D, pose: Pose2D
) -> None:
    grid = GridGeometry(width, height, 0.25, origin)
    cells = np.random.default_rng(seed).integers(-1, 101, grid.shape)
    layer = OccupancyLayer("occupancy", "map", grid, cells)
    raster = embedded(layer, pose)
    centers = grid.centers(*np.mgrid[0:height, 0:width].reshape(2, -1))
    labels, values = layer.label_at(centers), layer.value_at(centers)
    for point, label, value in zip(pose.apply(centers), labels, values, strict=True):
        assert said_at(raster, *point) == {"label": label, "value": value}


def test_a_turned_grid_says_the_same_away_from_the_edges_of_cells() -> None:
    layer = occupancy_from_text(ROOM, 1.0, Pose2D(1, 2, 0.7))
    pose = Pose2D(-4, 1, 0.4)
    raster = embedded(layer, pose)
    assert raster.resolution == 0.5
    assert layer.grid is not None
    for row in range(3):
        for col in range(4):
            center = layer.grid.centers([row], [col])
            assert layer.cells is not None
            said = said_at(raster, *pose.apply(center)[0])
            assert said is not None
            assert said["value"] == layer.cells[row, col]
    assert raster.rgba[0, 0, 3] == 0  # the corner of the box around it


def test_a_large_grid_is_reduced_and_thin_walls_stay() -> None:
    cells = np.zeros((100, 130), dtype=np.int8)
    cells[:, 64] = 100
    cells[90:] = -1
    layer = OccupancyLayer("occupancy", "map", GridGeometry(130, 100, 0.1), cells)
    raster = embedded(layer, max_pixels=2000)
    assert raster.reduced_by == 3
    assert raster.resolution == pytest.approx(0.3)
    assert raster.rgba.shape[0] * raster.rgba.shape[1] <= 2000
    wall, floor, unknown = (said_at(raster, x, y) for x, y in ((6.4, 5), (2, 5), (2, 9.5)))
    assert [said and said["label"] for said in (wall, floor, unknown)] == [
        "Occupied",
        "Free",
        "Unknown",
    ]
    assert embedded(layer).reduced_by == 1


def test_of_raw_values_with_one_color_the_commonest_is_said() -> None:
    cells = np.array([[255, 200, 200, 100]])
    layer = OccupancyLayer("occupancy", "map", GridGeometry(4, 1, 1.0), cells)
    assert said_at(embedded(layer), 0.5, 0.5) == {"label": "Unknown", "value": 200}


def test_the_picture_in_the_page_is_the_array() -> None:
    raster = embedded(occupancy_from_text(ROOM))
    with Image.open(io.BytesIO(base64.b64decode(raster.as_json()["png"]))) as image:
        assert np.array_equal(np.asarray(image), raster.rgba)


def test_an_empty_layer_and_one_of_shapes_have_no_picture() -> None:
    assert embed_raster(OccupancyLayer("occupancy", "map"), Pose2D()) is None
    assert embed_raster(SemanticLayer("semantic", "map", [square("cup", 0, 0)]), Pose2D()) is None
    assert embed_shapes(OccupancyLayer("occupancy", "map"), Pose2D()) is None


def test_shapes_stand_in_the_base_frame_with_all_that_is_known() -> None:
    ring = shapely.Polygon([(0, 0), (4, 0), (4, 4), (0, 4)], [[(1, 1), (1, 3), (3, 3), (3, 1)]])
    things = [
        SemanticObject("desk", ring, id=7, tags=("table",), confidence=(0.5,), existence=3.0),
        SemanticObject("cup", shapely.box(0, 0, 1, 1), attributes={"colour": "red", 3: None}),
    ]
    shapes = embed_shapes(SemanticLayer("semantic", "lab", things), Pose2D(10, 0, math.pi / 2))
    assert shapes is not None
    desk, cup = shapes
    assert (desk["id"], desk["name"], desk["area"]) == (7, "desk", 12.0)
    assert desk["attributes"] == {"existence": 3.0, "tags": ["table"], "confidence": [0.5]}
    assert desk["centroid"] == pytest.approx([8, 2])
    drawn = shapely.Polygon(desk["polygons"][0][0], desk["polygons"][0][1:])
    assert shapely.Polygon(ring).area - drawn.area == pytest.approx(0)
    assert drawn.covers(shapely.Point(desk["at"]))  # not in the hole
    assert cup["id"] == 8
    assert cup["attributes"] == {"colour": "red", "3": None}


def test_a_bow_tie_is_drawn_as_the_two_halves_that_it_answers_for() -> None:
    tie = SemanticObject("tie", shapely.Polygon([(0, 0), (2, 2), (2, 0), (0, 2)]))
    shapes = embed_shapes(SemanticLayer("semantic", "map", [tie]), Pose2D())
    assert shapes is not None
    assert len(shapes[0]["polygons"]) == 2
    assert shapes[0]["area"] == pytest.approx(2)
