from __future__ import annotations

import pytest
import shapely

from hypermap.console.places import parse_area, parse_point
from hypermap.core.errors import HypermapError

SQUARE = shapely.box(1, 2, 3, 5)


@pytest.mark.parametrize("text", ["1.5,-2", "1.5 -2", " 1.5 , -2 ", "15e-1,-2"])
def test_a_point_is_two_numbers(text):
    assert parse_point(text, "--at") == (1.5, -2.0)


@pytest.mark.parametrize("text", ["", "1", "1,2,3", "a,b", "nan,1", "1,inf"])
def test_a_bad_point_is_said_so(text):
    with pytest.raises(HypermapError) as error:
        parse_point(text, "--at")
    assert str(error.value) == f"--at {text!r}: a point is X,Y in meters, such as 1.5,-2"


@pytest.mark.parametrize(
    "text",
    [
        "1,2,3,5",
        "3,5,1,2",
        "1,2 3,2 3,5 1,5",
        "1 2 3 2 3 5 1 5",
        "POLYGON((1 2, 3 2, 3 5, 1 5, 1 2))",
        " polygon ((1 2, 1 5, 3 5, 3 2, 1 2))",
    ],
)
def test_an_area_is_a_rectangle_corners_or_wkt(text):
    assert parse_area(text, "--in").equals(SQUARE)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "an area is a rectangle"),
        ("1,2", "an area is a rectangle"),
        ("1,2 3,4", "an area is a rectangle"),
        ("1,2 3,4 5", "an area is a rectangle"),
        ("1,2,nan,4", "an area is a rectangle"),
        ("1,2,1,4", "the area is empty"),
        ("POINT (1 2)", "the area is empty"),
        ("POLYGON EMPTY", "the area is empty"),
        ("0,0 2,2 2,0 0,2", "the area is empty, has an empty hole, or its outline crosses itself"),
        ("POLYGON((1 2, 3", "this is not WKT"),
        ("kitchen", "this is not WKT"),
    ],
)
def test_a_bad_area_is_said_so(text, reason):
    with pytest.raises(HypermapError) as error:
        parse_area(text, "--in")
    assert str(error.value).startswith(f"--in {text!r}: {reason}")


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (f"POLYGON((0 0, {'1' * 400} 0, {'1 1, ' * 100} 0 0))", "must be finite"),
        (f"{'GEOMETRYCOLLECTION(' * 200_000}POINT(0 0){')' * 200_000}", "in a collection"),
    ],
    ids=["infinite", "nested"],
)
def test_an_area_that_geos_cannot_read_is_refused(text, reason):
    with pytest.raises(HypermapError, match=reason):
        parse_area(text, "--in")
