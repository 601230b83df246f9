"""Topics, services, types, frames and the log of a node of ROS 2."""

from __future__ import annotations

import array
import importlib
import sys
import threading
from typing import Any

import numpy as np
import pytest

from hypermap.core.errors import FrameError, HypermapError

from .conftest import wait_for
from .fake_rclpy import other_node
from .fake_rclpy_node import Graph
from .fake_rclpy_values import (
    ClockType,
    DurabilityPolicy,
    MutuallyExclusiveCallbackGroup,
    QoSProfile,
    ReentrantCallbackGroup,
    ReliabilityPolicy,
)
from .ros2_fixtures import Idle, graph, make_port, port

__all__ = ["graph", "make_port", "port"]

LATE = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


# Names, topics and quality of service


def test_names_are_private_unless_they_start_with_a_slash(graph: Graph, make_port: Any) -> None:
    port = make_port("hypermap_server", "--ros-args", "-r", "__ns:=/robot", "-r", "__node:=maps")
    port.manage(Idle())
    assert port.node_name == "/robot/maps"
    port.publisher("occupancy_map", "nav_msgs/OccupancyGrid")
    port.publisher("/map", "nav_msgs/OccupancyGrid")
    port.service("get", "std_srvs/Trigger", lambda request: request, lambda text: text)
    assert {"/robot/maps/occupancy_map", "/map"} <= graph.topics().keys()
    assert "/robot/maps/get" in graph.services()
    assert {node.get_name() for node in graph.nodes} == {"maps", "maps_tf"}


def test_remapped_tf_topics_are_heeded(graph: Graph, make_port: Any) -> None:
    remaps = ("--ros-args", "-r", "/tf:=/robot/tf", "-r", "/tf_static:=/robot/tf_static")
    port = make_port("hypermap_server", *remaps)
    port.manage(Idle())
    port.static_transforms([])
    assert graph.subscriptions("/robot/tf")
    assert graph.publishers("/robot/tf_static")


@pytest.mark.parametrize("name", ["a b", "2d map", "käse", ""])
def test_a_name_that_ros_does_not_allow_is_an_error(port: Any, name: str) -> None:
    with pytest.raises(HypermapError, match="does not allow the name"):
        port.publisher(name or "a//b", "std_msgs/String")


def test_latched_topics_reach_those_that_come_later(graph: Graph, port: Any) -> None:
    publisher = port.publisher("text", "std_msgs/String", latched=True)
    string = port.message("std_msgs/String")
    publisher.publish(string(data="old"))
    publisher.publish(string(data="new"))
    received: list[str] = []
    with other_node(graph) as node:
        topic = "/hypermap_server/text"
        node.create_subscription(string, topic, lambda m: received.append(m.data), LATE)
        wait_for(lambda: received, "what was published")
        assert publisher.listeners == 1
        publisher.publish(string(data="newer"))
    assert received == ["new", "newer"]
    assert publisher.listeners == 0
    (made,) = graph.publishers("/hypermap_server/text")
    assert (made.qos.reliability, made.qos.depth) == (ReliabilityPolicy.RELIABLE, 1)


def test_the_type_of_a_topic_is_known_once_someone_publishes_it(graph: Graph, port: Any) -> None:
    assert port.topic_type("/warm") is None
    with other_node(graph, "thermometer") as node:
        node.create_publisher(port.message("sensor_msgs/Temperature"), "/warm", 1)
        assert port.topic_type("/warm") == "sensor_msgs/Temperature"


def test_our_latched_subscriptions_get_what_was_published_before(graph: Graph, port: Any) -> None:
    string, received = port.message("std_msgs/String"), []
    with other_node(graph) as node:
        node.create_publisher(string, "/map_name", LATE).publish(string(data="lab"))
        port.subscribe(
            "/map_name", "std_msgs/String", lambda m: received.append(m.data), latched=True
        )
        wait_for(lambda: received, "what was published")
    assert received == ["lab"]


@pytest.mark.parametrize("reliability", [ReliabilityPolicy.RELIABLE, ReliabilityPolicy.BEST_EFFORT])
def test_cameras_are_received_whatever_they_offer(
    graph: Graph, port: Any, reliability: ReliabilityPolicy
) -> None:
    image, received = port.message("sensor_msgs/Image"), []
    with other_node(graph) as node:
        camera = node.create_publisher(
            image, "/depth", QoSProfile(depth=5, reliability=reliability)
        )
        subscription = port.subscribe("/depth", "sensor_msgs/Image", received.append, queue=3)
        camera.publish(image(width=1, height=1, step=2, data=array.array("B", [1, 2])))
        assert [bytes(message.data) for message in received] == [b"\1\2"]
        (made,) = graph.subscriptions("/depth")
        assert made.qos.depth == 3
        subscription.close()
        subscription.close()
        camera.publish(image())
    assert len(received) == 1


def test_changes_of_maps_are_received_reliably(graph: Graph, port: Any) -> None:
    for name in ("map_msgs/OccupancyGridUpdate", "hypermap_msgs/SemanticMapUpdate"):
        port.subscribe("/updates", name, print)
    kinds = [made.qos.reliability for made in graph.subscriptions("/updates")]
    assert kinds == [ReliabilityPolicy.RELIABLE] * 2


def test_callbacks_of_a_topic_come_in_order_and_services_at_once(graph: Graph, port: Any) -> None:
    port.subscribe("/a", "std_msgs/String", print)
    port.subscribe("/b", "std_msgs/String", print)
    port.service("get", "std_srvs/Trigger", print, print)
    groups = [graph.subscriptions(name)[0].callback_group for name in ("/a", "/b")]
    assert all(isinstance(group, MutuallyExclusiveCallbackGroup) for group in groups)
    assert groups[0] is not groups[1]
    service = graph.services()["/hypermap_server/get"]
    assert isinstance(service.callback_group, ReentrantCallbackGroup)


@pytest.mark.parametrize("error", [HypermapError("a bad map"), ValueError("a bug")])
def test_an_error_in_a_callback_is_logged(graph: Graph, port: Any, error: Exception) -> None:
    def fail(_: Any) -> None:
        raise error

    string = port.message("std_msgs/String")
    port.subscribe("/text", "std_msgs/String", fail)
    with other_node(graph) as node:
        node.create_publisher(string, "/text", QoSProfile(depth=1)).publish(string())
    level, text = graph.logged[-1]
    assert (level, text.startswith("/text: "), str(error) in text) == ("error", True, True)
    assert ("Traceback" in text) == isinstance(error, ValueError)


def test_what_is_published_after_the_end_goes_nowhere(graph: Graph, port: Any) -> None:
    publisher = port.publisher("text", "std_msgs/String")
    publisher.close()
    publisher.close()
    publisher.publish(port.message("std_msgs/String")())
    assert "/hypermap_server/text" not in graph.topics()


def test_a_timer_rings_until_it_is_closed(graph: Graph, port: Any) -> None:
    rings: list[int] = []
    timer = port.timer(0.5, lambda: rings.append(1))
    (made,) = (t for t in graph.node("/hypermap_server")._timers if t.period == 0.5)
    assert made.clock.clock_type == ClockType.STEADY_TIME  # a clock may be set, a simulator wait
    made.callback()
    assert rings == [1]
    timer.close()
    assert made not in graph.node("/hypermap_server")._timers


# Services


def test_services_answer_in_any_case(graph: Graph, port: Any) -> None:
    response = port.response("std_srvs/SetBool")
    errors = {True: HypermapError("unknown layer 'x'"), False: KeyError("a bug")}

    def handle(request: Any) -> Any:
        if request.data is not None and handle.fails:  # type: ignore[attr-defined]
            raise errors[request.data]
        return response(success=request.data, message="done")

    service = port.service(
        "set", "std_srvs/SetBool", handle, lambda text: response(success=False, message=text)
    )
    handle.fails = False  # type: ignore[attr-defined]
    assert graph.call("/hypermap_server/set", data=True) == response(success=True, message="done")
    handle.fails = True  # type: ignore[attr-defined]
    known = graph.call("/hypermap_server/set", data=True)
    assert (known.success, known.message) == (False, "unknown layer 'x'")
    assert graph.logged[-1] == ("error", "set: unknown layer 'x'")
    bug = graph.call("/hypermap_server/set", data=False)
    assert (bug.success, bug.message) == (False, "internal error: KeyError('a bug')")
    assert "Traceback" in graph.logged[-1][1]
    service.close()
    assert "/hypermap_server/set" not in graph.services()


# Types


def test_missing_types_name_the_remedy(port: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_DISTRO", "jazzy")
    with pytest.raises(HypermapError, match=r"apt-get install ros-jazzy-no-such-msgs"):
        port.message("no_such_msgs/Thing")
    with pytest.raises(HypermapError, match="colcon build --packages-select hypermap_msgs"):
        port.message("hypermap_msgs/NoSuchMessage")


def test_the_detections_of_ros1_name_those_of_ros2(port: Any, monkeypatch: Any) -> None:
    def missing(name: str) -> Any:
        raise ModuleNotFoundError(f"No module named {name!r}")

    monkeypatch.setattr("hypermap.ros.ros2.messages.importlib.import_module", missing)
    with pytest.raises(HypermapError, match=r"\(--detections-type vision\)"):
        port.message("darknet_ros_msgs/BoundingBoxes")


def test_stamps_and_time(graph: Graph, port: Any) -> None:
    assert (port.stamp(1_500_000_000).sec, port.stamp(1_500_000_000).nanosec) == (1, 500_000_000)
    graph.time = 42
    assert port.now() == 42


def test_every_level_can_be_logged_in_any_order(graph: Graph, port: Any) -> None:
    graph.logged.clear()
    levels = ["error", "info", "warning", "debug", "info", "error"]
    for level in levels:
        port.log(level, f"100 % {level}")
    assert graph.logged == [(level, f"100 % {level}") for level in levels]


# Frames


def transform(port: Any, parent: str, child: str, x: float, yaw: float = 0.0) -> Any:
    made = port.message("geometry_msgs/TransformStamped")(child_frame_id=child)
    made.header.frame_id = parent
    made.transform.translation.x = x
    made.transform.rotation.z, made.transform.rotation.w = np.sin(yaw / 2), np.cos(yaw / 2)
    return made


def test_static_transforms_replace_those_of_before(graph: Graph, port: Any) -> None:
    port.static_transforms(
        [transform(port, "map", "lab", 1.0), transform(port, "map", "hall", 2.0)]
    )
    port.static_transforms([transform(port, "map", "hall", 3.0)])
    known = graph.latest("/tf_static").transforms
    assert [(t.child_frame_id, t.transform.translation.x) for t in known] == [("hall", 3.0)]
    (made,) = graph.publishers("/tf_static")
    assert made.qos.durability == DurabilityPolicy.TRANSIENT_LOCAL


def test_a_lookup_chains_transforms(graph: Graph, port: Any) -> None:
    port.static_transforms([transform(port, "map", "lab", 1.0, np.pi / 2)])
    with other_node(graph) as node:
        kind = port.message("tf2_msgs/TFMessage")
        moving = node.create_publisher(kind, "/tf", QoSProfile(depth=1))
        moving.publish(kind(transforms=[transform(port, "lab", "robot", 2.0)]))
    found = port.lookup("map", "robot")
    np.testing.assert_allclose(found[:3, 3], [1, 2, 0], atol=1e-12)
    np.testing.assert_allclose(found[:2, :2], [[0, -1], [1, 0]], atol=1e-12)


def test_a_lookup_waits_for_what_comes(graph: Graph, port: Any) -> None:
    with pytest.raises(FrameError, match="'late'"):
        port.lookup("map", "late")
    later = [transform(port, "map", "late", 1.0)]
    threading.Timer(0.2, port.static_transforms, (later,)).start()
    assert port.lookup("map", "late", timeout=10.0)[0, 3] == 1.0


@pytest.mark.parametrize("stamp", [None, 5, -5, 2**70])
def test_an_unknown_frame_is_an_error(port: Any, stamp: int | None) -> None:
    with pytest.raises(FrameError, match="from 'moon' to 'map'"):
        port.lookup("map", "moon", stamp)


def test_a_clock_that_jumps_back_forgets_what_moved(graph: Graph, port: Any) -> None:
    port.static_transforms([transform(port, "map", "lab", 1.0)])
    with other_node(graph) as node:
        kind = port.message("tf2_msgs/TFMessage")
        moving = node.create_publisher(kind, "/tf", QoSProfile(depth=1))
        moving.publish(kind(transforms=[transform(port, "map", "robot", 2.0)]))
    assert port.lookup("map", "robot")[0, 3] == 2.0
    for jump in graph.node("/hypermap_server").get_clock().jumps:
        jump.callback(None)
    with pytest.raises(FrameError):
        port.lookup("map", "robot")
    assert port.lookup("map", "lab")[0, 3] == 1.0


def test_a_transform_from_ahead_does_not_keep_out_those_of_now(graph: Graph, port: Any) -> None:
    now, hour = port.now(), 3600 * 10**9
    with other_node(graph) as node:
        kind = port.message("tf2_msgs/TFMessage")
        moving = node.create_publisher(kind, "/tf", QoSProfile(depth=1))
        late = now - hour  # of a machine whose clock is late
        for stamp, x in [(now + hour, 1.0), (now, 2.0), (late, 3.0), (now + 10**7, 4.0)]:
            one = transform(port, "map", "robot", x)
            one.header.stamp = port.stamp(stamp)
            moving.publish(kind(transforms=[one]))
    assert port.lookup("map", "robot", now)[0, 3] == 2.0
    assert port.lookup("map", "robot", now + 10**7)[0, 3] == 4.0


def test_a_reason_of_tf2_that_begins_with_nothing_is_said_plainly(
    port: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: Any) -> Any:  # as where tf2 has just forgotten all that it knew
        raise sys.modules["tf2_ros"].TransformException(", when looking up transform from [a]")

    monkeypatch.setattr(sys.modules["tf2_ros"].Buffer, "lookup_transform", refuse)
    with pytest.raises(FrameError, match="from 'a' to 'b': when looking up"):
        port.lookup("b", "a")


def test_without_tf2_ros_the_error_says_what_to_install(
    graph: Graph, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "tf2_ros", None)
    monkeypatch.setenv("ROS_DISTRO", "jazzy")
    with pytest.raises(HypermapError, match=r"tf2_ros is missing .*ros-jazzy-tf2-ros-py"):
        importlib.import_module("hypermap.ros.ros2.port")
