"""Maps as messages of ROS 1 and ROS 2, read again as their receivers get them."""

from __future__ import annotations

import array
import datetime
import json
import math
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from hypermap.core.arrays import as_objects
from hypermap.core.frames import FrameTree, Pose2D, Transform
from hypermap.core.grid import GridGeometry
from hypermap.core.hypermap import Hypermap
from hypermap.core.objects import SemanticObject
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticLayer
from hypermap.core.value_layer import ValueLayer
from hypermap.recordings.messages.header import nanoseconds
from hypermap.recordings.messages.occupancy import occupancy_of_grid
from hypermap.ros.messages.geometry_messages import numbers, outline, outlines
from hypermap.ros.messages.grid_map_messages import grid_map
from hypermap.ros.messages.replies import objects_reply
from hypermap.ros.messages.to_messages import (
    hypermap_meta_data,
    layer_transforms,
    map_meta_data,
    object_state_array,
    object_states,
    occupancy_grid,
    polygon_stamped,
    semantic_map,
    value_grid,
    value_scale,
)
from hypermap.testing.builders import occupancy_from_text, square
from hypermap.testing.strategies import areas, occupancy_layers, semantic_layers

STAMP = 1_700_000_000_123_456_789
SHARED = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=40)


def ring(message: Any) -> list[tuple[float, float]]:
    return [(point.x, point.y) for point in message.points]


# Occupancy


@SHARED
@given(layer=occupancy_layers())
def test_a_grid_comes_back_as_it_was(types: Any, layer: OccupancyLayer) -> None:
    got = types.sent(occupancy_grid(layer, types, STAMP))
    again = occupancy_of_grid(got, layer.name)
    assert nanoseconds(got.header.stamp) == nanoseconds(got.info.map_load_time) == STAMP
    assert again.frame_id == layer.frame_id
    assert np.array_equal(again.cells, layer.cells)
    assert again.grid.shape == layer.grid.shape
    assert again.grid.resolution == layer.grid.resolution
    ours, theirs = layer.grid.origin, again.grid.origin
    assert (ours.x, ours.y) == (theirs.x, theirs.y)
    assert math.remainder(ours.yaw - theirs.yaw, math.tau) == pytest.approx(0, abs=1e-9)


def test_an_empty_layer_is_a_grid_without_cells(types: Any) -> None:
    got = types.sent(occupancy_grid(OccupancyLayer("occupancy", "map"), types, STAMP))
    assert (got.info.width, got.info.height, len(got.data)) == (0, 0, 0)
    assert got.info.origin.orientation.w == 1


def test_what_a_raw_map_holds_wraps_to_signed_bytes(types: Any) -> None:
    values = np.arange(-1, 255, dtype=np.int16).reshape(16, 16)
    layer = OccupancyLayer("raw", "map", GridGeometry(16, 16, 0.05), values)
    got = types.sent(occupancy_grid(layer, types, STAMP))
    cells = np.asarray(got.data, np.int8)
    assert cells[0] == -1
    assert np.array_equal(cells.view(np.uint8)[1:], values.ravel()[1:])


def test_a_layer_s_frame_loses_the_slash_of_old_maps(types: Any) -> None:
    layer = occupancy_from_text("..", frame_id="/map")
    assert occupancy_grid(layer, types, STAMP).header.frame_id == "map"


def test_meta_data_hold_the_geometry(types: Any) -> None:
    layer = occupancy_from_text("...\n...", 0.05, Pose2D(1, 2, math.pi / 2))
    got = types.sent(map_meta_data(layer, types, STAMP))
    assert (got.width, got.height, got.resolution) == (3, 2, pytest.approx(0.05))
    assert (got.origin.position.x, got.origin.position.y) == (1, 2)
    assert got.origin.orientation.z == pytest.approx(math.sqrt(0.5))
    assert got.origin.orientation.w == pytest.approx(math.sqrt(0.5))


# Measured values


def test_values_are_scaled_to_the_range_of_a_grid_and_the_scale_is_reported(types: Any) -> None:
    cells = [[20.0, 22.5, math.nan], [30.0, 20.04, 25.0]]
    grid = GridGeometry(3, 2, 0.5, Pose2D(1, 2))
    layer = ValueLayer("warmth", "map", grid, cells, "°C", quantity="temperature")
    got = types.sent(value_grid(layer, types, STAMP))
    assert np.asarray(got.data, np.int8).tolist() == [0, 25, -1, 100, 0, 50]
    assert (got.info.width, got.info.height, got.info.origin.position.x) == (3, 2, 1)
    reported = json.loads(types.sent(value_scale(layer, types, STAMP)).data)
    assert reported == {"quantity": "temperature", "unit": "°C", "at_0": 20, "at_100": 30}


@pytest.mark.parametrize(("cells", "data"), [([[7, 7]], [0, 0]), ([[math.nan] * 2], [-1, -1])])
def test_a_quantity_that_is_the_same_or_unknown_all_over_has_a_grid(
    types: Any, cells: Any, data: Any
) -> None:
    layer = ValueLayer("warmth", "map", GridGeometry(2, 1, 0.5), cells)
    got = types.sent(value_grid(layer, types, STAMP))
    assert np.asarray(got.data, np.int8).tolist() == data


def test_a_grid_map_has_each_value_and_deviation_at_its_place(types: Any) -> None:
    cells = np.array([[20.0, 22.5, math.nan], [30.0, 20.04, 25.0]], np.float32)
    layer = ValueLayer(
        "warmth", "map", GridGeometry(3, 2, 0.5, Pose2D(1, 2)), cells, deviations=cells / 10
    )
    got = types.sent(grid_map(layer, types, STAMP))
    head = got.info.header if hasattr(got.info, "header") else got.header  # ROS 1, ROS 2
    assert (head.frame_id, nanoseconds(head.stamp)) == ("map", STAMP)
    assert (got.layers, got.basic_layers) == (["value", "deviation"], ["value"])
    lengths, center = np.array([got.info.length_x, got.info.length_y]), got.info.pose.position
    assert lengths.tolist() == [1.5, 1.0]
    for sent, asked in zip(got.data, (layer.value_at, layer.deviation_at), strict=True):
        outer, inner = sent.layout.dim
        assert (outer.label, outer.stride, inner.label, inner.stride) == (
            "column_index", 6, "row_index", 3,
        )  # fmt: skip
        matrix = np.reshape(sent.data, (outer.size, inner.size)).T  # as Eigen maps it
        # GridMapMath.cpp: a cell's position falls with its index, from the largest x and y.
        corner = np.array([center.x, center.y]) + lengths / 2 - got.info.resolution / 2
        for index in np.ndindex(matrix.shape):
            place = corner - got.info.resolution * np.array(index)
            np.testing.assert_array_equal(np.float32(matrix[index]), asked([place])[0])


def test_a_grid_map_without_cells_or_deviations_is_one_without_layers(types: Any) -> None:
    assert types.sent(grid_map(ValueLayer("warmth", "map"), types, STAMP)).layers == []
    layer = ValueLayer("warmth", "map", GridGeometry(2, 1, 0.5), [[7, 7]])
    assert types.sent(grid_map(layer, types, STAMP)).layers == ["value"]


# Objects


@SHARED
@given(layer=semantic_layers())
def test_objects_are_sent_with_id_centroid_and_outer_ring(types: Any, layer: SemanticLayer) -> None:
    got = types.sent(semantic_map(layer, types, STAMP))
    assert (nanoseconds(got.header.stamp), got.header.frame_id) == (STAMP, layer.frame_id)
    assert [item.id for item in got.objects] == layer.ids.tolist()
    assert [item.name for item in got.objects] == layer.names.tolist()
    for item, ours, centroid in zip(
        got.objects, layer.objects(), layer.table.centroids, strict=True
    ):
        assert (item.position.x, item.position.y) == tuple(centroid)
        assert tuple(item.tags) == ours.tags
        largest = max(shapely.get_parts(ours.footprint), key=lambda part: part.area)
        sent = shapely.get_coordinates(largest.exterior)[:-1].astype(np.float32)
        assert ring(item.shape) == [tuple(point) for point in sent.tolist()]


@SHARED
@given(layer=semantic_layers())
def test_rospy_gets_objects_as_genpy_writes_them(ros1_types: Any, layer: SemanticLayer) -> None:
    written = semantic_map(layer, ros1_types, STAMP)
    assert ros1_types.encoded(ros1_types.sent(written)) == ros1_types.encoded(written)


@given(shapes=st.lists(areas(), max_size=5))
def test_many_outlines_are_those_of_each(shapes: list[Any]) -> None:
    points_xy, starts = outlines(as_objects(shapes))
    assert len(starts) == len(shapes) + 1
    assert starts[-1] == len(points_xy)
    for shape, start, end in zip(shapes, starts[:-1], starts[1:], strict=True):
        assert np.array_equal(points_xy[start:end], outline(shape))


def test_of_parts_without_points_or_area_one_with_points_is_the_outline() -> None:
    line = shapely.Polygon([(0, 0), (1, 1), (2, 2)])
    shape = shapely.MultiPolygon([shapely.Polygon(), line, line])
    points_xy, starts = outlines(as_objects([shape]))
    assert points_xy.tolist() == outline(shape).tolist() == [[0, 0], [1, 1], [2, 2]]
    assert starts.tolist() == [0, 3]


def test_tags_and_their_confidence_are_sent(types: Any) -> None:
    item = square("Tür", 0, 0, tags=("door", "Tor"), confidence=(0.75, 0.1))
    (got,) = types.sent(semantic_map(SemanticLayer("s", "map", [item]), types, STAMP)).objects
    assert (got.name, list(got.tags), list(got.confidence)) == (
        "Tür",
        ["door", "Tor"],
        [0.75, 0.1],
    )


def with_everything() -> SemanticObject:
    frame = shapely.box(0, 0, 4, 4).difference(shapely.box(1, 1, 2, 2))
    return SemanticObject(
        "shelf",
        shapely.MultiPolygon([shapely.box(10, 0, 11, 1), frame]),
        id=7,
        existence=3.5,
        first_seen=10.25,
        last_seen=20.5,
        attributes={"z": math.inf, "day": datetime.date(2026, 1, 2), "list": [1, "ä"], "n": None},
    )


def test_all_that_is_known_of_an_object_is_sent(types: Any) -> None:
    layer = SemanticLayer("things", "map", [with_everything(), square("cup", 0, 0)])
    got = types.sent(object_state_array(layer, types, STAMP))
    shelf, cup = got.objects
    assert (shelf.layer, shelf.object.id, shelf.area) == ("things", 7, 16.0)
    assert (shelf.existence, shelf.first_seen, shelf.last_seen) == (3.5, 10.25, 20.5)
    assert len(shelf.object.shape.points) == 4  # of the larger part
    assert [(len(part.exterior.points), len(part.holes)) for part in shelf.parts] == [
        (4, 0),
        (4, 1),
    ]
    parts = [shapely.Polygon(ring(p.exterior), [*map(ring, p.holes)]) for p in shelf.parts]
    assert shapely.equals(shapely.MultiPolygon(parts), with_everything().footprint)
    assert json.loads(shelf.attributes) == {
        "z": "inf",
        "day": "2026-01-02",
        "list": [1, "ä"],
        "n": None,
    }
    assert math.isnan(cup.existence)
    assert math.isnan(cup.first_seen)
    assert math.isnan(cup.last_seen)
    assert cup.attributes == "{}"


def test_what_a_question_has_found_is_in_the_base_frame(types: Any) -> None:
    hypermap = Hypermap(
        [occupancy_from_text(".."), SemanticLayer("s", "lab", [square("cup", 1, 0, id=4)])],
        FrameTree([Transform("map", "lab", Pose2D(10, 0, math.pi / 2))]),
    )
    (state,) = map(types.sent, object_states(hypermap.objects("cup"), types))
    assert (state.object.id, state.layer) == (4, "s")
    assert (state.object.position.x, state.object.position.y) == pytest.approx((10, 1))
    assert shapely.Polygon(ring(state.object.shape)).bounds == pytest.approx((9.5, 0.5, 10.5, 1.5))
    found = hypermap.objects("cup")
    (item,) = types.sent(objects_reply(types, "hypermap_msgs/GetSemanticByString", found)).objects
    assert (item.id, item.name, list(item.tags)) == (4, "cup", list(state.object.tags))
    assert (item.position.x, item.position.y) == pytest.approx((10, 1))
    assert ring(item.shape) == ring(state.object.shape)


def test_hits_that_are_no_objects_are_left_out(types: Any) -> None:
    hypermap = Hypermap([occupancy_from_text("..")])
    assert object_states(hypermap.nearest("Free", [0, 0], 2, "occupancy"), types) == []


def test_the_area_of_a_bow_tie_is_that_of_both_halves(types: Any) -> None:
    bow_tie = shapely.Polygon([(0, 0), (2, 2), (2, 0), (0, 2)])
    layer = SemanticLayer("s", "map", [SemanticObject("tie", bow_tie)])
    assert object_state_array(layer, types, STAMP).objects[0].area == pytest.approx(2.0)


# The map


def test_meta_data_tell_layers_and_their_flags(types: Any) -> None:
    occupancy = occupancy_from_text("..")
    occupancy.settings["publish_global_topics"] = True
    semantic = SemanticLayer("s", "/lab", settings={"subscribe_mode": True, "enable_update": False})
    got = types.sent(hypermap_meta_data(Hypermap([occupancy, semantic]), "/node", types))
    assert (got.layer_cnt, got.node_name) == (2, "/node")
    reported = [
        (
            layer.class_name,
            layer.name,
            layer.frame_id,
            layer.subscribe_mode,
            layer.enable_update,
            layer.publish_global_topics,
        )
        for layer in got.layers
    ]
    assert reported == [
        ("OccupancyGridLayer", "occupancy", "map", False, True, True),
        ("SemanticLayer", "s", "lab", True, False, False),
    ]


def test_every_frame_of_a_layer_is_a_transform_from_the_base_frame(types: Any) -> None:
    tree = FrameTree(
        [
            Transform("map", "floor", Pose2D(1, 0, math.pi / 2)),
            Transform("floor", "lab", Pose2D(2, 0)),
        ]
    )
    layers = [
        occupancy_from_text(".."),
        SemanticLayer("a", "lab"),
        SemanticLayer("b", "lab"),
        SemanticLayer("c", "lost"),
    ]
    (got,) = layer_transforms(Hypermap(layers, tree), types, STAMP)
    got = types.sent(got)
    assert (got.header.frame_id, got.child_frame_id) == ("map", "lab")
    assert nanoseconds(got.header.stamp) == STAMP
    moved, turned = got.transform.translation, got.transform.rotation
    assert (moved.x, moved.y, moved.z) == pytest.approx((1, 2, 0))
    assert (turned.x, turned.y, turned.z, turned.w) == pytest.approx(
        (0, 0, math.sqrt(0.5), math.sqrt(0.5))
    )


# Geometry


@SHARED
@given(area=areas())
def test_a_polygon_is_the_largest_part_s_outer_ring(types: Any, area: Any) -> None:
    got = types.sent(polygon_stamped(area, "/map", types, STAMP))
    largest = max(shapely.get_parts(area), key=lambda part: part.area)
    sent = shapely.get_coordinates(largest.exterior)[:-1].astype(np.float32)
    assert got.header.frame_id == "map"
    assert ring(got.polygon) == [tuple(point) for point in sent.tolist()]


@pytest.mark.parametrize("shape", [shapely.Polygon(), shapely.MultiPolygon(), shapely.Point(1, 2)])
def test_what_has_no_outline_is_a_polygon_without_points(types: Any, shape: Any) -> None:
    assert len(types.sent(polygon_stamped(shape, "map", types, STAMP)).polygon.points) == 0


def test_float32_costs_a_millimetre_at_ten_kilometres(types: Any) -> None:
    far = shapely.box(10_000.0001, 0, 10_001, 1)
    got = types.sent(polygon_stamped(far, "map", types, STAMP))
    assert abs(shapely.Polygon(ring(got.polygon)).bounds[0] - 10_000.0001) < 1e-3


# Arrays


class LikeRclpy:
    """A class of neither genpy nor rosbags."""


@pytest.mark.parametrize(
    ("dtype", "typecode"), [(np.int8, "b"), (np.int32, "i"), (np.float64, "d"), (np.uint8, "B")]
)
def test_rclpy_gets_the_arrays_that_it_does_not_look_through(dtype: Any, typecode: str) -> None:
    values = np.arange(5).astype(dtype)[::2]
    got = numbers(LikeRclpy, values)
    assert isinstance(got, array.array)
    assert (got.typecode, got.tolist()) == (typecode, [0, 2, 4])
