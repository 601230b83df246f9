"""Answers of a semantic layer, after any changes, against looking at each object with shapely."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import as_objects
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.core.shapes import as_area, valid_copies
from hypermap.core.store import object_log

# Few different coordinates, so that points lie on corners, on edges and in line with them.
numbers = st.integers(-6, 6)
pairs = st.tuples(numbers, numbers)
boxes = st.builds(
    lambda at, size: shapely.box(*at, at[0] + size[0], at[1] + size[1]),
    pairs,
    st.tuples(st.integers(1, 12), st.integers(1, 12)),
)
rings = st.lists(pairs, min_size=3, max_size=9).map(shapely.Polygon)  # most cross themselves
hulls = rings.map(shapely.convex_hull).filter(lambda hull: hull.geom_type == "Polygon")
several = st.lists(hulls, min_size=1, max_size=3).map(shapely.union_all)
with_holes = st.builds(shapely.difference, boxes, hulls)
footprints = st.one_of(boxes, rings, hulls, several, with_holes).filter(
    lambda shape: shape.geom_type in ("Polygon", "MultiPolygon") and not shape.is_empty
)
small_boxes = st.builds(lambda x, y, side: shapely.box(x, y, x + side, y + side),
    numbers, numbers, st.sampled_from([0.25, 1, 3]))  # fmt: skip
areas = st.one_of(
    footprints,
    small_boxes,
    pairs.map(shapely.Point),
    st.lists(pairs, min_size=2, max_size=4).map(shapely.LineString),
    st.sampled_from(
        [
            shapely.Polygon(),
            shapely.box(-1e12, -3, 2, 1e12),
            shapely.box(40, 40, 41, 41),
            shapely.box(0, 0, 0, 3),
            shapely.box(0.5, 0.5, 2, 2, ccw=False),
        ]
    ),
)
halves = st.integers(-15, 15).map(lambda number: number / 2)
points = st.lists(
    st.one_of(st.tuples(halves, halves), st.sampled_from([(1e9, -1e9), (-1e308, 1e308)])),
    min_size=1,
    max_size=25,
)


def expected_at(layer: SemanticLayer, x: float, y: float) -> int:
    shapes = valid_copies(layer.geometries)
    there = np.flatnonzero(shapely.intersects_xy(shapes, x, y))
    best = min(there.tolist(), key=lambda row: (shapes[row].area, row), default=None)
    return -1 if best is None else int(layer.ids[best])


def expected_in(layer: SemanticLayer, area: BaseGeometry) -> list[int]:
    meets = shapely.intersects(as_area(area), valid_copies(layer.geometries))
    return layer.ids[np.asarray(meets, dtype=bool)].tolist()


def change(layer: SemanticLayer, data: st.DataObject) -> None:
    chosen = data.draw(st.sets(st.sampled_from(layer.ids.tolist() or [0]), max_size=3))
    kind = data.draw(st.sampled_from(["add", "update", "remove"]))
    if kind == "add":
        layer.add([SemanticObject("b", shape) for shape in data.draw(st.lists(footprints))])
    elif kind == "remove" and len(layer):
        layer.remove(chosen)
    elif len(layer):
        layer.update_many({i: SemanticObject("c", data.draw(footprints)) for i in chosen})


@settings(max_examples=150)
@given(st.lists(footprints, max_size=25), points, st.lists(areas, max_size=6), st.data())
def test_answers_are_those_of_looking_at_each_object(
    drawn: list[BaseGeometry],
    asked: list[tuple[float, float]],
    within: list[BaseGeometry],
    data: st.DataObject,
) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(object_log, "_FEWEST", data.draw(st.sampled_from([0, 5, 40])))
        layer = SemanticLayer("s", "map", [SemanticObject("a", shape) for shape in drawn])
        for _ in range(data.draw(st.integers(1, 5))):
            expected = [expected_at(layer, *point) for point in asked]
            assert [int(layer.value_at(point)[0]) for point in asked] == expected
            many = np.array(asked * 10)  # so many that they are answered as arrays
            assert layer.value_at(many).tolist() == expected * 10
            names = dict(zip(layer.ids.tolist(), layer.names.tolist(), strict=True))
            labels = [names.get(number, "Empty") for number in expected]
            assert [layer.label_at([point])[0] for point in asked] == labels
            for area in within:
                assert layer.values_in(area).values.tolist() == expected_in(layer, area)
            change(layer, data)


@pytest.mark.parametrize("side", [0.7, 3, 11, 45])
@pytest.mark.parametrize("turn", [0, 30])
def test_areas_of_all_sizes_hold_what_meets_them_by_name_or_all(side: float, turn: float) -> None:
    rng = np.random.default_rng(5)
    centers, sizes = rng.uniform(0, 50, (2000, 2)), rng.choice([0.2, 0.8, 4, 15], 2000)
    shapes = shapely.buffer(shapely.points(centers), sizes, quad_segs=2)
    named = zip("abc" * 667, shapes, strict=False)
    layer = SemanticLayer("s", "map", [SemanticObject(name, shape) for name, shape in named])
    moved = shapely.transform(shapes[7], lambda xy: xy + 3)
    for is_changed in (False, True):
        if is_changed:
            layer.update(7, SemanticObject("b", moved))
            layer.remove([9])
        for x, y in rng.uniform(-5, 50, (12, 2)):
            area = shapely.affinity.rotate(shapely.box(x, y, x + side, y + side), turn)
            assert layer.values_in(area).values.tolist() == expected_in(layer, area)
            held = layer.labels_in(area)
            for name in "abcd":
                places = held.points_xy[held.values == name]
                assert layer.find(name, area).tolist() == places.tolist()


@pytest.mark.parametrize("begin", range(7))
def test_a_shape_has_its_corners_whichever_comes_first(begin: int) -> None:
    corners = [(0.0, 0.0), (3.0, 2.0), (5.0, -1.0), (6.0, 4.0), (3.0, 4.0), (1.0, 6.0), (-1.0, 2.0)]
    ring = corners[begin:] + corners[:begin]
    for shape in (shapely.Polygon(ring), shapely.Polygon(ring[::-1])):
        layer = SemanticLayer("s", "map", [SemanticObject("a", shape)])
        assert [int(layer.value_at([x, y])[0]) for x, y in corners] == [0] * 7
        assert layer.value_at([[0.0, -0.1], [3.0, 1.9], [5.0, -1.1]]).tolist() == [-1] * 3


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_a_point_that_is_nowhere_is_refused(bad: float) -> None:
    for objects in ([], [SemanticObject("a", shapely.box(0, 0, 1, 1))]):
        layer = SemanticLayer("s", "map", objects)
        for point in ([bad, 0.5], [[0.5, bad]], [[0.5, 0.5], [0.5, bad]]):
            for ask in (layer.value_at, layer.label_at):
                with pytest.raises(ValueError, match="points must be finite"):
                    ask(point)
    for point in ([1.0], [1, 2, 3], [[[1, 2]]], [[1], [2]]):
        with pytest.raises(ValueError, match=r"points must have shape \(N, 2\)"):
            layer.value_at(point)


def test_a_layer_without_objects_has_nothing_anywhere() -> None:
    layer = SemanticLayer("s", "map")
    assert layer.value_at([3, 4]).tolist() == [-1]
    assert layer.label_at(np.zeros((20, 2))).tolist() == ["Empty"] * 20
    for area in (shapely.box(0, 0, 1, 1), shapely.Point(0, 0), shapely.box(-1e6, -1e6, 1e6, 1e6)):
        assert layer.values_in(area).values.shape == (0,)
        assert layer.labels_in(area).points_xy.shape == (0, 2)
    assert as_objects([]).shape == layer.names.shape


def test_neither_shapes_nor_areas_of_others_are_prepared() -> None:
    """GEOS prepares a shape while it answers; two threads that share one end the program."""
    rings = [shapely.Point(i % 10, i // 10).buffer(1) - shapely.box(0, 0, 1, 1) for i in range(100)]
    layer = SemanticLayer("s", "map", [SemanticObject("a", shape) for shape in rings])
    asked = [shapely.box(0, 0, 9, 9), shapely.Point(5, 5).buffer(4)]
    for area in asked:
        assert layer.values_in(area).values.tolist() == expected_in(layer, area)
    for x, y in [(2.5, 0.0), (1.0, 0.5), (0.5, 0.5)]:
        assert layer.value_at([x, y]).tolist() == [expected_at(layer, x, y)]
    assert not shapely.is_prepared([*rings, *asked]).any()


def test_a_shape_too_small_to_compute_with_does_no_harm() -> None:
    """GEOS raises an error where it is asked whether the first is valid, and to repair it."""
    tiny = [
        "POLYGON ((-2e-100 0, -1e-310 0, 3e-310 0, 0 2e-100, -2e-100 0), (-2e-320 1e-165, -1e-310 "
        "1e-310, 2e-320 2e-320, -2e-320 1e-165))",
        "POLYGON ((-3.455465665045885e-240 -4.814646484771862e-163, 3.780068949868091e-162 "
        "5.533130070571995e-183, 6.682429073782668e-225 -3.657606209172671e-213, "
        "-3.455465665045885e-240 -4.814646484771862e-163))",
    ]
    small = [SemanticObject("small", shapely.from_wkt(text)) for text in tiny]
    large = [SemanticObject("large", shapely.box(i, 0, i + 1, 1)) for i in range(2000)]
    for objects in (small + large[:3], small + large):
        layer = SemanticLayer("s", "map", objects)
        assert layer.values_in(shapely.box(-1, -1, 0.5, 0.5)).values.tolist() == [0, 1, 2]
        assert layer.nearest("small", [3.0, 4.0], k=2)[1].tolist() == [5.0, 5.0]
        assert layer.add(small) == [len(objects), len(objects) + 1]
        assert layer.label_at([[0.5, 0.5]]).tolist() == ["large"]
