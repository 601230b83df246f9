"""What clients send, in messages of ROS 1 and ROS 2 as their receiver gets them."""

from __future__ import annotations

import io
import math
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image

from hypermap.core.errors import FormatError
from hypermap.core.frames import FrameTree, Pose2D, Transform
from hypermap.core.hypermap import Hypermap
from hypermap.core.objects import SemanticObject
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticLayer
from hypermap.recordings.messages.camera import camera_of_info
from hypermap.recordings.messages.clouds import points_of_cloud
from hypermap.recordings.messages.compressed_depth import depth_of_compressed
from hypermap.recordings.messages.header import nanoseconds
from hypermap.recordings.messages.images import (
    color_of_compressed,
    color_of_image,
    depth_of_image,
)
from hypermap.recordings.messages.occupancy import occupancy_of_grid
from hypermap.recordings.messages.transforms import TransformLog
from hypermap.ros.messages.from_messages import (
    apply_semantic_update,
    area_of,
    crosses_itself,
    is_empty_area,
    point_of,
    semantic_objects_of,
    with_grid_update,
)
from hypermap.ros.messages.to_messages import layer_transforms, semantic_map
from hypermap.testing.builders import occupancy_from_text, square
from hypermap.testing.strategies import polygons, semantic_layers

SHARED = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=40)
NAN = math.nan

SQUARE = [(0, 0), (2, 0), (2, 2), (0, 2)]
BOW_TIE = [(0, 0), (2, 2), (2, 0), (0, 2)]
MALFORMED = [
    ([], "0 different points; three are needed"),
    ([(1, 2)], "1 different point"),
    ([(0, 0), (1, 0)], "2 different points"),
    ([(0, 0), (1, 0), (0, 0)], "2 different points"),
    ([(0, 0), (1, 0), (0, 0), (1, 0)], "2 different points"),
    ([(1, 1), (1, 1), (1, 1), (1, 1)], "1 different point"),
    ([(0, 0), (1, 0), (NAN, 1)], "not finite"),
    ([(0, 0), (1, 0), (1, math.inf)], "not finite"),
]


def polygon(types: Any, points: Any) -> Any:
    point = types.message("geometry_msgs/Point32")
    return types.message("geometry_msgs/Polygon")(
        points=[point(x=float(x), y=float(y), z=7.0) for x, y in points]
    )


def area(types: Any, points: Any, frame: str = "map") -> Any:
    message = types.message("geometry_msgs/PolygonStamped")(polygon=polygon(types, points))
    message.header.frame_id = frame
    return types.sent(message)


def item(types: Any, name: str, points: Any, number: int = 0, **others: Any) -> Any:
    return types.message("hypermap_msgs/SemanticObject")(
        id=number, name=name, shape=polygon(types, points), **others
    )


def semantic(types: Any, *items: Any) -> Any:
    return types.sent(types.message("hypermap_msgs/SemanticMap")(objects=list(items)))


def update(types: Any, **fields: Any) -> Any:
    return types.sent(types.message("hypermap_msgs/SemanticMapUpdate")(**fields))


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
    with pytest.raises(FormatError, match=f"the area is no polygon: .*{reason}"):
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


def test_an_area_without_points_is_told_from_others(types: Any) -> None:
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
    assert problems == [
        "object 3 ('tie'): its outline crosses itself; all that it winds around is taken"
    ]
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


# Updates of objects


def things() -> SemanticLayer:
    frame = shapely.box(0, 0, 4, 4).difference(shapely.box(1, 1, 2, 2))
    shelf = SemanticObject("shelf", frame, existence=3.5, attributes={"color": "red"})
    return SemanticLayer("things", "map", [shelf, square("cup", 9, 9), square("bin", 7, 7)])


def test_an_update_adds_changes_and_removes(types: Any) -> None:
    layer = things()
    message = update(
        types,
        to_add=[item(types, "plant", SQUARE, 1), item(types, "door", SQUARE, 1)],
        to_modify=[2, 0],
        updates=[item(types, "basket", SQUARE, 99), item(types, "rack", SQUARE)],
        to_delete=[1],
    )
    assert apply_semantic_update(layer, message) == []
    held = {got.id: got for got in layer.objects()}
    assert {number: got.name for number, got in held.items()} == {
        0: "rack",
        2: "basket",
        3: "plant",
        4: "door",
    }
    assert held[2].footprint.equals(shapely.Polygon(SQUARE))
    assert (held[0].existence, held[0].attributes) == (3.5, {"color": "red"})


def test_a_new_name_keeps_the_exact_shape(types: Any) -> None:
    layer = things()
    before = layer.get(0).footprint
    (sent, *_) = types.sent(semantic_map(layer, types, 0)).objects
    sent.name = "rack"
    assert apply_semantic_update(layer, update(types, to_modify=[0], updates=[sent])) == []
    assert layer.get(0).name == "rack"
    assert layer.get(0).footprint.equals_exact(before)
    assert len(layer.get(0).footprint.interiors) == 1


@pytest.mark.parametrize(
    ("fields", "error"),
    [
        ({"to_modify": [0, 1]}, "names 2 objects to modify, but brings 1 new states"),
        ({"to_modify": []}, "names 0 objects to modify, but brings 1"),
        ({"to_modify": [77]}, "layer 'things' has no object with id 77"),
        ({"to_modify": [2**32 - 1]}, "no object with id 4294967295"),
        ({"to_modify": [0], "to_delete": [50]}, "no object with id 50"),
        ({"to_modify": [1], "to_delete": [1]}, "changes object 1 twice"),
    ],
)
def test_of_an_update_that_contradicts_itself_nothing_is_applied(
    types: Any, fields: Any, error: str
) -> None:
    layer = things()
    message = update(
        types,
        to_add=[item(types, "plant", SQUARE)],
        updates=[item(types, "new", SQUARE)],
        **fields,
    )
    with pytest.raises(FormatError, match=error):
        apply_semantic_update(layer, message)
    assert layer.names.tolist() == ["shelf", "cup", "bin"]


def test_two_states_of_one_object_are_a_contradiction(types: Any) -> None:
    states = [item(types, "a", SQUARE), item(types, "b", SQUARE)]
    with pytest.raises(FormatError, match="changes object 1 twice"):
        apply_semantic_update(things(), update(types, to_modify=[1, 1], updates=states))


def test_a_malformed_shape_in_an_update_leaves_that_object_out(types: Any) -> None:
    layer = things()
    message = update(
        types,
        to_add=[item(types, "line", SQUARE[:2]), item(types, "plant", SQUARE)],
        to_modify=[1, 2],
        updates=[item(types, "mug", [(0, 0), (NAN, 0), (1, 1)]), item(types, "box", SQUARE)],
    )
    assert apply_semantic_update(layer, message) == [
        "to_add 0 ('line') is left out: its shape has 2 different points; three are needed",
        "object 1 ('mug') is left out: its shape has a coordinate that is not finite",
    ]
    assert layer.names.tolist() == ["shelf", "cup", "box", "plant"]


# Updates of cells


def grid_update(types: Any, x: int, y: int, width: int, cells: Any, frame: str = "map") -> Any:
    message = types.message("map_msgs/OccupancyGridUpdate")(
        x=x, y=y, width=width, height=len(cells) // max(width, 1), data=np.array(cells, np.int8)
    )
    message.header.frame_id = frame
    return types.sent(message)


def held(layer: OccupancyLayer) -> list[list[int]]:
    assert layer.cells is not None
    return layer.cells.tolist()


def test_a_window_is_put_into_the_grid(types: Any) -> None:
    layer = occupancy_from_text("....\n....\n....")
    layer.settings["enable_update"] = True
    got = with_grid_update(layer, grid_update(types, 1, 0, 2, [100, -1, 57, 100], "/map"))
    assert held(got) == [[0, 100, -1, 0], [0, 57, 100, 0], [0, 0, 0, 0]]
    assert (got.name, got.frame_id, got.grid) == (layer.name, layer.frame_id, layer.grid)
    assert got.settings == layer.settings
    assert not np.any(layer.cells)  # the old one is as it was


def test_a_window_without_cells_changes_nothing(types: Any) -> None:
    got = with_grid_update(occupancy_from_text(".#"), grid_update(types, 1, 0, 0, []))
    assert held(got) == [[0, 100]]


@pytest.mark.parametrize(
    ("x", "y", "width", "cells", "error"),
    [
        (3, 0, 2, [0, 0], r"2 x 1 cells at \(3, 0\) reach out of the map of 4 x 3 cells"),
        (-1, 0, 2, [0, 0], "reach out of the map"),
        (0, -1, 1, [0, 0], "reach out of the map"),
        (0, 2, 1, [0, 0], "reach out of the map"),
        (0, 0, 2, [0, 101], r"must be -1 \.\. 100, found 0 \.\. 101"),
        (0, 0, 2, [-2, 0], r"must be -1 \.\. 100"),
    ],
)
def test_a_wrong_window_is_refused(
    types: Any, x: int, y: int, width: int, cells: Any, error: str
) -> None:
    layer = occupancy_from_text("....\n....\n....")
    with pytest.raises(FormatError, match=error):
        with_grid_update(layer, grid_update(types, x, y, width, cells))


def test_a_window_with_too_few_cells_is_refused(types: Any) -> None:
    message = grid_update(types, 0, 0, 2, [0, 0])
    message.height = 2
    with pytest.raises(FormatError, match="2 x 2 cells holds 2 numbers"):
        with_grid_update(occupancy_from_text("..\n.."), message)


def test_a_window_of_another_frame_is_refused(types: Any) -> None:
    message = grid_update(types, 0, 0, 1, [0], "odom")
    with pytest.raises(FormatError, match="for frame 'odom', but layer 'occupancy' is in 'map'"):
        with_grid_update(occupancy_from_text(".."), message)


def test_an_empty_layer_takes_no_window(types: Any) -> None:
    with pytest.raises(FormatError, match="is empty; an update needs a map"):
        with_grid_update(OccupancyLayer("o", "map"), grid_update(types, 0, 0, 1, [0]))


# What the recordings' functions make of messages that rospy has received


def sensor(types: Any, name: str, **fields: Any) -> Any:
    message = types.message(f"sensor_msgs/{name}")(**fields)
    message.header.stamp = types.stamp(1_700_000_000_000_000_123)
    got = types.sent(message)
    assert nanoseconds(got.header.stamp) == 1_700_000_000_000_000_123
    return got


def octets(types: Any, array: Any) -> Any:
    """Return bytes as a publisher fills them in."""
    content = array if isinstance(array, bytes) else np.ascontiguousarray(array).tobytes()
    return np.frombuffer(content, np.uint8) if hasattr(types, "_decode") else content


def test_images_are_read(types: Any) -> None:
    depth = np.array([[1000, 0], [250, 500]], np.uint16)
    got = sensor(
        types, "Image", height=2, width=2, encoding="16UC1", step=4, data=octets(types, depth)
    )
    assert np.array_equal(
        depth_of_image(got, 1000.0), np.float32([[1, NAN], [0.25, 0.5]]), equal_nan=True
    )
    rgb = np.arange(12, dtype=np.uint8).reshape(2, 2, 3)
    got = sensor(
        types, "Image", height=2, width=2, encoding="rgb8", step=6, data=octets(types, rgb)
    )
    assert np.array_equal(color_of_image(got), rgb)


def test_compressed_images_are_read(types: Any) -> None:
    rgb = np.arange(12, dtype=np.uint8).reshape(2, 2, 3)
    png = io.BytesIO()
    Image.fromarray(rgb).save(png, "PNG")
    got = sensor(types, "CompressedImage", format="png", data=octets(types, png.getvalue()))
    assert np.array_equal(color_of_compressed(got), rgb)
    png = io.BytesIO()
    Image.fromarray(np.array([[1000, 2000]], np.uint16)).save(png, "PNG")
    got = sensor(
        types,
        "CompressedImage",
        format="16UC1; compressedDepth png",
        data=octets(types, bytes(12) + png.getvalue()),
    )
    assert depth_of_compressed(got, 1000.0).tolist() == [[1.0, 2.0]]


def test_clouds_are_read(types: Any) -> None:
    xyz = np.arange(1, 13, dtype=np.float32).reshape(2, 2, 3)
    part = types.message("sensor_msgs/PointField")
    fields = [part(name=n, offset=4 * i, datatype=7, count=1) for i, n in enumerate("xyz")]
    got = sensor(
        types,
        "PointCloud2",
        height=2,
        width=2,
        fields=fields,
        point_step=12,
        row_step=24,
        data=octets(types, xyz),
    )
    points, color = points_of_cloud(got)
    assert np.array_equal(points, xyz)
    assert color is None


def test_a_camera_info_is_read_however_its_fields_are_spelled(types: Any) -> None:
    message = types.message("sensor_msgs/CameraInfo")(width=320, height=240)
    K = np.array([300.0, 0, 160, 0, 310, 120, 0, 0, 1])
    setattr(message, "K" if hasattr(message, "K") else "k", K)
    camera = camera_of_info(types.sent(message), 320, 240, is_rectified=False)
    assert np.array_equal(camera.K.ravel(), K)


def test_transforms_are_read(types: Any) -> None:
    tree = FrameTree([Transform("map", "lab", Pose2D(1, 2, 0.5))])
    hypermap = Hypermap([occupancy_from_text("."), SemanticLayer("s", "lab")], tree)
    message = types.message("tf2_msgs/TFMessage")(transforms=layer_transforms(hypermap, types, 5))
    log = TransformLog()
    log.add(types.sent(message), is_static=True)
    frames, notes = log.frames(1.0)
    assert notes == []
    (map_T_lab,) = frames.motion("map", "lab").at([0.0])
    assert map_T_lab[:2, 3].tolist() == [1, 2]


def test_a_grid_of_integers_out_of_range_is_refused(types: Any) -> None:
    message = types.message("nav_msgs/OccupancyGrid")(data=np.array([0, 101], np.int8))
    message.info.width, message.info.height, message.info.resolution = 2, 1, 0.05
    message.info.origin.orientation.w = 1.0
    with pytest.raises(FormatError, match=r"must be -1 \.\. 100, found 0 \.\. 101"):
        occupancy_of_grid(types.sent(message))
