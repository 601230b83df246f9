"""Points, areas and objects in messages of ROS 1 and ROS 2, as their receiver gets them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from hypermap.core.errors import FormatError
from hypermap.core.semantic import SemanticLayer
from hypermap.ros.messages.from_messages import (
    area_of,
    crosses_itself,
    is_empty_area,
    point_of,
    semantic_objects_of,
)
from hypermap.ros.messages.to_messages import semantic_map
from hypermap.testing.builders import square
from hypermap.testing.strategies import polygons, semantic_layers

from .message_builder import BOW_TIE, MALFORMED, NAN, SQUARE, area, item, semantic

SHARED = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=40)


# Points


@pytest.mark.parametrize(
    ("frame", "expected"), [("lab", "lab"), ("/lab", "lab"), ("", None), ("/", None)]
)
def test_a_point_has_a_place_and_a_frame(types: Any, frame: str, expected: str | None) -> None:
    message = types.message("geometry_msgs/PointStamped")(
        point=types.message("geometry_msgs/Point")(x=1.5, y=-2.0, z=9.0)
    )
    message.header.frame_id = frame
    xy, frame_id = point_of(types.sent(message))
    assert xy.tolist() == [[1.5, -2.0]]
    assert frame_id == expected


@pytest.mark.parametrize("xy", [(NAN, 0.0), (0.0, math.inf)])
def test_a_point_nowhere_is_refused(types: Any, xy: tuple[float, float]) -> None:
    message = types.message("geometry_msgs/PointStamped")(
        point=types.message("geometry_msgs/Point")(x=xy[0], y=xy[1], z=0.0)
    )
    with pytest.raises(FormatError, match=r"the point must be finite, got \("):
        point_of(types.sent(message))


# Areas


@SHARED
@given(
    shape=polygons(),
    is_closed=st.booleans(),
    is_turned=st.booleans(),
    repeats=st.integers(1, 3),
)
def test_a_ring_may_be_closed_and_wind_either_way(
    types: Any, shape: shapely.Polygon, is_closed: bool, is_turned: bool, repeats: int
) -> None:
    ring = shapely.get_coordinates(shape.exterior).astype(np.float32).astype(float)
    expected = shapely.Polygon(ring)
    sent = ring if is_closed else ring[:-1]
    sent = np.repeat(sent[::-1] if is_turned else sent, repeats, axis=0)
    got, frame_id = area_of(area(types, sent, "/lab"))
    assert frame_id == "lab"
    assert got.area == pytest.approx(expected.area)
    assert shapely.equals(got.normalize().boundary, expected.normalize().boundary)


@pytest.mark.parametrize(("points", "reason"), MALFORMED)
def test_a_malformed_area_is_refused(types: Any, points: Any, reason: str) -> None:
    with pytest.raises(FormatError, match=f"the area is not a polygon: .*{reason}"):
        area_of(area(types, points))


@pytest.mark.parametrize(
    "points",
    [
        BOW_TIE,
        [(x + 5e5, y + 5e5) for x, y in BOW_TIE],
        [*SQUARE, *SQUARE],  # twice around
        [(0, 0), (4, 0), (4, 1), (1, -0.5)],
    ],
)
def test_an_area_that_crosses_itself_is_refused(types: Any, points: Any) -> None:
    with pytest.raises(FormatError, match="its outline crosses itself"):
        area_of(area(types, points))


def test_what_would_keep_the_server_busy_is_refused(types: Any) -> None:
    scribble = np.random.default_rng(0).random((1200, 2)) * 10
    with pytest.raises(FormatError, match="of 1201 corners crosses or touches itself too often"):
        area_of(area(types, scribble))
    objects, (problem,) = semantic_objects_of(semantic(types, item(types, "cup", scribble, 3)))
    assert objects == []
    assert problem.startswith("object 3 ('cup') is left out: an outline of 1201 corners crosses")


def test_an_outline_that_only_touches_itself_is_no_crossing(types: Any) -> None:
    with_way_to_hole = [(0, 0), (9, 0), (9, 9), (0, 9), (0, 0), (3, 3), (3, 6), (6, 6), (6, 3)]
    got, _ = area_of(area(types, [*with_way_to_hole, (3, 3)]))
    assert not got.is_valid
    assert not crosses_itself(got)


def test_rounding_is_no_crossing() -> None:
    # A needle's sides cross by 1e-7 m at its tip.
    ring = [(0, 0), (10, 0), (10, 5), (0, 5), (0, 2.5), (5, 2.5), (5, 2.5 - 1e-7), (0, 2.5 + 1e-7)]
    assert not shapely.Polygon(ring).is_valid
    assert not crosses_itself(shapely.Polygon(ring))


def test_an_area_without_points_is_distinguished_from_others(types: Any) -> None:
    assert is_empty_area(area(types, []))
    assert not is_empty_area(area(types, [(0, 0)]))


def test_an_area_far_beyond_all_maps_is_an_area(types: Any) -> None:
    far = 3e38
    got, _ = area_of(area(types, [(-far, -far), (far, -far), (far, far), (-far, far)]))
    assert SemanticLayer("s", "map", [square("cup", 0, 0)]).labels_in(got).values.tolist() == [
        "cup"
    ]


# Objects


@SHARED
@given(layer=semantic_layers())
def test_a_semantic_map_comes_back(types: Any, layer: SemanticLayer) -> None:
    objects, _ = semantic_objects_of(types.sent(semantic_map(layer, types, 0)))
    for got, ours in zip(objects, layer.objects(), strict=True):
        assert (got.id, got.name, got.tags) == (ours.id, ours.name, ours.tags)
        largest = max(shapely.get_parts(ours.footprint), key=lambda part: part.area)
        sent = shapely.get_coordinates(largest.exterior).astype(np.float32)
        assert np.array_equal(shapely.get_coordinates(got.footprint)[:-1], sent[:-1])


def test_tags_and_confidence_are_read(types: Any) -> None:
    cup = item(types, "cup", SQUARE, tags=["mug"], confidence=np.array([0.5]))
    (got,), problems = semantic_objects_of(semantic(types, cup))
    assert (got.tags, got.confidence, problems) == (("mug",), (0.5,), [])


@pytest.mark.parametrize(("points", "reason"), MALFORMED)
def test_a_malformed_object_is_left_out_and_the_rest_kept(
    types: Any, points: Any, reason: str
) -> None:
    items = [item(types, n, p, i) for i, (n, p) in enumerate([("a", SQUARE), ("b", points)])]
    objects, problems = semantic_objects_of(semantic(types, *items, item(types, "c", SQUARE, 9)))
    assert [(got.id, got.name) for got in objects] == [(0, "a"), (9, "c")]
    (problem,) = problems
    assert problem.startswith("object 1 ('b') is left out: its shape has ")
    assert reason in problem


def test_an_object_that_crosses_itself_is_kept_and_reported(types: Any) -> None:
    objects, problems = semantic_objects_of(semantic(types, item(types, "tie", BOW_TIE, 3)))
    assert [got.id for got in objects] == [3]
    assert problems == ["object 3 ('tie'): its outline crosses itself; everything inside it counts"]
    layer = SemanticLayer("s", "map", objects)
    assert layer.label_at([[1.8, 1.0], [0.2, 1.0], [1.0, 1.8]]).tolist() == ["tie", "tie", "Empty"]


def test_a_confidence_that_is_no_number_leaves_an_object_out(types: Any) -> None:
    bad = item(types, "cup", SQUARE, tags=["mug"], confidence=np.array([NAN]))
    objects, problems = semantic_objects_of(semantic(types, bad))
    assert objects == []
    assert "confidence must be finite" in problems[0]


@pytest.mark.parametrize("ids", [(0, 0, 0), (5, 7, 5), (-1, 0, 1)])
def test_ids_that_tell_nothing_apart_become_positions(types: Any, ids: Any) -> None:
    items = [item(types, "cup", SQUARE, number) for number in ids]
    objects, problems = semantic_objects_of(semantic(types, *items))
    assert [got.id for got in objects] == [0, 1, 2]
    assert problems == []
