from __future__ import annotations

import struct

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import as_objects
from hypermap.formats.columns.footprints import (
    footprint_from_wkt,
    footprint_to_wkt,
    footprints_from_wkb,
    footprints_to_wkt,
)

from ..strategies import exact, footprints

SQUARE = [(0, 0), (2, 0), (2, 2), (0, 2), (0, 0)]
HOLE = [(0.5, 0.5), (1, 0.5), (1, 1), (0.5, 0.5)]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("POLYGON((0 0, 2 0, 2 2, 0 2, 0 0))", shapely.Polygon(SQUARE)),
        ("POLYGON((0 0, 2 0, 2 2, 0 2))", shapely.Polygon(SQUARE)),
        ("POLYGON((0 0, 0 2, 2 2, 2 0))", shapely.Polygon(SQUARE[::-1])),
        ("polygon ( (0 0,2 0 , 2 2,0 2) )", shapely.Polygon(SQUARE)),
        ("POLYGON((0 0, 2 0, 2 2, 0 2), (.5 .5, 1 .5, 1 1))", shapely.Polygon(SQUARE, [HOLE])),
        ("MULTIPOLYGON(((0 0, 2 0, 2 2, 0 2)))", shapely.MultiPolygon([(SQUARE, [])])),
        (
            "MULTIPOLYGON(((0 0,2 0,2 2,0 2),(0.5 0.5,1e0 0.5,1 1,0.5 0.5)),((5 5,6 5,6 6)))",
            shapely.MultiPolygon([(SQUARE, [HOLE]), ([(5, 5), (6, 5), (6, 6), (5, 5)], [])]),
        ),
    ],
)
def test_rings_are_closed_and_keep_their_winding(text: str, expected: BaseGeometry) -> None:
    assert exact(footprint_from_wkt(text)) == exact(expected)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "its shape is not well-known text: Expected word but encountered end of stream"),
        ("a chair", "its shape is not well-known text: Unknown type: 'A'"),
        ("POLYGON(())", "point 0 of its shape has 0 numbers, not 2"),
        (
            "POLYGON((-4.7 1.56, -4.68 1.56, -4.7 2.16 -4.72 2.16))",
            "point 2 of its shape has 4 numbers, not 2; is a comma missing?",
        ),
        ("POLYGON((0 0, 1 0, 1))", "point 2 of its shape has 1 numbers, not 2"),
        ("POLYGON((0 0, nan 0, 1 1))", "its shape has a coordinate that is not finite"),
        ("POLYGON((0 0, 1e999 0, 1 1))", "its shape has a coordinate that is not finite"),
        ("POLYGON((0 0))", "its shape has an outline of 1 point; three are needed"),
        ("POLYGON((0 0, 1 1))", "its shape has an outline of 2 points; three are needed"),
        ("POLYGON((0 0, 1 0, 1 1, 0 0)", "its shape is not well-known text: Expected word but "),
        ("POLYGON((0 0, 1 0, x 1))", "its shape is not well-known text: Expected number but "),
        (
            "GeometryCollection(POLYGON((0 0, 1 0, 1 1, 0 0)))",
            "its shape must be a polygon or multipolygon, not a collection",
        ),
        (
            "GEOMETRYCOLLECTION(" * 200_000,  # GEOS would end the program
            "its shape must be a polygon or multipolygon, not a collection",
        ),
        ("POLYGON((0 0, 1 0, 1 1)) or so", "its shape is not well-known text: Unexpected text"),
    ],
)
def test_broken_text_is_refused_with_a_reason(text: str, message: str) -> None:
    with pytest.raises(ValueError) as error:
        footprint_from_wkt(text)
    assert str(error.value).startswith(message)


@given(footprints)
def test_text_gives_every_coordinate_again(footprint: BaseGeometry) -> None:
    assert exact(footprint_from_wkt(footprint_to_wkt(footprint))) == exact(footprint)


CIRCLE = shapely.Point(0, 0).buffer(1, quad_segs=200)  # more than what passes unseen
RING = CIRCLE.difference(shapely.Point(0, 0).buffer(0.5, quad_segs=100))
PAIR = shapely.MultiPolygon([RING, shapely.box(9, 9, 10, 10)])


@pytest.mark.parametrize("byte_order", [0, 1])
@pytest.mark.parametrize("srid", [0, 4326])
def test_large_polygons_are_read_from_binary(byte_order: int, srid: int) -> None:
    shapes = as_objects([CIRCLE, RING, PAIR, shapely.box(0, 0, 1, 1)])
    binaries = shapely.to_wkb(
        shapely.set_srid(shapes, srid), byte_order=byte_order, include_srid=bool(srid)
    )
    assert len(binaries[2]) > 4096
    assert [exact(shape) for shape in footprints_from_wkb(binaries)] == [
        exact(shape) for shape in shapes
    ]


@pytest.mark.parametrize("letter", ["<", ">"])
@pytest.mark.parametrize("kind", [4, 6, 7, 1007, 12])
@pytest.mark.parametrize("before", [b"", PAIR.wkb.replace(b"\2\0\0\0", b"\3\0\0\0", 1)])
def test_collections_of_collections_are_no_binary_of_ours(
    letter: str, kind: int, before: bytes
) -> None:
    level = struct.pack(f"{letter}BII", letter == "<", kind, 1)  # GEOS would end the program
    with pytest.raises(ValueError, match="a footprint must be a polygon or multipolygon in the"):
        footprints_from_wkb(as_objects([before + level * 200_000]))


def test_large_binary_that_is_cut_off_or_none_is_refused() -> None:
    for end in (5000, len(PAIR.wkb) - 1):
        with pytest.raises(ValueError, match="is not well-known binary"):
            footprints_from_wkb(as_objects([PAIR.wkb[:end]]))
    with pytest.raises(TypeError, match="well-known binary must be bytes, got str"):
        footprints_from_wkb(as_objects([CIRCLE.wkb_hex]))


def test_only_polygons_have_text() -> None:
    with pytest.raises(TypeError, match="a footprint is a polygon or multipolygon, not a Point"):
        footprint_to_wkt(shapely.Point(0, 0))


def test_a_curve_is_said_to_be_none_of_ours() -> None:
    with pytest.raises(ValueError, match="its shape is not well-known text"):
        footprint_from_wkt("CURVEPOLYGON(CIRCULARSTRING(0 0, 2 0, 2 2, 0 2, 0 0))")


@given(st.lists(footprints, max_size=4))
def test_many_footprints_are_written_as_each_alone(shapes: list[BaseGeometry]) -> None:
    written = footprints_to_wkt(as_objects(shapes))
    assert written == [footprint_to_wkt(shape) for shape in shapes]


def test_usual_outlines_are_written_as_each_alone() -> None:
    rng = np.random.default_rng(0)
    corners = rng.uniform(-50, 50, (200, 2)).round(2)
    shapes = shapely.box(*corners.T, *(corners + rng.uniform(0.001, 3, (200, 2))).T)
    shapes[77] = shapely.Polygon(SQUARE, [HOLE])
    shapes[78] = shapely.box(0, 0, 1e-5, 2e16)
    assert footprints_to_wkt(shapes) == [footprint_to_wkt(shape) for shape in shapes]
