from __future__ import annotations

import copy
import math
import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from hypermap.core.frames import Pose2D
from hypermap.core.grid import GridGeometry
from hypermap.core.occupancy import OccupancyLayer
from hypermap.testing import occupancy_from_text
from hypermap.testing.strategies import areas, occupancy_layers, points

ROOM = occupancy_from_text(
    """
    ###?
    #..?
    ####
    """,
    resolution=0.5,
    origin=Pose2D(1.0, 2.0),
)
GRID = GridGeometry(3, 2, 1.0)
MIXED = OccupancyLayer("mixed", "map", GRID, np.array([[-1, 0, 57], [100, 99, 1]], dtype=np.int8))


@pytest.mark.parametrize(
    ("point", "label", "value"),
    [
        ((1.0, 2.0), "Occupied", 100),
        ((1.6, 2.6), "Free", 0),
        ((2.6, 3.0), "Unknown", -1),
        ((2.9, 2.1), "Occupied", 100),
        ((3.0, 2.1), "Unknown", -1),  # the right border belongs to the next cell
        ((0.98, 2.2), "Unknown", -1),  # 2 cm outside
        ((-1e9, 1e9), "Unknown", -1),
    ],
)
def test_a_point_reads_the_cell_around_it(point: Any, label: str, value: int) -> None:
    assert ROOM.label_at(point).tolist() == [label]
    assert ROOM.value_at(point).tolist() == [value]


def test_only_0_is_free_and_only_100_is_occupied() -> None:
    hits = MIXED.labels_in(MIXED.extent())
    assert hits.values.tolist() == ["Unknown", "Free", "Unknown", "Occupied", "Unknown", "Unknown"]
    assert MIXED.values_in(MIXED.extent()).values.tolist() == [-1, 0, 57, 100, 99, 1]
    assert MIXED.counts() == {"Free": 1, "Occupied": 1, "Unknown": 4}


@pytest.mark.parametrize(
    ("what", "places"),
    [
        ("Free", [(1.5, 0.5)]),
        ("Occupied", [(0.5, 1.5)]),
        ("Unknown", [(0.5, 0.5), (2.5, 0.5), (1.5, 1.5), (2.5, 1.5)]),
        (57, [(2.5, 0.5)]),
        (57.0, [(2.5, 0.5)]),
        (-1, [(0.5, 0.5)]),
        (0.5, []),
        (300, []),
        (math.nan, []),
        ("57", []),
        ("free", []),
    ],
)
def test_cells_are_found_by_label_or_value(what: Any, places: list[Any]) -> None:
    assert MIXED.find(what).tolist() == [list(place) for place in places]
    assert MIXED.find(what).shape == (len(places), 2)


def test_an_area_limits_the_search() -> None:
    assert MIXED.find("Unknown", shapely.box(0, 0, 2, 2)).tolist() == [[0.5, 0.5], [1.5, 1.5]]
    assert MIXED.find("Unknown", shapely.box(9, 9, 10, 10)).shape == (0, 2)


def test_places_are_in_the_layers_frame_on_turned_grids_too() -> None:
    turned = GridGeometry(3, 2, 1.0, Pose2D(10.0, 0.0, math.pi / 2))
    layer = OccupancyLayer("turned", "map", turned, MIXED.cells)
    np.testing.assert_allclose(layer.find("Free"), [[9.5, 1.5]])
    np.testing.assert_allclose(layer.find("Occupied", shapely.box(8, 0, 9, 1)), [[8.5, 0.5]])


def test_the_nearest_cells_come_by_rows_where_they_are_equally_near() -> None:
    places, distances = MIXED.nearest("Unknown", [1.5, 1.0], k=3)
    assert places.tolist() == [[1.5, 1.5], [0.5, 0.5], [2.5, 0.5]]
    np.testing.assert_allclose(distances, [0.5, math.hypot(1, 0.5), math.hypot(1, 0.5)])
    assert MIXED.nearest("Unknown", [1.5, 1.0])[0].tolist() == [[1.5, 1.5]]


@given(occupancy_layers(), points())
def test_a_point_answers_like_a_small_area_around_its_centre(layer, xy) -> None:
    values = layer.value_at(xy)
    assert layer.grid is not None
    for (row, col), value in zip(layer.grid.cells_at(xy), values, strict=True):
        (center,) = layer.grid.centers([row], [col])
        hits = layer.values_in(shapely.Point(center).buffer(layer.grid.resolution / 4))
        assert hits.values.tolist() == ([value] if layer.grid.contains(row, col) else [])


@given(occupancy_layers(), st.data())
def test_what_is_found_adds_up_to_what_is_there(layer: OccupancyLayer, data: Any) -> None:
    area = data.draw(areas(around=layer.extent()))
    hits = layer.labels_in(area)
    for label in ("Free", "Occupied", "Unknown"):
        expected = hits.points_xy[hits.values == label]
        np.testing.assert_array_equal(layer.find(label, area), expected)
        assert len(layer.find(label)) == layer.counts()[label]


def test_the_picture_shows_free_light_occupied_dark_and_unknown_transparent() -> None:
    picture = MIXED.picture()
    assert picture is not None
    (unknown, free, between), (occupied, nearly, hardly) = picture.rgba.astype(int)
    assert free[:3].sum() > hardly[:3].sum() > between[:3].sum() > nearly[:3].sum()
    assert nearly[:3].sum() >= occupied[:3].sum()
    assert unknown[3] == 0
    assert (picture.rgba[..., 3].ravel() == [0, 255, 255, 255, 255, 255]).all()
    assert tuple(free[:3]) == picture.legend["Free"]
    assert tuple(occupied[:3]) == picture.legend["Occupied"]


def test_raw_values_up_to_255_are_kept_and_drawn() -> None:
    raw = OccupancyLayer("raw", "map", GRID, np.array([[0, 100, 128], [254, 255, -1]], np.int16))
    assert raw.value_at([[1.5, 1.5]]).tolist() == [255]
    picture = raw.picture()
    assert picture is not None
    assert (picture.rgba[1, :2] == picture.rgba[0, 1]).all()  # as dark as occupied


@pytest.mark.parametrize(
    ("dtype", "kept"),
    [(np.int8, np.int8), (np.int16, np.int16), (np.int64, np.int8), (np.uint8, np.int8)],
)
def test_cells_take_a_byte_each_where_they_can(dtype: type, kept: type) -> None:
    layer = OccupancyLayer("o", "map", GRID, np.full((2, 3), 100, dtype=dtype))
    assert layer.cells is not None
    assert layer.cells.dtype == kept


def test_large_values_become_int16() -> None:
    layer = OccupancyLayer("o", "map", GRID, np.full((2, 3), 255, dtype=np.uint8))
    assert layer.cells is not None
    assert layer.cells.dtype == np.int16
    assert layer.value_at([0.5, 0.5]).tolist() == [255]


def test_the_layers_cells_cannot_be_written_but_the_callers_can() -> None:
    cells = np.zeros((2, 3), dtype=np.int8)
    layer = OccupancyLayer("o", "map", GRID, cells)
    assert layer.cells is not None
    with pytest.raises(ValueError, match="read-only"):
        layer.cells[0, 0] = 1
    cells[0, 0] = 1


@pytest.mark.parametrize(
    ("grid", "cells", "error", "message"),
    [
        (GRID, None, ValueError, "layer 'o': give both a grid and its cells, or neither"),
        (None, np.zeros((2, 3), np.int8), ValueError,
         "layer 'o': give both a grid and its cells, or neither"),
        (GRID, np.zeros((3, 2), np.int8), ValueError, "cells must have shape (2, 3), got (3, 2)"),
        (GRID, np.zeros(6, np.int8), ValueError, "cells must have shape (2, 3), got (6,)"),
        (GRID, np.zeros((2, 3)), TypeError,
         "cells must be integers (-1 unknown, 0 free .. 100 occupied) or bool, got float64"),
        (GRID, np.full((2, 3), -2), ValueError, "cells must be between -1 and 255 "
         "(-1 unknown, 0 free .. 100 occupied), one is -2"),
        (GRID, np.full((2, 3), 256), ValueError, "cells must be between -1 and 255 "
         "(-1 unknown, 0 free .. 100 occupied), one is 256"),
    ],
)  # fmt: skip
def test_what_are_no_cells_is_refused(
    grid: Any, cells: Any, error: type[Exception], message: str
) -> None:
    with pytest.raises(error) as caught:
        OccupancyLayer("o", "map", grid, cells)
    assert str(caught.value) == message


def test_of_bool_cells_those_that_are_true_are_occupied() -> None:
    layer = OccupancyLayer("o", "map", GRID, np.array([[True, False, False]] * 2))
    assert layer.cells is not None
    assert layer.cells.dtype == np.int8
    assert layer.cells.tolist() == [[100, 0, 0]] * 2


@pytest.mark.parametrize(
    "duplicate",
    [copy.copy, copy.deepcopy, lambda layer: pickle.loads(pickle.dumps(layer))],
    ids=["copy", "deepcopy", "pickle"],
)
def test_the_cells_of_a_copy_cannot_be_written_either(duplicate: Callable[[Any], Any]) -> None:
    layer = OccupancyLayer("o", "map", GRID, np.zeros((2, 3), dtype=np.int8))
    again = duplicate(layer)
    assert again.cells.tolist() == [[0, 0, 0]] * 2
    with pytest.raises(ValueError, match="read-only"):
        again.cells[0, 0] = 1


def test_a_layer_says_how_large_its_grid_is() -> None:
    grid = GridGeometry(width=3, height=2, resolution=0.05)
    layer = OccupancyLayer("floor", "lab", grid, np.zeros((2, 3), np.int8))
    assert repr(layer) == (
        "<OccupancyLayer 'floor' in frame 'lab': 3 x 2 cells of 0.05 m (0.15 x 0.1 m)>"
    )
    assert repr(OccupancyLayer("o", "map")) == "<OccupancyLayer 'o' in frame 'map': empty>"


def test_an_empty_layer_knows_nothing_anywhere() -> None:
    empty = OccupancyLayer("o", "map")
    assert empty.label_at([[0, 0], [1, 1]]).tolist() == ["Unknown", "Unknown"]
    assert empty.value_at([[0, 0]]).tolist() == [-1]
    assert len(empty.labels_in(shapely.box(0, 0, 1, 1))) == 0
    assert empty.find("Unknown").shape == empty.find(-1, shapely.box(0, 0, 1, 1)).shape == (0, 2)
    assert empty.counts() == {}
    assert empty.extent().is_empty
    assert empty.picture() is None


def test_a_whole_floor_is_searched_without_an_index_of_every_cell() -> None:
    import tracemalloc

    grid = GridGeometry(2000, 1500, 0.05)
    cells = np.zeros(grid.shape, dtype=np.int8)
    cells[700, 800] = 100
    tracemalloc.start()
    layer = OccupancyLayer("floor", "map", grid, cells)
    found = layer.find("Occupied"), layer.find("Occupied", layer.extent())
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert [len(places) for places in found] == [1, 1]
    assert peak < 4 * cells.nbytes
