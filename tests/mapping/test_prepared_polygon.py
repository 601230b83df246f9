"""Polygons as their edges."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry.base import BaseGeometry

from hypermap.mapping.prepared_polygon import PreparedPolygon, shared_area


def star(seed: int, origin: tuple[float, float]) -> BaseGeometry:
    """A polygon of many corners, perhaps with a hole, perhaps in several parts."""
    rng = np.random.default_rng(seed)
    angles = np.sort(rng.uniform(0, 2 * np.pi, rng.integers(3, 30)))
    radii = rng.uniform(0.2, 1, len(angles))
    corners = radii[:, np.newaxis] * np.column_stack([np.cos(angles), np.sin(angles)])
    place = np.asarray(origin) + rng.normal(0, 0.4, 2)
    shape: BaseGeometry = shapely.buffer(shapely.Polygon(corners + place), 0)
    if seed % 2:
        shape = shapely.difference(shape, shapely.Point(place).buffer(0.3, quad_segs=2))
    if seed % 3 == 0:
        shape = shapely.union(shape, shapely.box(*(place + 1.2), *(place + 1.7)))
    return shapely.reverse(shape) if seed % 5 == 0 else shape


origins = st.tuples(st.floats(-1e4, 1e4), st.floats(-1e4, 1e4))


@settings(deadline=None, max_examples=200)
@given(one=st.integers(0, 10_000), other=st.integers(0, 10_000), origin=origins)
def test_two_shapes_share_what_shapely_says(
    one: int, other: int, origin: tuple[float, float]
) -> None:
    shapes = [star(one, origin), star(other, origin)]
    expected = shapely.area(shapely.intersection(*shapes))
    outlines = PreparedPolygon.all_of(shapes)
    assert shared_area(*outlines) == pytest.approx(expected, abs=1e-10)
    assert shared_area(*reversed(outlines)) == pytest.approx(expected, abs=1e-10)


@given(seed=st.integers(0, 10_000), origin=origins)
def test_a_shape_shares_all_of_itself(seed: int, origin: tuple[float, float]) -> None:
    outline = PreparedPolygon.of(star(seed, origin))
    assert shared_area(outline, outline) == pytest.approx(outline.area, abs=1e-10)


@pytest.mark.parametrize(
    "other",
    [
        shapely.box(1, 0, 2, 1),
        shapely.box(0.3, 1, 0.7, 2),
        shapely.Polygon([(1, 0.5), (1.1, 0.2), (1.7, 0.9)]),
        shapely.Polygon(),
    ],
    ids=["beside", "above", "at one corner", "empty"],
)
def test_shapes_that_touch_share_nothing(other: BaseGeometry) -> None:
    square, touching = PreparedPolygon.all_of([shapely.box(0, 0, 1, 1), other])
    assert shared_area(square, touching) == 0
    assert shared_area(touching, square) == 0


def test_shapes_that_touch_along_a_slope_share_nothing() -> None:
    lower = shapely.Polygon([(0.1, 0.1), (0.8, 0.1), (0.8, 0.33)])
    upper = shapely.Polygon([(0.1, 0.1), (0.8, 0.33), (0.1, 0.7)])
    assert shared_area(*PreparedPolygon.all_of([lower, upper])) == 0


def test_the_inside_lies_on_the_side_that_the_edges_tell() -> None:
    ring = [(0, 0), (2, 0), (2, 2), (0, 2)]
    hole = [(0.5, 0.5), (1, 0.5), (1, 1)]
    shapes = [
        shapely.Polygon(ring),
        shapely.Polygon(ring[::-1]),
        shapely.Polygon(),
        shapely.Polygon(ring, [hole]),
        shapely.Polygon(ring, [hole[::-1]]),
    ]
    sides = [outline.edges[:, 4].tolist() for outline in PreparedPolygon.all_of(shapes)]
    assert sides == [[1] * 4, [-1] * 4, [], [1] * 4 + [-1] * 3, [1] * 7]


def test_what_is_made_of_an_outline_is_made_once() -> None:
    calls = []

    def make(outline: PreparedPolygon, factor: float) -> float:
        calls.append(factor)
        return outline.area * factor

    outline = PreparedPolygon.of(shapely.box(0, 0, 2, 1))
    assert [outline.cached(make, factor) for factor in (1.0, 2.0, 1.0)] == [2, 4, 2]
    assert calls == [1, 2]


def test_the_diameter_is_the_largest_distance_between_two_points() -> None:
    parts = shapely.MultiPolygon([shapely.box(0, 0, 1, 1), shapely.box(3, 3, 3.5, 4)])
    assert PreparedPolygon.of(parts).diameter == pytest.approx(np.hypot(3.5, 4))
    assert PreparedPolygon.of(shapely.Polygon()).diameter == 0
    round_one = shapely.Point(5, 5).buffer(2, quad_segs=1000)
    assert PreparedPolygon.of(round_one).diameter == pytest.approx(4)
