"""The port of ROS 1 on a real roscore."""

from __future__ import annotations

import gc
import socket
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hypermap.core.errors import FrameError, HypermapError, LayerNotFound
from hypermap.ros.port import Parameter

from ..roscore import is_missing
from .conftest import Process, wait_for, wait_for_listener

pytestmark = pytest.mark.xdist_group("ros")

SERVICE = "hypermap_msgs/GetStringAtPoint"


@pytest.fixture
def log(rospy: Any, port: Any) -> Iterator[list[Any]]:
    """What is written to /rosout, by the library too, as in a process that is all a node's."""
    from hypermap.ros.ros1.logs import forward_logs

    forward_logs(port.log)
    lines: list[Any] = []
    subscriber = rospy.Subscriber("/rosout", port.message("rosgraph_msgs/Log"), lines.append)
    wait_for(lambda: subscriber.get_num_connections() > 0, "the log")
    yield lines
    subscriber.unregister()


def logged(lines: list[Any], text: str) -> Any:
    return wait_for(lambda: next((line for line in lines if text in line.msg), None), repr(text))


def ask(rospy: Any, port: Any, name: str, layer: str = "") -> str:
    from hypermap.ros.ros1.messages import service_class

    rospy.wait_for_service(name, 120)
    return str(rospy.ServiceProxy(name, service_class(SERVICE))(layer=layer).name)


def test_an_address_that_others_do_not_reach_is_told(needs_ros1: None) -> None:
    from hypermap.ros.ros1.master import why_unreachable

    with socket.create_server(("127.0.0.1", 0)) as node:
        here = f"http://127.0.0.1:{node.getsockname()[1]}/"
        assert why_unreachable(here, "http://127.0.0.1:11311") is None
        reason = why_unreachable(here, "http://192.0.2.1:11311")
        assert reason is not None
        assert "the roscore is at 192.0.2.1" in reason
    reason = why_unreachable(here, "http://127.0.0.1:11311")
    assert reason is not None
    assert "127.0.0.1 is no address of this machine" in reason
    reason = why_unreachable("http://robot..local:4711/", "http://127.0.0.1:11311")
    assert reason is not None
    assert reason.startswith("robot..local is no address of this machine")


def test_a_late_subscriber_receives_the_last_latched_message(port: Any) -> None:
    text = port.message("std_msgs/String")
    publisher = port.publisher("latched", "std_msgs/String", latched=True)
    publisher.publish(text("old"))
    publisher.publish(text("new"))
    heard: list[str] = []
    subscription = port.subscribe(
        f"{port.node_name}/latched", "std_msgs/String", lambda message: heard.append(message.data)
    )
    wait_for(lambda: heard, "the latched message")
    assert heard == ["new"]
    assert publisher.listeners == 1
    subscription.close()
    subscription.close()
    publisher.close()
    assert publisher.listeners == 0
    publisher.publish(text("nobody hears it"))


def test_messages_in_quick_succession_all_arrive(port: Any) -> None:
    text = port.message("std_msgs/String")
    publisher = port.publisher("many", "std_msgs/String")
    heard: list[str] = []
    subscription = port.subscribe(
        f"{port.node_name}/many",
        "std_msgs/String",
        lambda message: heard.append(message.data),
        queue=50,
    )
    wait_for(lambda: publisher.listeners, "the subscriber")
    for number in range(50):
        publisher.publish(text(str(number)))
    wait_for(lambda: len(heard) == 50, "50 messages")
    assert heard == [str(number) for number in range(50)]
    subscription.close()
    publisher.close()


def test_topics_that_are_closed_leave_nothing_open(port: Any) -> None:
    def files() -> int:
        return len(list(Path("/proc/self/fd").iterdir()))

    gc.disable()
    try:
        before = files()
        for number in range(20):
            port.publisher(f"many{number}", "std_msgs/String", latched=True).close()
            port.subscribe(f"many{number}", "std_msgs/String", print).close()
        assert files() < before + 20  # the socket of a call of the roscore may be among them
    finally:
        gc.enable()


def test_the_cells_of_a_grid_arrive_as_an_array(port: Any) -> None:
    kind = port.message("nav_msgs/OccupancyGrid")
    heard: list[Any] = []
    publisher = port.publisher("/cells", "nav_msgs/OccupancyGrid", latched=True)
    publisher.publish(kind(data=[-1, 0, 100, 7]))
    subscription = port.subscribe("/cells", "nav_msgs/OccupancyGrid", heard.append, latched=True)
    wait_for(lambda: heard, "the grid")
    assert isinstance(heard[0].data, np.ndarray)
    assert heard[0].data.dtype == np.int8
    assert heard[0].data.tolist() == [-1, 0, 100, 7]
    subscription.close()
    publisher.close()


def test_what_a_callback_raises_is_logged_and_the_next_message_arrives(
    port: Any, log: list[Any]
) -> None:
    heard: list[str] = []

    def callback(message: Any) -> None:
        if message.data == "wrong":
            raise HypermapError("cannot use this map")
        if message.data == "bug":
            raise ZeroDivisionError("nothing to divide by")
        heard.append(message.data)

    publisher = port.publisher("/callback_in", "std_msgs/String")
    subscription = port.subscribe("/callback_in", "std_msgs/String", callback, queue=10)
    wait_for(lambda: publisher.listeners, "the subscriber")
    for word in ("wrong", "bug", "good"):
        publisher.publish(port.message("std_msgs/String")(word))
    wait_for(lambda: heard, "the good message")
    assert logged(log, "cannot use").msg == "/callback_in: cannot use this map"
    bug = logged(log, "nothing to divide by").msg
    assert "Traceback" in bug
    assert "in callback" in bug
    subscription.close()
    publisher.close()


def test_a_service_answers_and_its_errors_reach_the_caller(
    rospy: Any, port: Any, log: list[Any]
) -> None:
    answer = port.response(SERVICE)

    def handler(request: Any) -> Any:
        if request.layer == "rooms":
            raise LayerNotFound("rooms", ["occupancy"])
        if request.layer == "bug":
            return {}["of our own"]
        return answer(name=request.layer * 2)

    service = port.service("twice", SERVICE, handler, lambda text: answer(name=text))
    name = f"{port.node_name}/twice"
    assert ask(rospy, port, name, "ab") == "abab"
    with pytest.raises(rospy.ServiceException, match="there is no layer 'rooms'; known: occupancy"):
        ask(rospy, port, name, "rooms")
    assert logged(log, "rooms").msg == "twice: there is no layer 'rooms'; known: occupancy"
    with pytest.raises(rospy.ServiceException, match="KeyError: 'of our own'"):
        ask(rospy, port, name, "bug")
    assert "Traceback" in logged(log, "of our own").msg
    assert ask(rospy, port, name, "c") == "cc"
    service.close()
    wait_for(lambda: is_missing(name), "the service to go")


def test_a_timer_goes_on_after_an_error_until_it_is_closed(port: Any, log: list[Any]) -> None:
    ticks: list[float] = []

    def tick() -> None:
        ticks.append(time.monotonic())
        if len(ticks) == 1:
            raise HypermapError("first tick")

    timer = port.timer(0.05, tick)
    wait_for(lambda: len(ticks) >= 5, "five ticks")
    timer.close()
    logged(log, "timer: first tick")
    assert min(np.diff(ticks)) > 0.04
    count = len(ticks)
    time.sleep(0.2)
    assert len(ticks) <= count + 1


def test_time_is_that_of_ros(rospy: Any, port: Any) -> None:
    before, now, after = time.time_ns(), port.now(), time.time_ns()
    assert before - 1e6 < now < after + 1e6
    stamp = port.stamp(12_345_678_901)
    assert (stamp.secs, stamp.nsecs) == (12, 345_678_901)


def transform(port: Any, parent: str, child: str, x: float) -> Any:
    message = port.message("geometry_msgs/TransformStamped")()
    message.header.frame_id, message.child_frame_id = parent, child
    message.transform.translation.x = x
    message.transform.rotation.w = 1.0
    return message


def test_static_transforms_reach_late_listeners_and_each_call_replaces_the_set(
    rospy: Any, port: Any
) -> None:
    port.static_transforms([transform(port, "map", "lab", 1.0), transform(port, "map", "old", 2.0)])
    port.static_transforms([transform(port, "map", "lab", 3.0)])
    sets: list[list[tuple[str, float]]] = []
    subscriber = rospy.Subscriber(
        "/tf_static",
        port.message("tf2_msgs/TFMessage"),
        lambda message: sets.append(
            [(t.child_frame_id, t.transform.translation.x) for t in message.transforms]
        ),
    )
    # To a topic that this process listens to already, the first set may still be on its way.
    wait_for(lambda: sets and sets[-1] == [("lab", 3.0)], "the last set of static transforms alone")
    subscriber.unregister()


def test_lookup_finds_what_others_publish(
    rospy: Any, port: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    import tf2_ros

    port.static_transforms([transform(port, "map", "lab", 3.0)])
    # The first lookup of a process has to wait for tf; an old-style slash does no harm.
    with monkeypatch.context() as patience:  # this machine may have much to do
        patience.setattr("hypermap.ros.ros1.port._TF_START", 120.0)
        np.testing.assert_allclose(
            port.lookup("map", "/lab"), [[1, 0, 0, 3], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
        )
    np.testing.assert_allclose(port.lookup("lab", "map")[:3, 3], [-3, 0, 0])
    broadcaster = tf2_ros.TransformBroadcaster()
    wait_for_listener(broadcaster.pub_tf, "a listener of /tf")
    moving = transform(port, "lab", "robot", 1.0)
    moving.header.stamp = rospy.Time(100)
    late = threading.Timer(0.3, lambda: broadcaster.sendTransform(moving))
    late.start()
    found = port.lookup("map", "robot", 100_000_000_000, timeout=120.0)
    np.testing.assert_allclose(found[:3, 3], [4, 0, 0])
    late.join()
    with pytest.raises(
        FrameError, match=r"tf has no transform from 'robot' to 'map'.*extrapolation"
    ):
        port.lookup("map", "robot", 500_000_000_000)
    with pytest.raises(FrameError, match="tf has no transform from 'nowhere' to 'map'"):
        port.lookup("map", "nowhere")
    with pytest.raises(FrameError, match=r"tf has no transform from 'no\\x00where' to 'map'"):
        port.lookup("map", "no\0where")


def test_a_transform_from_ahead_does_not_keep_out_those_of_now(rospy: Any, port: Any) -> None:
    kind = port.message("geometry_msgs/TransformStamped")
    publisher = port.publisher("/tf", "tf2_msgs/TFMessage")

    def publish(stamp: int, x: float) -> None:
        one = kind(child_frame_id="wheel")
        one.header.frame_id, one.header.stamp = "chassis", port.stamp(stamp)
        one.transform.translation.x, one.transform.rotation.w = x, 1.0
        publisher.publish(port.message("tf2_msgs/TFMessage")(transforms=[one]))

    def found(stamp: int) -> float | None:
        try:
            return float(port.lookup("chassis", "wheel", stamp)[0, 3])
        except FrameError:
            return None

    found(0)  # it listens
    wait_for(lambda: publisher.listeners, "the listener")
    now = port.now()
    hour = 3600 * 10**9
    publish(now + hour, 1.0)
    wait_for(lambda: found(now + hour) == 1.0, "a transform of the next hour")
    publish(now, 2.0)
    wait_for(lambda: found(now) == 2.0, "that of now")
    publish(now - hour, 3.0)  # of a machine whose clock is late
    publish(now + 10**7, 4.0)
    wait_for(lambda: found(now + 10**7) == 4.0, "the next one")
    assert found(now) == 2.0
    publisher.close()


def test_parameters_are_read_and_change_while_the_node_runs(
    rospy: Any, port: Any, log: list[Any]
) -> None:
    name = port.node_name
    rospy.set_param(f"{name}/height", 1)
    rospy.set_param(f"{name}/unknown", 1)
    height = Parameter("height", 0.5, "Height [m].", minimum=0.0, changes=True)
    file = Parameter("file", "a.hmap", "File.")
    changes: list[dict[str, Any]] = []
    assert port.parameters([height, file], changes.append) == {"height": 1.0, "file": "a.hmap"}
    rospy.set_param(f"{name}/height", 2.5)
    wait_for(lambda: changes, "the change")
    rospy.set_param(f"{name}/height", -1)
    assert "must be at least 0.0, got -1.0; it stays at 2.5" in logged(log, "at least").msg
    rospy.set_param(f"{name}/height", "tall")
    logged(log, "'height' must be a number, got 'tall'")
    rospy.set_param(f"{name}/file", "b.hmap")
    logged(log, "'file' takes effect when the node restarts")
    rospy.delete_param(f"{name}/height")
    rospy.set_param(f"{name}/height", 3)
    wait_for(lambda: len(changes) == 2, "the second change")
    assert changes == [{"height": 2.5}, {"height": 3.0}]


def test_an_error_while_a_parameter_changes_is_logged(
    rospy: Any, port: Any, log: list[Any]
) -> None:
    def refuse(changed: Any) -> None:
        raise HypermapError("not now")

    port.parameters([Parameter("level", 1, "Level.", changes=True)], refuse)
    rospy.set_param(f"{port.node_name}/level", 2)
    logged(log, "parameters: not now")


def test_a_wrong_parameter_at_the_start_is_an_error(rospy: Any, port: Any) -> None:
    rospy.set_param(f"{port.node_name}/mode", "trinari")
    mode = Parameter("mode", "trinary", "Mode.", choices=("trinary", "raw"))
    with pytest.raises(HypermapError, match="'mode' cannot be 'trinari'; did you mean 'trinary'"):
        port.parameters([mode])


@pytest.mark.parametrize(
    ("level", "number"), [("debug", 1), ("info", 2), ("warning", 4), ("error", 8)]
)
def test_log_lines_keep_their_level(
    rospy: Any, port: Any, log: list[Any], level: str, number: int
) -> None:
    if level == "debug":
        port.log("debug", "not shown, as usual")
        port.log("info", "after it")
        logged(log, "after it")
        assert not [line for line in log if "not shown" in line.msg]
        return
    port.log(level, f"100 % at {level}")
    assert logged(log, f"100 % at {level}").level == number


def test_the_library_logs_to_the_log_of_the_node(
    roscore: str, log: list[Any], start: Callable[..., Process]
) -> None:
    script = """
import logging
from hypermap.ros.ros1.port import Ros1Port
port = Ros1Port("forwards")
port.timer(0.1, lambda: logging.getLogger("hypermap.formats").warning("something %s", "odd"))
port.spin()
port.shut_down()
"""
    node = start(sys.executable, "-c", script)
    line = logged(log, "something odd")
    assert (line.name, line.level) == ("/forwards", 4)
    node.expect("something odd")


def test_a_parameter_with_the_name_of_the_node_is_an_error(rospy: Any, port: Any) -> None:
    rospy.set_param(rospy.get_name(), "office.hmap")
    try:
        with pytest.raises(HypermapError, match=r"'office.hmap', but .* rosparam delete /tests"):
            port.parameters([Parameter("height", 0.5, "Height.")])
    finally:
        rospy.delete_param(rospy.get_name())
