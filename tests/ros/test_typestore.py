from __future__ import annotations

import array
import subprocess
import sys

import numpy as np
import pytest
from rosbags.typesys import get_types_from_msg

from hypermap.core.errors import HypermapError
from hypermap.ros.definitions import package_folder
from hypermap.ros.typestore import (
    decode,
    definition,
    encode,
    message_class,
    request_class,
    response_class,
    stamp,
    typestore,
)

MESSAGES = sorted(file.stem for file in package_folder().glob("msg/*.msg"))
SERVICES = sorted(file.stem for file in package_folder().glob("srv/*.srv"))
CDR_HEAD = b"\x00\x01\x00\x00"
NUMBERS = [[1, 0, 255], (1, 0, 255), b"\x01\x00\xff", array.array("B", [1, 0, 255])]


def round_trip(message):
    return decode(encode(message), type(message))


def test_messages_have_the_defaults_of_ros():
    marker = message_class("visualization_msgs/Marker")()
    assert (marker.ns, marker.id, marker.points, marker.frame_locked) == ("", 0, [], False)
    assert marker.pose.orientation.w == 1.0
    assert marker.TRIANGLE_LIST == 11
    camera = message_class("sensor_msgs/CameraInfo")()
    assert camera.k.tolist() == [0.0] * 9


def test_two_messages_share_nothing():
    cls = message_class("hypermap_msgs/SemanticMap")
    one, other = cls(), cls()
    one.objects.append(1)
    one.header.frame_id = "map"
    assert (other.objects, other.header.frame_id) == ([], "")


THREADS = """
import threading
from hypermap.ros.typestore import decode, encode, message_class

start, found = threading.Barrier(8), []

def make():
    start.wait()
    message = message_class("hypermap_msgs/SemanticMap")()
    found.append((type(message), decode(encode(message), type(message)) == message))

threads = [threading.Thread(target=make) for _ in range(8)]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
assert len(set(found)) == 1 and found[0][1], found
"""


def test_threads_that_need_a_type_at_once_get_the_same():
    subprocess.run([sys.executable, "-c", THREADS], check=True, timeout=120)


def test_a_misspelt_field_is_an_error():
    grid = message_class("nav_msgs/OccupancyGrid")()
    with pytest.raises(AttributeError):
        grid.dat = []
    with pytest.raises(TypeError):
        message_class("nav_msgs/OccupancyGrid")(dat=[])


@pytest.mark.parametrize("values", [*NUMBERS, np.array([1, 0, 255]), np.uint8([1, 0, 255])])
def test_bytes_are_taken_in_any_form(values):
    image = message_class("sensor_msgs/Image")(data=values)
    assert round_trip(image).data.tobytes() == b"\x01\x00\xff"


def test_arrays_deep_inside_are_taken_in_any_form():
    semantic_object = message_class("hypermap_msgs/SemanticObject")
    objects = [semantic_object(tags=["a"], confidence=[0.5]), semantic_object(confidence=(1,))]
    semantic_map = round_trip(message_class("hypermap_msgs/SemanticMap")(objects=objects))
    assert [item.confidence.tolist() for item in semantic_map.objects] == [[0.5], [1.0]]
    camera = message_class("sensor_msgs/CameraInfo")(k=range(9))
    assert round_trip(camera).k.tolist() == list(range(9))


def test_what_was_decoded_can_be_filled_and_sent_again():
    cls = message_class("hypermap_msgs/SemanticMap")
    semantic_map = round_trip(cls())
    semantic_map.objects = [message_class("hypermap_msgs/SemanticObject")(name="chair")]
    again = round_trip(semantic_map)
    assert again == semantic_map
    assert type(again.objects[0]) is message_class("hypermap_msgs/SemanticObject")
    assert again != cls()


def test_the_bytes_are_those_of_cdr():
    update = message_class("map_msgs/OccupancyGridUpdate")(x=1, y=-2, width=2, height=1)
    update.header.frame_id = "map"
    update.header.stamp = stamp(3_000_000_004)
    update.data = [100, -1]
    # Little endian; a text has its length with its final 0; numbers lie at multiples of their size.
    assert encode(update).hex(" ", -4) == (
        "00010000 03000000 04000000 04000000 6d617000 01000000 feffffff 02000000 01000000 "
        "02000000 64ff"
    )


def test_types_are_those_that_ros_2_knows():
    # Source: the hash that `ros2 topic info --verbose` shows for std_msgs/msg/String.
    assert typestore().hash_rihs01("std_msgs/msg/String") == (
        "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
    )


@pytest.mark.parametrize("name", ["nav_msgs/GetMap", "std_srvs/Empty", "std_srvs/Trigger"])
def test_requests_without_fields_are_one_byte(name):
    request = request_class(name)()
    assert encode(request) == b"\x00\x01\x00\x00\x00"
    for data in (encode(request), b"\x00\x01\x00\x00", b""):  # as several clients send it
        assert decode(data, type(request)) == request


@pytest.mark.parametrize("name", MESSAGES)
def test_every_message_of_ours_survives_a_round_trip(name):
    message = message_class(f"hypermap_msgs/{name}")()
    assert round_trip(message) == message


@pytest.mark.parametrize("name", SERVICES)
def test_every_service_of_ours_survives_a_round_trip(name):
    for message in (
        request_class(f"hypermap_msgs/{name}")(),
        response_class(f"hypermap_msgs/srv/{name}")(),
    ):
        assert round_trip(message) == message


@pytest.mark.parametrize(
    "name",
    [
        *[f"hypermap_msgs/{name}" for name in MESSAGES],
        "darknet_ros_msgs/BoundingBoxes",
        "map_msgs/OccupancyGridUpdate",
        "nav2_msgs/CostmapFilterInfo",
        "tf2_msgs/TFMessage",
        "vision_msgs/Detection2DArray",
        "visualization_msgs/MarkerArray",
    ],
)
def test_a_definition_is_complete(name):
    cls = message_class(name)
    read = get_types_from_msg(definition(cls), cls.__msgtype__)
    fields = typestore().fielddefs

    def named(kind):
        _, rest = kind
        if isinstance(rest, str):
            yield rest
        elif isinstance(rest[0], tuple):
            yield from named(rest[0])

    missing = [
        inner
        for _, kinds in read.values()
        for _, kind in kinds
        for inner in named(kind)
        if inner not in read
    ]
    assert missing == []
    assert {name: [f for f, _ in kinds] for name, (_, kinds) in read.items()} == {
        name: [f for f, _ in fields[name][1]] for name in read
    }


def test_fields_are_those_of_ros_1(needs_ros1):
    from hypermap.ros.ros1.messages import message_class as ros1_class
    from hypermap.ros.ros1.messages import service_class

    for name in [*[f"hypermap_msgs/{name}" for name in MESSAGES], "map_msgs/OccupancyGridUpdate"]:
        assert list(message_class(name).__dataclass_fields__) == ros1_class(name).__slots__
    for name in SERVICES:
        service = service_class(f"hypermap_msgs/{name}")
        request, response = (
            half(f"hypermap_msgs/{name}") for half in (request_class, response_class)
        )
        assert list(request.__dataclass_fields__) == service._request_class.__slots__
        assert list(response.__dataclass_fields__) == service._response_class.__slots__


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        (
            "nav_msgs/OcupancyGrid",
            "the type 'nav_msgs/OcupancyGrid' is unknown; did you mean 'nav_msgs/OccupancyGrid'?",
        ),
        (
            "hypermap_msgs/GetIntAtPoint",
            "the type 'hypermap_msgs/GetIntAtPoint' is unknown; did you mean "
            "'hypermap_msgs/GetIntAtPoint_Request'?",
        ),
    ],
)
def test_an_unknown_type_is_named(name, expected):
    with pytest.raises(HypermapError) as error:
        message_class(name)
    assert str(error.value) == expected


@pytest.mark.parametrize(
    "data", [b"", b"abc", b"\x00\x01\x00\x00", b"\x00\x01\x00\x00" + b"\xff" * 40]
)
def test_bytes_that_are_no_message_are_an_error(data):
    with pytest.raises(HypermapError, match=rf"these {len(data)} bytes are not a valid nav_msgs"):
        decode(data, message_class("nav_msgs/OccupancyGrid"))


@pytest.mark.parametrize(
    ("name", "fields"),
    [
        ("std_msgs/String", {"data": 3}),
        ("std_msgs/Int32", {"data": 2**40}),
        ("std_msgs/Int32", {"data": "x"}),
        ("nav_msgs/OccupancyGrid", {"data": ["x"]}),
        ("nav_msgs/OccupancyGrid", {"header": None}),
        ("sensor_msgs/CameraInfo", {"k": [1.0]}),
    ],
)
def test_a_field_of_another_type_is_an_error(name, fields):
    with pytest.raises(HypermapError, match=name.replace("/", "/msg/")):
        encode(message_class(name)(**fields))
