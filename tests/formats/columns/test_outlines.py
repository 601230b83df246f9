from __future__ import annotations

import math
import struct

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import ObjectArray
from hypermap.core.shapes import can_be_footprints
from hypermap.formats.columns.footprints import footprint_from_wkt, footprint_to_wkt
from hypermap.formats.columns.outlines import outlines_from_wkb, outlines_from_wkt

from ..strategies import exact, footprints

RIGHT = "POLYGON((0 0, 1 0, 1 1))"
SQUARE = [(0, 0), (2, 0), (2, 2), (0, 2), (0, 0)]


@pytest.mark.parametrize(
    "texts",
    [
        [RIGHT],
        [RIGHT, "POLYGON((1e-3 -0.5, 2.5E1 0, 123456789.01234567890 1e-7, 1e-3 -0.5))", RIGHT],
        ["POLYGON((0 0,1 0,1 1))", "POLYGON((0 0,1 0,1 1,0.30000000000000004 2,0 0))"],
        ["POLYGON ((0 0, 1 0, 1 1))", RIGHT, "POLYGON ((5 5, 6 5, 6 6, 5 5))"],
    ],
)
def test_many_texts_are_read_as_each_alone(texts: list[str]) -> None:
    outlines = outlines_from_wkt("\n".join(texts).encode())
    assert outlines is not None
    assert [g.wkb for g in outlines] == [footprint_from_wkt(text).wkb for text in texts]


@pytest.mark.parametrize(
    "other",
    [
        "POLYGON((0 0, 9 0, 9 9, 0 0), (1 1, 2 1, 2 2, 1 1))",
        "MULTIPOLYGON(((0 0, 1 0, 1 1, 0 0)))",
        "POLYGON((0 0,1 0,1 1))",  # unlike the others
        "POLYGON((0 0 , 1 0, 1 1))",
        "POLYGON((0 0, 1 ,0 1 1))",
        "POLYGON((0 0, 1 0 1 1))",
        "POLYGON((0 0 1, 0 1, 1))",
        "POLYGON((0 0, 1  0, 1 1))",
        "POLYGON((0 0, , 1 1))",
        "POLYGON((0 0, 1 0, 1 1)5)",
        "POLYGON((0 0, 1 0, 1 1))5",
        "5POLYGON((0 0, 1 0, 1 1))",
        "POL5YGON((0 0, 1 0, 1 1))",
        "POLYGON(5(0 0, 1 0, 1 1))",
        "POLYGON((+0 0, 1 0, 1 1))",
        "POLYGON((0 0, 1 0, 1 e))",
        "POLYGON((G0 0, 1 0, 1 1))",
        "POLYGON((0 0, 1 0))",
        "POLYGON((0 0, 1 0, 0 0))",
        "POLYGON((0 0, 1e400 0, 1 1))",
        "POLYGON((0 0, nan 0, 1 1))",
        "POLYGON((0 0, 1000000001 0, 1 1))",
        "POLYGON(())",
        "POLYGON EMPTY",
        "",
    ],
)
def test_what_is_not_one_plain_ring_is_left_to_the_other_reader(other: str) -> None:
    for texts in ([other], [other, RIGHT], [RIGHT, other], [RIGHT, other, RIGHT]):
        outlines = outlines_from_wkt("\n".join(texts).encode())
        if outlines is not None:  # as one that is plain by itself
            assert len(texts) == 1
            assert outlines[0].wkb == footprint_from_wkt(other).wkb


def test_zeros_keep_their_sign() -> None:
    shape = shapely.Polygon([(-0.0, 0.0), (1, -0.0), (-0.0, -0.0), (2, 2)])
    for text in (footprint_to_wkt(shape), footprint_to_wkt(shape).replace(", ", ",")):
        outlines = outlines_from_wkt(text.encode())
        assert outlines is not None
        assert exact(outlines[0]) == exact(footprint_from_wkt(text)) == exact(shape)


@given(st.lists(footprints, min_size=1, max_size=4))
def test_written_outlines_are_the_same_again(shapes: list[BaseGeometry]) -> None:
    outlines = outlines_from_wkt("\n".join(map(footprint_to_wkt, shapes)).encode())
    plain = [isinstance(shape, shapely.Polygon) and not shape.interiors for shape in shapes]
    if outlines is None:
        assert not all(plain)
    else:
        assert [exact(g) for g in outlines] == [exact(shape) for shape in shapes]


def packed(shapes: list[bytes]) -> tuple[NDArray[np.uint8], NDArray[np.int64]]:
    """Return binaries end to end, with something before and behind them."""
    bounds = 3 + np.append(0, np.cumsum([len(shape) for shape in shapes]))
    return np.frombuffer(b"..." + b"".join(shapes) + b"..", np.uint8), bounds


def from_wkb(shapes: list[bytes]) -> ObjectArray | None:
    return outlines_from_wkb(*packed(shapes))


@given(st.lists(footprints, min_size=1, max_size=4))
def test_binary_outlines_are_those_that_went_in(shapes: list[BaseGeometry]) -> None:
    outlines = from_wkb([shape.wkb for shape in shapes])
    plain = [isinstance(shape, shapely.Polygon) and not shape.interiors for shape in shapes]
    assert (outlines is not None) == all(plain)
    if outlines is not None:
        assert [exact(g) for g in outlines] == [exact(shape) for shape in shapes]


@pytest.mark.parametrize(
    "other",
    [
        shapely.Point(0, 0).wkb,
        shapely.LineString(SQUARE).wkb,
        shapely.Polygon().wkb,
        shapely.Polygon([(x, y, 1) for x, y in SQUARE]).wkb,
        shapely.Polygon([(x * 1e9, y) for x, y in SQUARE]).wkb,
        shapely.Polygon(SQUARE).wkb.replace(struct.pack("<d", 2), struct.pack("<d", math.nan)),
        shapely.to_wkb(shapely.Polygon(SQUARE), byte_order=0),
        shapely.to_wkb(shapely.set_srid(shapely.Polygon(SQUARE), 4), include_srid=True),
        shapely.MultiPolygon([(SQUARE, [])]).wkb,
        shapely.Polygon(SQUARE).wkb + b"\0",
        shapely.Polygon(SQUARE).wkb[:-1],
        shapely.Polygon(SQUARE).wkb[:9] + b"\4\0\0\0" + shapely.LineString(SQUARE[:4]).wkb[9:],
        shapely.Polygon(SQUARE).wkb[:9] + b"\3\0\0\0" + shapely.LineString(SQUARE[:3]).wkb[9:],
        b"\1\3",
        b"",
    ],
)
def test_binary_that_is_not_one_ring_of_an_object_is_left_to_the_other_reader(
    other: bytes,
) -> None:
    right = shapely.Polygon(SQUARE).wkb
    assert from_wkb([right, right]) is not None
    for shapes in ([other], [other, right], [right, other], [right, other, right]):
        assert from_wkb(shapes) is None


@given(st.data())
def test_damaged_binary_is_none_or_what_geos_takes_it_for(data: st.DataObject) -> None:
    shape = bytearray(shapely.Polygon(SQUARE).wkb)
    for _ in range(data.draw(st.integers(1, 3))):
        shape[data.draw(st.integers(0, len(shape) - 1))] = data.draw(st.integers(0, 255))
    outlines = from_wkb([bytes(shape)])
    if outlines is not None:
        assert can_be_footprints(outlines).all()
        assert exact(outlines[0]) == exact(shapely.from_wkb(bytes(shape)))
