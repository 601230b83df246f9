"""Shapes from files and requests are mended at once, or refused at once."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import as_objects
from hypermap.core.errors import AreaError
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.core.shapes import as_area, can_be_footprints
from hypermap.core.tangles import are_untangled, check_tangle, has_empty_hole, is_sound

_SECONDS = 3.0  # of processor time; each of these shapes would take many times as long


def _scribble(corners: int) -> BaseGeometry:
    return shapely.Polygon(np.random.default_rng(0).random((corners, 2)) * 10)


def _rays(count: int) -> BaseGeometry:
    angles = np.linspace(0, 6, count)
    xy = np.zeros((2 * count, 2))
    xy[::2] = np.column_stack([np.cos(angles), np.sin(angles)])
    return shapely.Polygon(xy)


def _again_and_again(times: int) -> BaseGeometry:
    return shapely.Polygon([(0, 0), (1, 0), (1, 1), (0, 1)] * times)


def _slanted_comb(teeth: int) -> BaseGeometry:
    x = np.arange(teeth) / 1e6
    zigzag = np.empty((2 * teeth, 2))
    zigzag[::2] = np.column_stack([x, np.zeros(teeth)])
    zigzag[1::2] = np.column_stack([x + 0.5, np.ones(teeth)])
    return shapely.Polygon(np.vstack([zigzag, [(1.6, 1), (1, -1), (0, -1)]]))


def _repeated_parts(count: int) -> BaseGeometry:
    return shapely.MultiPolygon([shapely.box(0, 0, 1, 1)] * count)


def _circle(corners: int) -> BaseGeometry:
    angles = np.linspace(0, 2 * np.pi, corners, endpoint=False)
    return shapely.Polygon(np.column_stack([np.cos(angles), np.sin(angles)]))


def _bow_ties(count: int) -> NDArray[np.float64]:
    x = np.arange(count)
    y = x % 2
    return np.vstack([np.column_stack([x, y]), np.column_stack([x, 1 - y])[::-1]])


@pytest.mark.parametrize(
    "make",
    [
        lambda: _scribble(3_000),
        lambda: _rays(3_000),
        lambda: _again_and_again(1_000),
        lambda: _slanted_comb(20_000),
        lambda: _repeated_parts(3_000),
        lambda: _circle(200_000),
        lambda: shapely.GeometryCollection([shapely.GeometryCollection([_scribble(3_000)])]),
        lambda: shapely.GeometryCollection([shapely.MultiPolygon([_scribble(3_000)])]),
    ],
    ids=[
        "scribble",
        "rays",
        "circles",
        "comb",
        "repeated parts",
        "too many corners",
        "nested",
        "a collection's several",
    ],
)
def test_what_would_take_geos_minutes_is_refused_at_once(make: Callable[[], BaseGeometry]) -> None:
    shape = make()
    began = time.process_time()
    with pytest.raises(ValueError, match="corners"):
        check_tangle(shape)
    with pytest.raises(AreaError, match="ask about a simpler area"):
        as_area(shape)
    assert not are_untangled(as_objects([shapely.box(0, 0, 1, 1), shape]))[1]
    assert time.process_time() - began < _SECONDS


@pytest.mark.parametrize(
    "shape",
    [
        shapely.Polygon(),
        shapely.LineString([(0, 0), (1, 1)]),
        _scribble(50),  # so few corners are mended, however they lie
        shapely.Polygon(_bow_ties(1_000)),
        _circle(50_000),
        shapely.MultiPolygon([shapely.box(i, 0, i + 1.5, 1) for i in range(300)]),
        shapely.MultiPolygon([shapely.box(-i, -i, i, i) for i in range(1, 300)]),
    ],
    ids=["empty", "line", "few", "bow ties", "circle", "overlapping parts", "one in the other"],
)
def test_outlines_that_are_mended_quickly_are_taken(shape: BaseGeometry) -> None:
    check_tangle(shape)
    began = time.process_time()
    assert as_area(shape).is_valid
    assert time.process_time() - began < _SECONDS


HOLLOW = "POLYGON((0 0, 4 0, 4 4, 0 4, 0 0), EMPTY)"


@pytest.mark.parametrize(
    ("wkt", "expected"),
    [
        (HOLLOW, True),
        (f"GEOMETRYCOLLECTION(POINT(9 9), GEOMETRYCOLLECTION({HOLLOW}))", True),
        ("MULTIPOLYGON(((0 0, 4 0, 4 4, 0 0), EMPTY), ((8 0, 9 0, 9 9, 8 0)))", True),
        ("GEOMETRYCOLLECTION(MULTIPOLYGON(((0 0, 4 0, 4 4, 0 0), EMPTY)))", True),
        ("POLYGON((0 0, 4 0, 4 4, 0 4, 0 0), EMPTY, (1 1, 2 1, 2 2, 1 1))", True),
        ("POLYGON((0 0, 4 0, 4 4, 0 4, 0 0), (1 1, 2 1, 2 2, 1 1))", False),
        ("MULTIPOLYGON(EMPTY, ((0 0, 4 0, 4 4, 0 0)))", False),
        ("POLYGON EMPTY", False),
        ("LINESTRING(0 0, 1 1)", False),
    ],
)
def test_a_hole_without_corners_is_found_and_mended_in_areas(wkt: str, expected: bool) -> None:
    shape = shapely.from_wkt(wkt)
    both = as_objects([shapely.box(0, 0, 1, 1), shape])
    assert has_empty_hole(shape) is expected
    assert has_empty_hole(both).tolist() == [False, expected]
    assert is_sound(shape) is not expected
    assert is_sound(both).tolist() == [True, not expected]
    area = as_area(shape)
    assert not has_empty_hole(area)
    assert shapely.equals(area, area)  # with the empty hole, GEOS 3.14 crashes here


def test_an_area_with_an_empty_hole_finds_objects() -> None:
    layer = SemanticLayer("semantic", "map", [SemanticObject("cup", shapely.Point(2, 2).buffer(1))])
    assert layer.labels_in(shapely.from_wkt(HOLLOW)).values == ["cup"]


def test_an_object_of_a_tangled_outline_cannot_be_made() -> None:
    tangled = _scribble(3_000)
    with pytest.raises(ValueError, match="3001 corners crosses or touches itself too often"):
        SemanticObject("scribble", tangled)
    good = SemanticObject("bow ties", shapely.Polygon(_bow_ties(1_000)))
    assert SemanticLayer("semantic", "map", [good]).label_at([[0.1, 0.5]]) == ["bow ties"]
    assert can_be_footprints(as_objects([tangled, good.footprint])).tolist() == [False, True]
