from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import shapely

from hypermap.core.arrays import as_objects
from hypermap.core.errors import AreaError
from hypermap.core.shapes import (
    as_area,
    box_of,
    can_be_corners,
    can_be_footprints,
    check_footprint,
    repaired,
    valid_copies,
)

BOW_TIE = "POLYGON((0 0, 2 2, 2 0, 0 2, 0 0))"


@pytest.mark.parametrize(
    ("wkt", "area", "dimension"),
    [
        (BOW_TIE, 2.0, 2),  # both halves
        ("POLYGON((0 0,4 0,4 4,1 4,1 1,3 1,3 3,0 3,0 0))", 15.0, 2),  # what is wound around twice
        ("MULTIPOLYGON(((0 0,2 0,2 2,0 2,0 0)),((1 1,3 1,3 3,1 3,1 1)))", 7.0, 2),  # once each
        ("POLYGON((0 0,4 0,4 4,0 4,0 0),(1 1,6 1,6 2,1 2,1 1))", 13.0, 2),  # a hole that sticks out
        ("POLYGON((0 0,1 0,2 0,0 0))", 0.0, 1),
        ("POLYGON((1 1,1 1,1 1,1 1))", 0.0, 0),
    ],
)
def test_a_repaired_shape_is_valid_and_holds_what_its_outline_winds_around(
    wkt: str, area: float, dimension: int
) -> None:
    shape = repaired(shapely.from_wkt(wkt))
    assert shape.is_valid
    assert not shape.is_empty
    assert shape.area == area
    assert shapely.get_dimensions(shape) == dimension


def test_only_invalid_shapes_are_replaced() -> None:
    good, bad = shapely.box(0, 0, 1, 1), shapely.from_wkt(BOW_TIE)
    given = as_objects([good, bad])
    valid = valid_copies(given)
    assert valid[0] is good
    assert valid[1].area == 2
    assert given[1] is bad
    alone = given[:1]
    assert valid_copies(alone) is alone


def test_shapes_beside_one_too_small_to_compute_with_are_repaired_to_the_last_digit() -> None:
    tiny = shapely.from_wkt(
        "POLYGON ((-3.455465665045885e-240 -4.814646484771862e-163, 3.780068949868091e-162 "
        "5.533130070571995e-183, 6.682429073782668e-225 -3.657606209172671e-213, "
        "-3.455465665045885e-240 -4.814646484771862e-163))"
    )
    bow_tie = shapely.transform(shapely.from_wkt(BOW_TIE), lambda xy: xy / 3)
    small, fine = valid_copies(as_objects([tiny, bow_tie]))
    assert small.is_valid
    assert repaired(tiny).equals(shapely.Point(0, 0))
    assert fine.equals_exact(repaired(bow_tie))


@pytest.mark.parametrize("turn", range(4))
@pytest.mark.parametrize("is_reversed", [False, True])
def test_a_box_is_known_as_one_whatever_corner_it_begins_with(turn: int, is_reversed: bool) -> None:
    corners = [(1, 2), (4, 2), (4, 7), (1, 7)]
    corners = corners[turn:] + corners[:turn]
    assert box_of(shapely.Polygon(corners[::-1] if is_reversed else corners)) == (1, 2, 4, 7)


@pytest.mark.parametrize(
    "area",
    [
        shapely.Point(1, 2),
        shapely.LineString(shapely.box(0, 0, 1, 1).exterior),
        shapely.MultiPoint(shapely.box(0, 0, 1, 1).exterior.coords),
        shapely.Polygon(),
        shapely.Polygon([(0, 0), (2, 0), (0, 2)]),
        shapely.Polygon([(0, 0), (2, 0), (2, 2), (1, 3), (0, 2)]),
        shapely.from_wkt(BOW_TIE),
        shapely.box(0, 0, 0, 3),
        shapely.box(0, 0, 3, 0),
        shapely.box(-2e9, 0, 1, 1),
        shapely.box(0, 0, 1, 2e9),
        shapely.box(0, 0, 9, 9) - shapely.box(1, 1, 2, 2),
    ],
)
def test_another_area_is_no_box(area: shapely.Geometry) -> None:
    assert box_of(area) is None


@pytest.mark.parametrize("turn", range(4))
@pytest.mark.parametrize("moved", range(4))
@pytest.mark.parametrize("by", [(0, 1), (1, 0), (0, -1), (-1, 0), (1, 1)])
def test_a_box_with_one_corner_moved_is_none(moved: int, by: tuple[int, int], turn: int) -> None:
    corners = np.array([(0, 0), (3, 0), (3, 3), (0, 3)])
    corners[moved] += by
    for ring in (np.roll(corners, turn, axis=0), np.roll(corners, turn, axis=0)[::-1]):
        assert box_of(shapely.Polygon(ring)) is None


def test_a_shape_whose_hole_is_as_large_as_itself_becomes_its_outline() -> None:
    ring = [(0, 0), (0, 1), (1, 0), (0, 0)]
    (valid,) = valid_copies(as_objects([shapely.Polygon(ring, [ring])]))
    assert valid.is_valid
    assert valid.equals(shapely.LineString(ring))


def test_areas_keep_all_their_corners_where_they_are_sound() -> None:
    for area in (shapely.box(0, 0, 1, 1), shapely.Polygon(), shapely.Point(1, 2)):
        assert as_area(area).equals_exact(area)


def test_areas_whose_outline_crosses_itself_are_repaired() -> None:
    area = as_area(shapely.from_wkt(BOW_TIE))
    assert area.is_valid
    assert area.area == 2


def test_what_is_no_geometry_is_no_area() -> None:
    with pytest.raises(TypeError, match="an area must be a shapely geometry, got list"):
        as_area([BOW_TIE])


@pytest.mark.parametrize("size", [1e12, 1e30, 1e60, 1e100])
@pytest.mark.parametrize(
    ("corners", "share"),  # of the square within 1e9 m
    [
        ([(0, 0), (1, 0), (1, 1)], 1 / 8),
        ([(0, 0), (1, 0), (0, 1)], 1 / 4),
        ([(1, 0.5), (1, -1), (0, 0), (-1, 0.5)], 9 / 16),
        ([(0.5, 1), (0.5, 0.5), (0, 0), (1, -1)], 1 / 4),
        ([(-1, 0.5), (-1, 0), (0.5, 0.5), (0, 0), (1, -1)], None),  # crosses itself
    ],
)
def test_areas_with_corners_very_far_away_can_be_asked_about(
    corners: list[tuple[float, float]], share: float | None, size: float
) -> None:
    area = as_area(shapely.Polygon(np.array(corners) * size))
    assert area.is_valid
    assert np.abs(area.bounds).max() <= 1e9
    if share is not None:
        assert area.area / 4e18 == pytest.approx(share)


def test_what_of_an_area_lies_beyond_all_maps_is_cut_off() -> None:
    assert as_area(shapely.box(-1e300, 0, 5, 1e300)).bounds == (-1e9, 0, 5, 1e9)


def test_an_area_without_area_that_reaches_beyond_all_maps_is_a_line() -> None:
    area = as_area(shapely.Polygon([(-1e20, 0), (2e20, 0), (1e20, 0)]))
    assert area.bounds == (-1e9, 0, 1e9, 0)
    assert shapely.get_dimensions(area) == 1


def test_an_area_that_cannot_be_repaired_is_refused() -> None:
    area = shapely.from_wkt(
        "POLYGON ((0 3e-100, 0 0, 1e100 5e29, 0 1e-160, -1 0, 0 3e-100), "
        "(-1e100 1e100, 5e99 0, 0 1e100, -2e30 -1e100, -1e9 1e30, -1e100 1e100))"
    )
    message = r"GEOS cannot follow the outline of an area with coordinates up to 1e\+100 m: "
    with pytest.raises(AreaError, match=message):
        as_area(area)


def polygon(*corners: Any) -> shapely.Polygon:
    with np.errstate(invalid="ignore"):
        return shapely.Polygon(corners)


@pytest.mark.parametrize(
    ("footprint", "error", "message"),
    [
        (None, TypeError, "a footprint must be a polygon or multipolygon, got NoneType"),
        (shapely.Point(), TypeError, "a footprint must be a polygon or multipolygon, got Point"),
        (shapely.Polygon(), ValueError, "a footprint must not be empty"),
        (shapely.from_wkt("POLYGON((0 0, 1 0, 1 1, 0 0), EMPTY)"), ValueError,
         "a hole of a footprint must have corners; leave out the empty hole"),
        (polygon((0, 0, 1), (1, 0, 1), (1, 1, 1)), ValueError,
         "a footprint is 2D; its points must have two coordinates"),
        (polygon((0, 0), (1, 0), (1, math.inf)), ValueError,
         "a footprint must be finite and within 1e+09 m, got inf"),
        (polygon((0, 0), (math.nan, 0), (1, 1)), ValueError,
         "a footprint must be finite and within 1e+09 m, got nan"),
        (polygon((0, 0), (-2e9, 0), (1, 1)), ValueError,
         "a footprint must be finite and within 1e+09 m, got 2000000000.0"),
    ],
)  # fmt: skip
def test_what_no_object_can_stand_on_is_refused(
    footprint: Any, error: type[Exception], message: str
) -> None:
    with pytest.raises(error) as caught:
        check_footprint(footprint)
    assert str(caught.value) == message


def test_a_footprint_may_cross_itself() -> None:
    check_footprint(shapely.from_wkt(BOW_TIE))


@pytest.mark.parametrize(
    ("points", "good"),
    [
        ([], True),
        ([(1e9, -1e9), (-1e9, 1e9)], True),
        ([(0, 0), (0, 1.1e9)], False),
        ([(-1.1e9, 0), (0, 0)], False),
        ([(0, math.nan), (0, 0)], False),
        ([(0, 0), (-math.inf, 0)], False),
    ],
)
def test_corners_lie_within_all_maps(points: list[tuple[float, float]], good: bool) -> None:
    assert can_be_corners(np.array(points, dtype=float).reshape(-1, 2)) is good


def test_many_shapes_are_judged_as_each_alone() -> None:
    many = as_objects(
        [
            shapely.from_wkt(BOW_TIE),
            shapely.MultiPolygon([shapely.box(0, 0, 1, 1), shapely.box(5, 5, 1e9, 6)]),
            shapely.box(0, 0, 2e9, 1),
            polygon((0, 0), (math.nan, 1), (1, 1)),
            shapely.Polygon([(0, 0, 1), (1, 0, 1), (1, 1, 1)]),
            shapely.Polygon(),
            shapely.Point(0, 0),
            shapely.MultiPoint([(0, 0), (1, 1)]),
            shapely.GeometryCollection([shapely.box(0, 0, 1, 1)]),
            None,
        ]
    )
    for shape, good in zip(many, can_be_footprints(many), strict=True):
        if good:
            check_footprint(shape)
        else:
            with pytest.raises((ValueError, TypeError)):
                check_footprint(shape)
    assert can_be_footprints(many).tolist() == [True] * 2 + [False] * 8
