from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from hypermap.core.arrays import as_objects
from hypermap.core.store.outlines import Outlines, Rings

# Few different coordinates, so that points lie on corners, edges and their extensions.
coordinates = st.tuples(st.integers(0, 6), st.integers(0, 6))
shapes = st.one_of(
    st.lists(coordinates, min_size=3, max_size=9)
    .map(shapely.MultiPoint)
    .map(shapely.convex_hull)
    .filter(lambda hull: hull.geom_type == "Polygon"),
    st.lists(coordinates, min_size=4, max_size=8)
    .map(shapely.Polygon)
    .filter(lambda polygon: polygon.is_valid),
    st.just(shapely.box(0, 0, 6, 6).difference(shapely.box(1, 1, 3, 4))),
    st.just(shapely.MultiPolygon([shapely.box(0, 0, 1, 1), shapely.box(3, 3, 5, 6)])),
    st.just(shapely.LineString([(0, 0), (4, 2)])),
)


@given(st.lists(shapes, min_size=1, max_size=6), st.lists(coordinates, min_size=1, max_size=12))
def test_points_are_covered_as_geos_says(drawn: list[shapely.Geometry], points) -> None:
    rows, places = np.indices((len(drawn), len(points))).reshape(2, -1)
    xy = np.array(points, dtype=float)[places]
    expected = shapely.intersects_xy(as_objects(drawn)[rows], xy).tolist()
    assert Outlines(as_objects(drawn)).cover(rows, xy).tolist() == expected
    rings = Rings(drawn.__getitem__)
    for _ in range(2):  # looked at, and kept
        one_by_one = [rings.cover(row, *at) for row, at in zip(rows, xy.tolist(), strict=True)]
        assert one_by_one == expected


@pytest.mark.parametrize("corners", [5, 40, 300])
def test_points_a_hair_from_an_outline_are_distinguished(corners: int) -> None:
    """Doubles next to the edge, where a difference of products has lost all its digits."""
    circle = shapely.Point(0.1, 0.7).buffer(1 / 3, quad_segs=corners)
    on_edge = shapely.get_coordinates(shapely.line_interpolate_point(
        circle.boundary, np.linspace(0, 1, 500), normalized=True))  # fmt: skip
    nearby = [np.nextafter(on_edge, toward) for toward in (-9, 9)]
    points = np.concatenate([on_edge, *nearby])
    covered = Outlines(as_objects([circle])).cover(np.zeros(len(points), dtype=int), points)
    expected = shapely.intersects_xy(circle, points)
    assert 0 < expected.sum() < len(points)
    np.testing.assert_array_equal(covered, expected)
    rings = Rings([circle].__getitem__)
    assert [rings.cover(0, x, y) for x, y in points.tolist()] == expected.tolist()


def test_outlines_that_are_no_longer_kept_are_looked_at_again(monkeypatch) -> None:
    monkeypatch.setattr("hypermap.core.store.outlines._MOST_KEPT", 2)
    rings = Rings([shapely.box(i, 0, i + 1, 1) for i in range(5)].__getitem__)
    for row in [0, 1, 2, 3, 4, 0, 1]:
        assert [rings.cover(row, x + 0.5, 0.5) for x in range(5)] == [x == row for x in range(5)]


def test_no_pairs_are_no_answers() -> None:
    outlines = Outlines(as_objects([shapely.box(0, 0, 1, 1)]))
    assert outlines.cover(np.empty(0, dtype=int), np.empty((0, 2))).shape == (0,)
    assert Outlines(as_objects([])).cover(np.empty(0, dtype=int), np.empty((0, 2))).shape == (0,)


def test_the_first_corners_lie_on_the_shapes() -> None:
    drawn = as_objects([shapely.box(0, 0, 1, 1), shapely.Point(5, 5).buffer(2)])
    first = Outlines(drawn).first_corners(np.array([1, 0]))
    assert shapely.intersects_xy(drawn[[1, 0]], first.T[0], first.T[1]).all()
