"""Answers built from arrays: the same bytes as those built from objects."""

from __future__ import annotations

import io
import struct
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from hypermap.core.arrays import as_objects
from hypermap.core.grid import GridGeometry
from hypermap.core.layer import Hits
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticLayer
from hypermap.ros.messages.geometry_messages import points_of_rows
from hypermap.ros.messages.replies import (
    area_hits,
    as_int32,
    hits_reply,
    ints_reply,
    locations_reply,
    map_reply,
    strings_reply,
)
from hypermap.ros.messages.to_messages import occupancy_grid, semantic_map
from hypermap.ros.ros1.arrays import writing_arrays
from hypermap.testing.builders import square
from hypermap.testing.strategies import occupancy_layers

from .strict_messages import StrictTypes, humble_store, jazzy_store

SHARED = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=40)

floats = st.floats(allow_nan=False, allow_infinity=False)
places = st.lists(st.tuples(floats, floats), max_size=12).map(
    lambda items: np.array(items, dtype=np.float64).reshape(-1, 2)
)
texts = st.text(st.characters(exclude_categories=["Cs"]), max_size=8)


@st.composite
def hits(draw: st.DrawFn, values: Any) -> Hits:
    points = draw(places)
    return Hits(as_objects([draw(values) for _ in points]), points)


@st.composite
def numbered(draw: st.DrawFn) -> Hits:
    found = draw(hits(st.integers(-(2**31), 2**31 - 1)))
    return Hits(found.values.astype(draw(st.sampled_from([np.int64, np.int32]))), found.points_xy)


def objects(types: Any, points_xy: NDArray[np.float64]) -> list[Any]:
    point = types.message("geometry_msgs/Point")
    return [point(x=float(x), y=float(y), z=0.0) for x, y in points_xy]


@SHARED
@given(found=hits(texts))
def test_labels_make_the_bytes_of_objects(types: Any, found: Hits) -> None:
    plain = types.response("hypermap_msgs/GetStringsByArea")(
        names=[str(value) for value in found.values], locations=objects(types, found.points_xy)
    )
    assert types.encoded(strings_reply(types, found)) == types.encoded(plain)


@SHARED
@given(found=numbered())
def test_numbers_make_the_bytes_of_objects(types: Any, found: Hits) -> None:
    plain = types.response("hypermap_msgs/GetIntsByArea")(
        values=[int(value) for value in found.values], locations=objects(types, found.points_xy)
    )
    assert types.encoded(ints_reply(types, found)) == types.encoded(plain)


@SHARED
@given(points=places, service=st.sampled_from(["GetLocationsByString", "GetLocationsByInt"]))
def test_locations_make_the_bytes_of_objects(
    types: Any, points: NDArray[np.float64], service: str
) -> None:
    plain = types.response(f"hypermap_msgs/{service}")(locations=objects(types, points))
    got = locations_reply(types, f"hypermap_msgs/{service}", points)
    assert types.encoded(got) == types.encoded(plain)


@SHARED
@given(found=numbered(), frame=texts)
def test_hits_in_areas_make_the_bytes_of_objects(types: Any, found: Hits, frame: str) -> None:
    labels = Hits(as_objects(str(value) for value in found.values), found.points_xy)
    plain = types.response("hypermap_msgs/GetHitsInAreas")(
        success=True,
        message="",
        frame_id=frame,
        hits=[
            types.message("hypermap_msgs/AreaHits")(
                labels=labels.values.tolist(),
                values=[int(value) for value in found.values],
                locations=objects(types, found.points_xy),
            )
        ]
        * 2,
    )
    got = hits_reply(types, frame, [area_hits(types, labels, found)] * 2)
    assert types.encoded(got) == types.encoded(plain)


@SHARED
@given(layer=occupancy_layers())
def test_a_map_makes_the_bytes_of_lists(types: Any, layer: OccupancyLayer) -> None:
    got = map_reply(types, layer, 5_000_000_007)
    assert layer.cells is not None
    plain = types.response("nav_msgs/GetMap")(
        map=types.message("nav_msgs/OccupancyGrid")(
            header=got.map.header, info=got.map.info, data=layer.cells.ravel().tolist()
        )
    )
    assert types.encoded(got) == types.encoded(plain)


def test_rospy_takes_them_for_the_service_s_own(ros1_types: Any) -> None:
    from rospy.impl.tcpros_service import convert_return_to_response

    kind = ros1_types.response("hypermap_msgs/GetIntsByArea")
    reply = ints_reply(ros1_types, Hits(np.array([1]), np.zeros((1, 2))))
    assert convert_return_to_response(reply, kind) is reply


def test_rospy_numbers_the_header_of_a_published_grid(ros1_types: Any) -> None:
    from rospy.msg import serialize_message

    layer = OccupancyLayer("o", "map", GridGeometry(2, 1, 0.5), np.array([[0, 100]], np.int8))
    message = map_reply(ros1_types, layer, 0).map
    buffer = io.BytesIO()
    serialize_message(buffer, 77, message)
    (length,) = struct.unpack_from("<I", buffer.getvalue())
    got = ros1_types.message("nav_msgs/OccupancyGrid")().deserialize(buffer.getvalue()[4:])
    assert length == len(buffer.getvalue()) - 4
    assert (got.header.seq, got.data) == (77, (0, 100))


@pytest.mark.xdist_group("ros")
def test_a_client_of_rospy_reads_them(rospy: Any, ros1_types: Any) -> None:
    from hypermap.ros.ros1.messages import service_class

    kind = service_class("hypermap_msgs/GetStringsByArea")
    found = Hits(as_objects(["chair", "Tür", "chair"]), np.array([[1.5, 2], [3, 4], [5, 6]]))
    service = rospy.Service("~replies", kind, lambda _: strings_reply(ros1_types, found))
    client = rospy.ServiceProxy(service.resolved_name, kind, persistent=True)
    try:
        for _ in range(2):
            got = client()
            assert got.names == ["chair", "Tür", "chair"]
            assert [(at.x, at.y, at.z) for at in got.locations] == [
                (1.5, 2, 0),
                (3, 4, 0),
                (5, 6, 0),
            ]
    finally:
        client.close()
        service.shutdown()


@pytest.mark.xdist_group("ros")
def test_a_late_subscriber_of_rospy_gets_grid_and_objects(rospy: Any, ros1_types: Any) -> None:
    grid = OccupancyLayer("o", "map", GridGeometry(2, 1, 0.5), np.array([[0, 100]], np.int8))
    objects = SemanticLayer("s", "map", [square("cup", 1, 2, tags=["mug"], confidence=[0.5])])
    sent = {
        "nav_msgs/OccupancyGrid": occupancy_grid(grid, ros1_types, 5),
        "hypermap_msgs/SemanticMap": semantic_map(objects, ros1_types, 5),
    }
    for number, (name, message) in enumerate(sent.items()):
        topic, kind = f"~arrays{number}", ros1_types.message(name)
        publisher = rospy.Publisher(topic, kind, latch=True, queue_size=1)
        publisher.publish(message)
        got = rospy.wait_for_message(topic, kind, timeout=120)
        assert (got.header.frame_id, got.header.stamp.nsecs) == ("map", 5)
        if number == 0:
            assert got.data == (0, 100)
        else:
            (cup,) = got.objects
            assert (cup.name, cup.tags, cup.confidence) == ("cup", ["mug"], (0.5,))
            assert (cup.position.x, cup.position.y, len(cup.shape.points)) == (1, 2, 4)
        publisher.unregister()


def test_every_kind_of_field_is_written_as_genpy_does(ros1_types: Any) -> None:
    kind = ros1_types.response("hypermap_msgs/FindObjects")
    plain = kind(success=True, message="Tür", frame_id="map", objects=[], distances=[1.5, 2.5])
    state = ros1_types.message("hypermap_msgs/ObjectState")(layer="s", area=2.0)
    plain.objects = [state, state]
    arrays = writing_arrays(kind)(
        success=True,
        message="Tür",
        frame_id="map",
        objects=[state, state],
        distances=np.array([1.5, 2.5]),
    )
    assert ros1_types.encoded(arrays) == ros1_types.encoded(plain)
    state = writing_arrays(type(state))(layer="s", area=2.0)
    arrays.objects = [state, state]
    assert ros1_types.encoded(arrays) == ros1_types.encoded(plain)


@pytest.mark.parametrize(
    ("given_values", "expected"),
    [
        (np.array([-1, 100], np.int8), [-1, 100]),
        (np.array([0, 2**31 - 1]), [0, 2**31 - 1]),
        (np.array([2**40, -(2**40)]), [2**31 - 1, -(2**31)]),
        ([0.4, 0.6, -1.5, 1e30, -np.inf], [0, 1, -2, 2**31 - 1, -(2**31)]),
        ([np.nan], [-1]),
        ([], []),
    ],
)
def test_numbers_are_rounded_and_cut_to_32_bits(given_values: Any, expected: list[int]) -> None:
    got = as_int32(given_values)
    assert got.dtype == np.int32
    assert got.tolist() == expected


class Checked:
    """A point as rosidl generates it for Jazzy: one more slot, which setters look at."""

    __slots__ = ("_check_fields", "_x", "_y", "_z")

    def __init__(self, **fields: float) -> None:
        self._check_fields = True
        self._x, self._y, self._z = (fields.get(name, 0.0) for name in "xyz")


@pytest.mark.parametrize("store", [humble_store, jazzy_store])
def test_points_that_are_filled_are_those_that_are_made(store: Any) -> None:
    kind = StrictTypes(store()).message("geometry_msgs/Point")
    rows = np.array([[1.5, -2.0, 0.25], [np.nan, np.inf, 1e300]])
    for point, (x, y, z) in zip(points_of_rows(kind, rows), rows.tolist(), strict=True):
        made = kind(x=x, y=y, z=z)
        assert type(point) is kind
        assert repr((point.x, point.y, point.z)) == repr((made.x, made.y, made.z))
    (checked,) = points_of_rows(Checked, rows[:1])
    assert (checked._check_fields, checked._x, checked._y, checked._z) == (True, 1.5, -2.0, 0.25)
