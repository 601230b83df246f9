from __future__ import annotations

import contextlib
import logging
import signal
import socket
import threading

import foxglove
import pytest

from hypermap.core.errors import FrameError, HypermapError
from hypermap.ros.foxglove.port import FoxglovePort
from hypermap.ros.port import Parameter

from .amid_locks import signals_amid_locks
from .conftest import wait_for
from .foxglove_client import Client, ServiceFailed

SERVICE = "/server/get_int_at_point"
GET_INT = "hypermap_msgs/GetIntAtPoint"
HEIGHT = Parameter("height", 0.5, "Height [m].", minimum=0.0, maximum=2.0, changes=True)
CLASSES = Parameter("classes", (), "Classes.", changes=True)
FILE = Parameter("file", "", "A file.")


@pytest.fixture
def port(capfd):  # so that the node writes its log there
    port = FoxglovePort("server", port=0, allow_edits=True)
    yield port
    port.shut_down()


@pytest.fixture
def client(port):
    with Client(port.url) as client:
        yield client


def grid(port, *cells):
    message = port.message("nav_msgs/OccupancyGrid")(data=list(cells))
    message.header.frame_id = "map"
    return message


def wait_for_last(client, topic, cells):
    def cells_received():
        return [message.data.tolist() for message in client.received(topic)]

    client.wait(lambda: cells in cells_received(), f"{cells}")
    client.settle()
    assert cells_received()[-1] == cells


def logged_by(name):
    """Return the lines that a logger has written from now on; the list grows."""
    lines, handler = [], logging.Handler()
    handler.emit = lambda record: lines.append(record.getMessage())
    logging.getLogger(name).addHandler(handler)
    return lines


def number_port(url):
    return int(url.rpartition(":")[2])


def test_the_server_says_what_it_can(port, client):
    info = client.info()
    assert info["name"] == "Hypermap /server"
    assert {"clientPublish", "parameters", "services"} <= set(info["capabilities"])
    assert info["supportedEncodings"] == ["cdr"]


@pytest.mark.parametrize(
    ("headers", "is_let_in"),
    [
        ({}, True),
        ({"Origin": "https://app.foxglove.dev"}, True),
        ({"Origin": "file://"}, True),
        ({"Origin": "http://localhost:8080"}, True),
        ({"Origin": "https://robots.example"}, True),  # the operator's own
        ({"Origin": "https://evil.example"}, False),
        ({"Origin": "https://app.foxglove.dev.evil.example"}, False),
        ({"Origin": "null"}, False),
        ({"Host": "evil.example:8765"}, False),  # whose name points here
        ({"Host": "evil.example", "Origin": "http://evil.example"}, False),
    ],
)
def test_websites_are_let_in_only_by_name(headers, is_let_in):
    port = FoxglovePort("server", port=0, origins=["https://Robots.example/"])
    try:
        ask = "GET / HTTP/1.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        sent = {
            "Host": f"127.0.0.1:{number_port(port.url)}",
            "Sec-WebSocket-Key": "AAAAAAAAAAAAAAAAAAAAAA==",
            "Sec-WebSocket-Version": "13",
            "Sec-WebSocket-Protocol": "foxglove.sdk.v1",
            **headers,
        }
        ask += "".join(f"{name}: {value}\r\n" for name, value in sent.items()) + "\r\n"
        with socket.create_connection(("127.0.0.1", number_port(port.url)), timeout=120) as one:
            one.sendall(ask.encode())
            assert one.recv(12) == (b"HTTP/1.1 101" if is_let_in else b"HTTP/1.1 403")
    finally:
        port.shut_down()


def test_what_strangers_send_controls_no_terminal(port, capfd):
    ask = b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nUpgrade: websocket\r\n"
    ask += b"Origin: https://a\x1b[31m\n[ERROR] [/server]: forged;reboot\x9b\r\n\r\n"
    with socket.create_connection(("127.0.0.1", number_port(port.url)), timeout=120) as one:
        one.sendall(ask)
        assert one.recv(12) == b"HTTP/1.1 403"
    lines = []
    wait_for(lambda: lines.extend(capfd.readouterr().err.splitlines()) or len(lines) > 2, "lines")
    assert all(line.startswith(("[INFO]", "[WARNING]", "    ")) for line in lines)
    assert all(line.isprintable() for line in lines)
    port.log("warning", "frame 'a\x1b[31m\u202e\udcff\n[ERROR] forged'")
    said = capfd.readouterr().err
    assert said == "[WARNING] [/server]: frame 'a\\x1b[31m\\u202e\\udcff\n    [ERROR] forged'\n"


def test_an_error_of_a_service_controls_no_terminal(port, client, capfd):
    def fail(_):
        raise ValueError("frame 'a\x1b[31m\n[ERROR] forged'")

    port.service("look", "std_srvs/Trigger", fail, lambda _: None)
    with pytest.raises(ServiceFailed, match="ValueError"):
        client.call("/server/look", "std_srvs/Trigger")
    said = capfd.readouterr().err
    assert "[ERROR] [/server]: /server/look: Traceback" in said
    assert "ValueError: frame 'a\\x1b[31m\n    [ERROR] forged'\n" in said


def test_refused_connections_are_logged_once_of_each_kind_for_a_while(port):
    lines = logged_by("/server")
    plain = b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n"
    site = plain[:-2] + b"Upgrade: websocket\r\nOrigin: https://it's-%d.example\r\n\r\n"
    for asked in (plain, plain, plain, site % 1, site % 2):
        with socket.create_connection(("127.0.0.1", number_port(port.url)), timeout=120) as one:
            one.sendall(asked)
            assert one.recv(12) == b"HTTP/1.1 403"
    said = [line[:12] for line in lines]
    assert said == ["this is a We", "the website "]


def test_clients_may_only_look_unless_edits_are_allowed(capfd):
    port = FoxglovePort("server", port=0)
    done = port.response("std_srvs/Trigger")(success=True, message="gone")
    port.service("clear", "std_srvs/Trigger", lambda _: done, lambda _: done)
    port.service("look", "std_srvs/Trigger", lambda _: done, lambda _: done)
    try:
        with Client(port.url) as client:
            assert "clientPublish" not in client.info()["capabilities"]
            with pytest.raises(ServiceFailed, match="start the node with --allow-edits"):
                client.call("/server/clear", "std_srvs/Trigger")
            assert client.call("/server/look", "std_srvs/Trigger").message == "gone"
    finally:
        port.shut_down()


def test_a_channel_carries_its_type_in_full(port, client):
    port.publisher("map", "nav_msgs/OccupancyGrid")
    client.wait(lambda: "/server/map" in client.channels, "the channel")
    channel = client.channels["/server/map"]
    assert (channel["encoding"], channel["schemaEncoding"]) == ("cdr", "ros2msg")
    assert channel["schemaName"] == "nav_msgs/msg/OccupancyGrid"
    assert channel["schema"].startswith("std_msgs/Header header\nnav_msgs/MapMetaData info\n")
    assert "MSG: geometry_msgs/Quaternion\nfloat64 x\n" in channel["schema"]


def test_late_subscribers_get_what_is_latched_and_the_newest_alone(port, client):
    publisher = port.publisher("/map", "nav_msgs/OccupancyGrid", latched=True)
    publisher.publish(grid(port, 1))
    publisher.publish(grid(port, 100, -1))
    assert client.next(client.subscribe("/map")).data.tolist() == [100, -1]
    with Client(port.url) as late:
        topic = late.subscribe("/map")
        assert late.next(topic) == grid(port, 100, -1)
        late.wait(lambda: publisher.listeners == 2, "both subscribers")
        publisher.publish(grid(port, 7))
        assert late.next(topic, 2).data.tolist() == [7]
    wait_for(lambda: publisher.listeners == 1, "the end of one")


def test_who_comes_while_messages_are_published_ends_with_the_newest(port):
    publisher = port.publisher("/map", "nav_msgs/OccupancyGrid", latched=True)
    published = threading.Event()

    def publish_many():
        for number in range(300):
            publisher.publish(grid(port, number % 100, number // 100))
        published.set()

    threading.Thread(target=publish_many).start()
    newest = [99, 2]
    while not published.is_set():
        with Client(port.url) as client:
            topic = client.subscribe("/map")
            wait_for_last(client, topic, newest)


def test_who_subscribes_before_there_is_a_publisher_is_counted_and_gets_what_is_latched(
    port, client, monkeypatch
):
    came = threading.Event()
    make, count = foxglove.Channel, port._listener.on_subscribe

    def counted(*subscriber):
        count(*subscriber)
        came.set()

    def make_and_wait_for_a_subscriber(*args, **options):
        channel = make(*args, **options)
        topics.append(client.subscribe("/map"))
        client.wait(came.is_set, "the subscriber")
        return channel

    topics = []
    monkeypatch.setattr(port._listener, "on_subscribe", counted)
    monkeypatch.setattr("foxglove.Channel", make_and_wait_for_a_subscriber)
    publisher = port.publisher("/map", "nav_msgs/OccupancyGrid", latched=True)
    assert publisher.listeners == 1
    publisher.publish(grid(port, 5))
    assert client.next(topics[0]).data.tolist() == [5]
    client.unsubscribe(topics[0])
    client.wait(lambda: publisher.listeners == 0, "its end")


def test_what_is_not_latched_is_gone(port, client):
    publisher = port.publisher("/detections", "std_msgs/String")
    text = port.message("std_msgs/String")
    publisher.publish(text(data="early"))
    topic = client.subscribe("/detections")
    client.wait(lambda: publisher.listeners == 1, "the subscriber")
    publisher.publish(text(data="late"))
    assert client.next(topic).data == "late"
    assert len(client.received(topic)) == 1


def test_a_publisher_that_is_closed_is_gone_and_may_come_back(port, client):
    publisher = port.publisher("/map", "nav_msgs/OccupancyGrid", latched=True)
    client.wait(lambda: "/map" in client.channels, "the channel")
    publisher.close()
    publisher.close()
    client.wait(lambda: "/map" not in client.channels, "the end of the channel")
    port.publisher("/map", "nav_msgs/OccupancyGrid", latched=True).publish(grid(port, 5))
    assert client.next(client.subscribe("/map")).data.tolist() == [5]


def answer_seven(port):
    def answer(request):
        if request.layer != "occupancy":
            raise HypermapError(f"there is no layer {request.layer!r}")
        return port.response(GET_INT)(value=round(request.location.point.x) + 7)

    return port.service("get_int_at_point", GET_INT, answer, None)


def test_a_service_answers_each_of_two_clients(port, client):
    answer_seven(port)
    place = port.message("geometry_msgs/PointStamped")()
    with Client(port.url) as other:
        for x, one in ((0.0, client), (1.0, other)):
            place.point.x = x
            called = one.call(
                "/server/get_int_at_point", GET_INT, layer="occupancy", location=place
            )
            assert called.value == 7 + x


def test_a_service_carries_its_types_in_full(port, client):
    answer_seven(port)
    client.wait(lambda: client.services, "the service")
    service = client.services[SERVICE]
    assert service["type"] == "hypermap_msgs/srv/GetIntAtPoint"
    assert service["request"]["schemaName"] == "hypermap_msgs/srv/GetIntAtPoint_Request"
    assert service["request"]["schema"].startswith("string layer\n")
    assert service["response"]["schema"] == "int32 value\n"


def test_what_goes_wrong_in_a_service_reaches_the_client_and_the_log(port, client, capfd):
    answer_seven(port)
    with pytest.raises(ServiceFailed, match="there is no layer 'rooms'"):
        client.call(SERVICE, GET_INT, layer="rooms")
    with pytest.raises(ServiceFailed, match=r"not a valid .*GetIntAtPoint_Request"):
        client.call_raw(SERVICE, GET_INT, b"abc")
    with pytest.raises(ServiceFailed, match="encoding"):
        client.call_raw(SERVICE, GET_INT, b"{}", encoding="json")
    assert client.call(SERVICE, GET_INT, layer="occupancy").value == 7
    assert (
        "[ERROR] [/server]: /server/get_int_at_point: there is no layer" in capfd.readouterr().err
    )


def test_a_service_that_is_closed_is_gone(port, client):
    service = answer_seven(port)
    client.wait(lambda: client.services, "the service")
    service.close()
    client.wait(lambda: not client.services, "its end")
    answer_seven(port)
    assert client.call(SERVICE, GET_INT, layer="occupancy").value == 7


def test_parameters_are_shown_and_changed(port, client):
    changes = []
    given = port.parameters([HEIGHT, CLASSES, FILE], changes.append)
    assert given == {"height": 0.5, "classes": [], "file": ""}
    assert client.parameters() == {"/server.height": 0.5, "/server.classes": [], "/server.file": ""}
    assert client.set_parameters(**{"/server.height": 1}) == {"/server.height": 1.0}
    assert client.set_parameters(**{"/server.classes": ["chair"]}) == {"/server.classes": ["chair"]}
    assert client.parameters("/server.height") == {"/server.height": 1.0}
    assert changes == [{"height": 1.0}, {"classes": ["chair"]}]


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("height", -1.0, "parameter 'height' must be at least 0.0, got -1.0"),
        ("height", "high", "parameter 'height' must be a number, got 'high'"),
        ("file", "x.hmap", "parameter 'file' can be set only when the node starts"),
        ("depth", 1.0, "there is no parameter 'depth'"),
    ],
)
def test_a_wrong_change_is_refused_and_logged(port, client, capfd, name, value, expected):
    changes = []
    port.parameters([HEIGHT, FILE], changes.append)
    before = client.parameters()
    client.set_parameters(**{f"/server.{name}": value})
    assert client.parameters() == before
    assert changes == []
    assert expected in capfd.readouterr().err


def test_a_change_that_the_node_refuses_is_taken_back(port, client):
    def refuse(values):
        raise HypermapError("not now")

    port.parameters([HEIGHT], refuse)
    assert client.set_parameters(**{"/server.height": 1.0}) == {"/server.height": 0.5}


def test_what_the_operator_has_set_is_checked():
    port = FoxglovePort("server", {"height": 1}, port=0)
    assert port.parameters([HEIGHT]) == {"height": 1.0}
    with pytest.raises(HypermapError, match="'height'; did you mean 'heigth'"):
        port.parameters([Parameter("heigth", 0.0, "Misspelt.")])
    port.shut_down()


def test_clients_publish(port, client):
    got = []
    port.subscribe("/map", "nav_msgs/OccupancyGrid", got.append)
    with Client(port.url) as other:
        for one, cell in ((client, 1), (other, 2)):
            one.info()
            one.publish(one.advertise("/map", "nav_msgs/msg/OccupancyGrid"), grid(port, cell))
            wait_for(lambda expected=cell: len(got) == expected, f"message {cell}")
    assert [message.data.tolist() for message in got] == [[1], [2]]


def test_what_is_closed_gets_no_more(port, client):
    got, still = [], []
    subscription = port.subscribe("/map", "nav_msgs/OccupancyGrid", got.append)
    port.subscribe("/map", "nav_msgs/OccupancyGrid", still.append)
    client.info()
    channel = client.advertise("/map", "nav_msgs/OccupancyGrid")
    subscription.close()
    client.publish(channel, grid(port, 1))
    wait_for(lambda: still, "the other subscriber")
    assert got == []


@pytest.mark.parametrize(
    ("schema", "encoding", "data", "expected"),
    [
        ("nav_msgs/OccupancyGrid", "cdr", b"abc", "a message on /map is left out: these 3 bytes"),
        ("nav_msgs/OccupancyGrid", "json", b"{}", "'cdr' alone is understood"),
        ("std_msgs/String", "cdr", b"", "publish std_msgs/String on /map, which takes nav_msgs"),
    ],
)
def test_what_makes_no_sense_is_left_out_and_logged(
    port, client, capfd, schema, encoding, data, expected
):
    got = []
    port.subscribe("/map", "nav_msgs/OccupancyGrid", got.append)
    client.info()
    lines = logged_by("/server")
    client.publish_raw(client.advertise("/map", schema, encoding), data)
    wait_for(lambda: expected in "".join(lines), expected)
    assert expected in capfd.readouterr().err  # once: what is written meanwhile is lost
    client.publish(client.advertise("/map", "nav_msgs/OccupancyGrid"), grid(port, 1))
    wait_for(lambda: got, "the good message")
    assert len(got) == 1


def test_a_callback_that_fails_does_not_end_the_subscription(port, client, capfd):
    got = []

    def fail_once(message):
        got.append(message)
        if len(got) == 1:
            raise ValueError("no such luck")

    port.subscribe("/map", "nav_msgs/OccupancyGrid", fail_once)
    client.info()
    channel = client.advertise("/map", "nav_msgs/OccupancyGrid")
    for count in (1, 2):
        client.publish(channel, grid(port, count))
        wait_for(lambda expected=count: len(got) == expected, f"message {count}")
    assert "no such luck" in capfd.readouterr().err


def test_a_slow_callback_gets_the_newest(port, client):
    got, may_go_on = [], threading.Event()

    def wait(message):
        got.append(message.data.tolist())
        may_go_on.wait(120)

    port.subscribe("/map", "nav_msgs/OccupancyGrid", wait)
    done = []
    port.subscribe("/done", "std_msgs/String", done.append)
    client.info()
    channel = client.advertise("/map", "nav_msgs/OccupancyGrid")
    client.publish(channel, grid(port, 0))
    wait_for(lambda: got, "the first message")
    for number in range(1, 9):
        client.publish(channel, grid(port, number))
    client.publish(client.advertise("/done", "std_msgs/String"), port.message("std_msgs/String")())
    wait_for(lambda: done, "all to have arrived")
    may_go_on.set()
    wait_for(lambda: len(got) == 2, "the newest message")
    assert got == [[0], [8]]


def test_frames_are_known_to_late_clients_and_to_the_node(port, client):
    transform = port.message("geometry_msgs/TransformStamped")(child_frame_id="room")
    transform.header.frame_id = "map"
    transform.transform.translation.x = 2.0
    port.static_transforms([transform])
    (received,) = client.next(client.subscribe("/tf_static")).transforms
    assert received == transform
    assert port.lookup("map", "room")[:2, 3].tolist() == [2.0, 0.0]
    assert port.lookup("room", "map")[:2, 3].tolist() == [-2.0, 0.0]
    with pytest.raises(FrameError, match="no transform from 'odom' to 'map'"):
        port.lookup("map", "odom")
    port.static_transforms([])
    with pytest.raises(FrameError):
        port.lookup("map", "room")


def test_the_log_goes_to_rosout(port, client, capfd):
    topic = client.subscribe("/rosout")
    client.wait(lambda: port._rosout.listeners, "the subscriber")
    port.log("warning", "the map is old")
    line = client.next(topic)
    assert (line.level, line.name, line.msg) == (line.WARN, "/server", "the map is old")
    assert "[WARNING] [/server]: the map is old" in capfd.readouterr().err


def test_a_timer_goes_on_until_it_is_closed(port, capfd):
    calls = []

    def call():
        calls.append(1)
        raise ValueError("in vain")

    timer = port.timer(0.01, call)
    wait_for(lambda: len(calls) >= 3, "three calls")
    timer.close()
    reported = capfd.readouterr().err
    assert "in a timer: Traceback" in reported
    assert "ValueError: in vain" in reported


@pytest.mark.parametrize(
    ("host", "expected"),
    [
        ("127.0.0.1", "in use"),
        ("192.0.2.1", "assign"),
        ("nowhere.invalid", "(address|known|resolution)"),
    ],
)
def test_where_it_cannot_listen_is_said(port, host, expected):
    number = number_port(port.url) if host == "127.0.0.1" else 0
    with pytest.raises(
        HypermapError, match=rf"cannot listen on {host}, port {number}: .*{expected}"
    ):
        FoxglovePort("other", host=host, port=number)


def started_again(number):
    with contextlib.suppress(HypermapError):
        return FoxglovePort("server", port=number)


def test_a_server_that_has_ended_starts_again_and_clients_come_back(port):
    number = number_port(port.url)
    with Client(port.url) as client:
        first = client.info()["sessionId"]
    port.shut_down()
    again = wait_for(lambda: started_again(number), "the port to be free")
    try:
        again.publisher("/map", "nav_msgs/OccupancyGrid", latched=True).publish(grid(again, 3))
        with Client(again.url) as client:
            assert client.info()["sessionId"] != first
            assert client.next(client.subscribe("/map")).data.tolist() == [3]
    finally:
        again.shut_down()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_node_and_leaves_the_handlers_as_they_were(number):
    before = signal.getsignal(number)
    port = FoxglovePort("server", port=0)
    with pytest.raises(KeyboardInterrupt):  # while it starts
        signal.raise_signal(number)
    port.shut_down()
    port = FoxglovePort("server", port=0)
    while_it_spins(port, lambda: signal.raise_signal(number))
    port.spin()
    assert port.is_shut_down
    port.shut_down()
    assert signal.getsignal(number) is before


def while_it_spins(port, act):
    """Do something in another thread, but not before the node waits for its end."""

    def work():
        wait_for(lambda: port._is_spinning, "the node to wait for its end")
        act()

    threading.Thread(target=work).start()


@pytest.mark.timeout(60)
def test_a_signal_waits_for_no_lock() -> None:
    port = FoxglovePort("server", port=0)
    while_it_spins(port, port.shut_down)
    with signals_amid_locks():
        port.spin()
    port.shut_down()


def test_shut_down_by_another_thread_ends_the_node_and_leaves_the_handlers_as_they_were():
    before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)
    port = FoxglovePort("server", port=0)
    while_it_spins(port, port.shut_down)
    port.spin()
    assert port.is_shut_down
    port.shut_down()
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == before
