from __future__ import annotations

import contextlib
import os
import re
import signal
import socket
import subprocess
import sys
import time

import pytest

from hypermap.cli.node_options import parse_params
from hypermap.core.errors import HypermapError
from hypermap.formats import open_map
from hypermap.ros.nodes import found_middleware, split_arguments
from hypermap.ros.typestore import message_class

from ..prepared import Command
from ..ros.foxglove_client import Client, ServiceFailed
from .conftest import Result, assert_one_error

GET_STRING = "/hypermap_server/get_string_at_point", "hypermap_msgs/GetStringAtPoint"
LOAD_MAP = "/hypermap_server/load_map", "hypermap_msgs/LoadMap"


class Server:
    """`hypermap serve --foxglove` on a free port."""

    def __init__(self, log, *arguments):
        self.log = log
        words = ["serve", "--foxglove", "--port", "0", *arguments]
        with log.open("wb") as output:
            self.process = Command(*words, stdout=output, stderr=output)

    @property
    def output(self):
        return self.log.read_text()

    def expect(self, pattern, timeout=240.0):
        end = time.monotonic() + timeout
        while not (found := re.search(pattern, self.output)):
            assert self.process.poll() is None, self.output
            assert time.monotonic() < end, self.output
            time.sleep(0.02)
        return found

    @property
    def url(self):
        return self.expect(r"ws://\S+")[0]

    @contextlib.contextmanager
    def client(self):
        """Connect, and wait until the node is active."""
        with Client(self.url) as client:
            client.wait(lambda: "/hypermap_server/store_map" in client.services, "the services")
            yield client

    def stop(self, number):
        self.process.send_signal(number)
        return self.process.wait(240)


@pytest.fixture
def serve(tmp_path):
    servers = []

    def start(*arguments):
        servers.append(Server(tmp_path / f"server{len(servers)}.log", *arguments))
        return servers[-1]

    yield start
    for server in servers:
        if server.process.poll() is None:
            server.process.kill()
        server.process.wait(240)


def place(frame, x, y):
    point = message_class("geometry_msgs/PointStamped")()
    point.header.frame_id = frame
    point.point.x, point.point.y = x, y
    return point


def test_help_teaches_by_examples(hypermap):
    result = hypermap("serve", "--help")
    assert result.code == 0
    for words in ("hypermap serve lab.hmap --foxglove", "--ros-args -r __ns:=/robot", "--param"):
        assert words in result.out


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_map_is_served_until_a_signal_ends_it(serve, room_map, number):
    server = serve(room_map)
    with server.client() as client:
        topic = client.subscribe("/hypermap_server/occupancy_map")
        cells = client.next(topic).data.reshape(20, 30)
        assert (cells == open_map(room_map)["occupancy"].cells).all()
        chair = place("room", 0.5, 0.5)
        assert client.call(*GET_STRING, layer="semantic", location=chair).name == "chair"
        same = place("map", 9.5, 0.5)
        assert client.call(*GET_STRING, layer="semantic", location=same).name == "chair"
        with pytest.raises(ServiceFailed, match="there is no layer 'rooms'"):
            client.call(*GET_STRING, layer="rooms", location=chair)
    assert server.stop(number) == 0, server.output
    assert "Traceback" not in server.output


def test_markers_follow_the_parameters(serve, room_map):
    server = serve(room_map, "--param", "show_labels=false")
    with server.client() as client:
        topic = client.subscribe("/hypermap_server/semantic_markers")
        text = message_class("visualization_msgs/Marker").TEXT_VIEW_FACING
        assert text not in {marker.type for marker in client.next(topic).markers}
        client.set_parameters(**{"/hypermap_server.show_labels": True})

        def texts():
            markers = [marker for array in client.received(topic) for marker in array.markers]
            return {marker.text for marker in markers if marker.type == text}

        assert client.wait(texts, "labels") == {"chair", "potted plant"}


def test_maps_are_loaded_from_the_named_folder_alone(serve, room_map, tmp_path):
    folder = tmp_path / "maps"
    folder.mkdir()
    (folder / "room.hmap").write_bytes(room_map.read_bytes())
    (folder / "broken.hmap").write_bytes(room_map.read_bytes()[:200])
    server = serve("--map-directory", folder, "--allow-edits")
    with server.client() as client:
        for wrong in ("broken.hmap", "nowhere.hmap", "../room.hmap", str(room_map)):
            with pytest.raises(ServiceFailed):
                client.call(*LOAD_MAP, filename=wrong)
        assert "/hypermap_server/occupancy_map" not in client.channels
        assert client.call(*LOAD_MAP, filename="room.hmap").success
        client.wait(lambda: "/hypermap_server/occupancy_map" in client.channels, "the map")
        with pytest.raises(ServiceFailed):
            client.call(*LOAD_MAP, filename="broken.hmap")
        chair = place("room", 0.5, 0.5)
        assert client.call(*GET_STRING, layer="semantic", location=chair).name == "chair"
    assert server.stop(signal.SIGINT) == 0


def test_agents_see_the_map_that_is_served_now(serve, room_map, tmp_path):
    mcp = pytest.importorskip("mcp", reason="mcp is not installed")
    import anyio

    folder = tmp_path / "maps"
    folder.mkdir()
    (folder / "room.hmap").write_bytes(room_map.read_bytes())
    server = serve("--map-directory", folder, "--allow-edits", "--mcp")
    url = server.expect(r"http://\S+/mcp")[0]
    token = server.expect(r"Bearer (\S+)")[1]

    async def chairs() -> int:
        import httpx2
        from mcp.client.streamable_http import streamable_http_client

        headers = {"Authorization": f"Bearer {token}"}
        async with (
            httpx2.AsyncClient(headers=headers, timeout=240) as http,
            mcp.Client(streamable_http_client(url, http_client=http)) as client,
        ):
            found = await client.call_tool("find_objects", {"names": ["chair"]})
            assert "add_zone" not in {tool.name for tool in (await client.list_tools()).tools}
            return found.structured_content["count"]

    assert anyio.run(chairs) == 0
    with server.client() as client:
        assert client.call(*LOAD_MAP, filename="room.hmap").success
        assert anyio.run(chairs) == 2
    assert server.stop(signal.SIGINT) == 0


def test_the_library_for_agents_is_named_if_it_is_missing(hypermap, room_map, monkeypatch):
    for module in [name for name in sys.modules if name.startswith("hypermap.agents.")]:
        monkeypatch.delitem(sys.modules, module)
    for module in [name for name in sys.modules if name.partition(".")[0] == "mcp"]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, "mcp", None)
    result = hypermap("serve", room_map, "--foxglove", "--port", "0", "--mcp")
    assert result.code == 2
    assert result.err.endswith("pip install 'hypermap[mcp]'\n")


def test_clients_change_nothing_unless_they_may_and_what_they_replace_is_kept(
    serve, room_map, tmp_path
):
    folder = tmp_path / "maps"
    folder.mkdir()
    stored, backup = folder / "room.hmap", folder / "room.hmap.bak"
    stored.write_bytes(room_map.read_bytes() + b" ")  # which a zip archive may have behind it
    options = room_map, "--map-directory", folder
    names = ("store_map", "hypermap_msgs/StoreMap"), ("load_map", "hypermap_msgs/LoadMap")
    server = serve(*options)
    with server.client() as client:
        for name, kind in names:
            with pytest.raises(ServiceFailed, match="start the node with --allow-edits"):
                client.call(f"/hypermap_server/{name}", kind, filename="room.hmap")
        with pytest.raises(ServiceFailed, match="clients are read-only"):
            client.call("/hypermap_server/clear", "std_srvs/Trigger")
        with pytest.raises(ServiceFailed, match="clients are read-only"):
            client.call("/hypermap_server/find_rooms", "hypermap_msgs/FindRooms")
        client.wait(lambda: "/hypermap_server/occupancy_map" in client.channels, "the map")
    assert server.stop(signal.SIGINT) == 0
    assert [path.name for path in folder.iterdir()] == ["room.hmap"]
    before = stored.read_bytes()
    server = serve(*options, "--allow-edits")
    with server.client() as client:
        name, kind = names[0]
        assert client.call(f"/hypermap_server/{name}", kind, filename="room.hmap").success
    assert server.stop(signal.SIGINT) == 0
    assert backup.read_bytes() == before
    assert [layer.name for layer in open_map(stored)] == [
        layer.name for layer in open_map(room_map)
    ]


def test_another_node_fills_a_layer_in_subscribe_mode(serve, tmp_path):
    config = tmp_path / "slam.yaml"
    config.write_text(
        "layers:\n- {class: OccupancyGridLayer, name: occupancy, frame_id: map, "
        "load_file: false, subscribe_mode: true}\n"
    )
    server = serve(config, "--allow-edits")
    grid = message_class("nav_msgs/OccupancyGrid")(data=[0, 100])
    grid.header.frame_id = "map"
    grid.info.width, grid.info.height, grid.info.resolution = 2, 1, 1.0
    with server.client() as client, server.client() as slam:
        topic = client.subscribe("/hypermap_server/occupancy_map")
        slam.info()
        channel = slam.advertise("/map", "nav_msgs/msg/OccupancyGrid")

        def cells():
            slam.publish(channel, grid)  # again: clients cannot latch, and the node may still start
            client.settle(0.1)
            return [0, 100] in [message.data.tolist() for message in client.received(topic)]

        client.wait(cells, "the cells")
        occupied = place("map", 1.5, 0.5)
        answer = client.call(*GET_STRING, layer="occupancy", location=occupied)
        assert answer.name == "Occupied"


def test_two_servers_cannot_share_a_port(serve, hypermap, room_map):
    number = serve(room_map).url.rpartition(":")[2]
    result = hypermap("serve", room_map, "--foxglove", "--port", number)
    assert_one_error(result, f"port {number}", "in use", "--port")


def test_a_broken_map_is_an_error(hypermap, room_map, tmp_path):
    broken = tmp_path / "broken.hmap"
    broken.write_bytes(room_map.read_bytes()[:200])
    result = hypermap("serve", broken, "--foxglove", "--port", "0")
    assert result.code == 2
    assert f"hypermap: error: {broken}" in result.err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["nowhere.hmap", "--foxglove"], ["nowhere.hmap: there is no such file"]),
        (["--foxglove", "--map-directory", "nowhere"], ["--map-directory nowhere"]),
        (["--ros1", "--foxglove"], ["give one of --ros1, --foxglove"]),
        (
            ["--ros1", "--port", "1"],
            ["--allow-origin need --foxglove"],
        ),
        (["--ros1", "--allow-edits"], ["--allow-origin need --foxglove"]),
        (["--foxglove", "--param", "height"], ["--param 'height': give NAME=VALUE"]),
        (["--foxglove", "__name:=x"], ["'__name:=x' is an argument for ROS"]),
    ],
)
def test_bad_usage_is_one_line(hypermap, arguments, words):
    assert_one_error(hypermap("serve", *arguments), *words)


@pytest.mark.parametrize(
    ("param", "expected"),
    [
        ("file_name=x", "there is no parameter 'file_name'"),
        ("tf_timeout=soon", "parameter 'tf_timeout' must be a number"),
        ("load_map=1", "parameter 'load_map' must be true or false"),
    ],
)
def test_a_wrong_parameter_is_an_error(hypermap, param, expected):
    result = hypermap("serve", "--foxglove", "--port", "0", "--param", param)
    assert result.code == 2
    assert expected in result.err.splitlines()[-1]


def test_without_any_ros_the_remedy_is_said(hypermap, room_map, monkeypatch):
    monkeypatch.delenv("ROS_VERSION", raising=False)
    for name in ("hypermap.ros.ros1.libraries", "rclpy"):
        monkeypatch.setitem(sys.modules, name, None)
    assert_one_error(hypermap("serve", room_map), "neither ROS 1 nor ROS 2 is here", "--foxglove")


def test_ros_that_is_named_but_not_there_is_said(hypermap, room_map, monkeypatch):
    monkeypatch.setenv("ROS_VERSION", "2")
    monkeypatch.setitem(sys.modules, "rclpy", None)
    assert_one_error(hypermap("serve", room_map), "rclpy is missing", "setup.bash")


@pytest.mark.parametrize(("version", "expected"), [("1", "ros1"), ("2", "ros2")])
def test_the_ros_that_was_sourced_is_taken(monkeypatch, version, expected):
    monkeypatch.setenv("ROS_VERSION", version)
    assert found_middleware() == expected


def test_no_roscore_is_one_line(room_map):
    pytest.importorskip(
        "hypermap.ros.ros1.port",
        reason="ROS 1 is not here (on Debian 12, as root: make ros1)",
        exc_type=HypermapError,
    )
    command = [sys.executable, "-m", "hypermap", "serve", str(room_map), "--ros1"]
    with socket.socket() as closed:  # it has a port, so that nobody else has, but does not listen
        closed.bind(("127.0.0.1", 0))
        uri = f"http://127.0.0.1:{closed.getsockname()[1]}"
        environment = {**os.environ, "ROS_MASTER_URI": uri}
        ended = subprocess.run(
            command, env=environment, capture_output=True, text=True, timeout=240
        )
    assert_one_error(Result(ended.returncode, ended.stdout, ended.stderr), uri)


@pytest.mark.parametrize(
    ("arguments", "own", "ros"),
    [
        ([], [], []),
        (["a.hmap"], ["a.hmap"], []),
        (["__name:=a", "a.hmap", "_file:=b"], ["a.hmap"], ["__name:=a", "_file:=b"]),
        (["a.hmap", "--ros-args", "-p", "x:=1"], ["a.hmap"], ["--ros-args", "-p", "x:=1"]),
        (["--ros-args", "--params-file", "x", "--", "a"], ["a"], None),
        (["--ros-args", "-r", "a:=b", "--", "--ros2", "c:=d"], ["--ros2"], None),
    ],
)
def test_arguments_for_ros_are_distinguished_from_ours(arguments, own, ros):
    found = split_arguments(arguments)
    assert found[0] == own
    assert found[1] == (ros if ros is not None else [w for w in arguments if w not in own])


@pytest.mark.parametrize(
    ("pair", "expected"),
    [
        ("height=0.5", 0.5),
        ("count=3", 3),
        ("shown=true", True),
        ("file=lab.hmap", "lab.hmap"),
        ("file='3'", "3"),
        ("file=", ""),
        ("file=2026-01-01", "2026-01-01"),
        ("file=a=b", "a=b"),
        ("file=[", "["),
        ("classes=[chair, desk]", ["chair", "desk"]),
    ],
)
def test_values_are_read_as_ros_reads_them(pair, expected):
    assert parse_params([pair]) == {pair.partition("=")[0]: expected}


@pytest.mark.parametrize("pair", ["", "height", "=1", "a b=1", "a={b: 1}", "a=[1]"])
def test_what_is_no_parameter_is_refused(pair):
    with pytest.raises(HypermapError, match="--param"):
        parse_params([pair])
