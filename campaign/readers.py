"""Readers and a writer: who asks while a map changes sees it whole.

Sixteen readers ask a layer in this process, the page's server, and a map server on ROS 1, while a
writer moves an object back and forth: nobody may see it twice or never.
"""

from __future__ import annotations

import http.client
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import shapely

from campaign.part import Budget, Finding, Result, merged
from hypermap import Hypermap, HypermapError, SemanticLayer, SemanticObject
from hypermap.formats import save_map
from hypermap.viewer.live.app import MapApp
from hypermap.viewer.live.document import MapDocument
from hypermap.viewer.live.serving import listen, serving

READERS = 16
HERE, THERE = shapely.box(0, 0, 1, 1), shapely.box(50, 50, 51, 51)
EVERYWHERE = shapely.box(-10, -10, 100, 100)
MOVES = 40  # of the short form
_PATIENCE = 120.0  # s for an answer

Reader = Callable[[], Iterator[int]]
"""Asks in several ways, and yields how often the cup was seen."""


def run(budget: Budget) -> Result:
    """Ask each for its share of the time."""
    kinds = (ask_layer, ask_server, ask_ros1)
    return merged("readers", [ask(budget.share(3 - i)) for i, ask in enumerate(kinds)])


def a_map_of_one_cup() -> Hypermap:
    """Return a map of many chairs and the one cup that is moved."""
    chairs = [SemanticObject("chair", shapely.box(x, 5, x + 0.5, 6)) for x in range(60)]
    return Hypermap([SemanticLayer("things", "map", [SemanticObject("cup", HERE), *chairs])])


def watch(
    name: str, readers: Sequence[Reader], move: Callable[[Any], None], budget: Budget
) -> Result:
    """Let readers count the cup while it is moved."""
    ends = threading.Event()
    counts, odd = [0] * len(readers), []

    def ask(i: int, is_seen: Reader) -> None:
        try:
            while not ends.is_set():
                for seen in is_seen():
                    counts[i] += 1
                    if seen != 1:
                        odd.append(f"seen {seen} times")
        except Exception as error:  # of whatever kind: that is what is looked for
            odd.append(f"{type(error).__name__}: {error}")

    threads = [threading.Thread(target=ask, args=pair, daemon=True) for pair in enumerate(readers)]
    for thread in threads:
        thread.start()
    moves = 0
    try:
        while (moves < MOVES or not all(counts)) if budget.short else not budget.is_over:
            if odd:
                break
            move(THERE if moves % 2 == 0 else HERE)
            moves += 1
    except Exception as error:  # likewise; the readers have to end in any case
        odd.append(f"the writer: {type(error).__name__}: {error}")
    ends.set()
    end = time.monotonic() + _PATIENCE
    for thread in threads:
        thread.join(max(end - time.monotonic(), 0.0))
    if hanging := sum(thread.is_alive() for thread in threads):
        odd.append(f"{hanging} readers hang")
    what = f"{name}: the object that is moved: {odd[0]} ({len(odd)} of these)" if odd else ""
    found = [Finding(what, budget.seed)] if odd else []
    figures: dict[str, float | str] = {f"{name}: questions": sum(counts), f"{name}: moves": moves}
    left_out = [] if all(counts) else [f"{name}: {counts.count(0)} readers got no answer"]
    return Result(name, sum(counts), found, figures, left_out)


# In this process


def ask_layer(budget: Budget) -> Result:
    """Let threads ask a map in this process."""
    asked = a_map_of_one_cup()
    layer = asked.semantic()
    cup = int(layer.ids[layer.names == "cup"][0])

    def is_seen() -> Iterator[int]:
        yield sum(found.object.name == "cup" for found in asked.objects())
        yield len(layer.find("cup"))
        yield list(layer.names).count("cup")
        yield list(layer.values_in(EVERYWHERE).values).count(cup)
        yield len(asked.objects("cup", area=EVERYWHERE))
        yield len(asked.nearest("cup", [0.0, 0.0], k=3))

    def move(where: Any) -> None:
        layer.update(cup, SemanticObject("cup", where))

    return watch("layer", [is_seen] * READERS, move, budget)


# Through the page's server


def ask_server(budget: Budget) -> Result:
    """Let clients ask a server of the page, each over a connection of its own."""
    path = budget.folder / "readers.hmap"
    save_map(a_map_of_one_cup(), path)
    app = MapApp(MapDocument(path, True))
    listening = listen("127.0.0.1", 0)
    with serving(app, listening), ExitStack() as clients:

        def client() -> Callable[..., Any]:
            return clients.enter_context(_client(listening.getsockname()[1], app.token or ""))

        readers = [_reader_of_server(client()) for _ in range(READERS)]
        result = watch("server", readers, _writer_of_server(client()), budget)
    path.unlink()
    return result


def _reader_of_server(ask: Callable[..., Any]) -> Reader:
    box = "bbox=-10,-10,100,100&resolution=0.1&name=cup"

    def is_seen() -> Iterator[int]:
        yield ask("GET", "/api/find?name=cup")["total"]
        yield len(ask("GET", f"/api/shapes/things?{box}")["features"])

    return is_seen


def _writer_of_server(ask: Callable[..., Any]) -> Callable[[Any], None]:
    version = ask("GET", "/api/map")["version"]
    (row,) = ask("GET", "/api/find?name=cup")["rows"]

    def move(where: Any) -> None:
        nonlocal version
        corners = [list(corner) for corner in where.exterior.coords[:-1]]
        change = {"op": "update", "layer": "things", "id": row["id"], "polygon": corners}
        body = {"version": version, "operations": [change]}
        version = ask("POST", "/api/edit", body)["version"]

    return move


@contextmanager
def _client(port: int, token: str) -> Iterator[Callable[..., Any]]:
    """Yield a function that asks the server over a connection of its own."""
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=_PATIENCE)

    def ask(method: str, path: str, body: Any = None) -> Any:
        headers = {"X-Hypermap-Token": token, "Content-Type": "application/json"}
        connection.request(method, path, None if body is None else json.dumps(body), headers)
        answer = connection.getresponse()
        content = answer.read()
        if answer.status != 200:
            raise RuntimeError(f"{method} {path}: {answer.status} {content[:200]!r}")
        return json.loads(content)

    try:
        yield ask
    finally:
        connection.close()


# On ROS 1


def ask_ros1(budget: Budget) -> Result:
    """Let clients ask a map server on ROS 1, where that is installed."""
    with tempfile.TemporaryDirectory() as folder, ExitStack() as running:
        try:
            rospy = running.enter_context(_ros1(Path(folder)))
        except HypermapError as error:
            return Result("ros1", 0, [], {"ros1": f"left out: {error}"})
        return _ask_ros1(rospy, Path(folder) / "map.hmap", budget)


def _ask_ros1(rospy: Any, path: Path, budget: Budget) -> Result:
    from hypermap.ros.ros1.messages import message_class, service_class

    def service(name: str, type_name: str) -> Any:
        rospy.wait_for_service(f"/asked/{name}", _PATIENCE)
        kind = service_class(f"hypermap_msgs/{type_name}")
        return rospy.ServiceProxy(f"/asked/{name}", kind, persistent=True)

    def reader() -> Reader:
        by_name = service("get_semantic_by_string", "GetSemanticByString")
        by_area = service("get_semantic_by_area", "GetSemanticByArea")
        area = message_class("geometry_msgs/PolygonStamped")()
        area.header.frame_id, area.polygon = "map", _polygon(EVERYWHERE, message_class)

        def is_seen() -> Iterator[int]:
            yield len(by_name("cup").objects)
            yield sum(item.name == "cup" for item in by_area(area).objects)

        return is_seen

    hypermap = a_map_of_one_cup()
    hypermap["things"].settings["enable_update"] = True
    save_map(hypermap, path)
    command = [sys.executable, "-m", "hypermap", "serve", str(path), "--ros1", "__name:=asked"]
    with _running(command):
        readers = [reader() for _ in range(READERS)]
        asked = service("get_semantic_by_string", "GetSemanticByString")
        update = message_class("hypermap_msgs/SemanticMapUpdate")
        topic = rospy.Publisher("/asked/things_semmap_updates", update, queue_size=1)
        (cup,) = asked("cup").objects
        _wait_for(topic.get_num_connections, "the map server to listen")

        def move(where: Any) -> None:
            cup.shape = _polygon(where, message_class)
            topic.publish(update(to_modify=[cup.id], updates=[cup]))
            x = where.bounds[0]
            _wait_for(
                lambda: min(p.x for p in asked("cup").objects[0].shape.points) == x,
                "the cup to move",
            )

        return watch("ros1", readers, move, budget)


def _polygon(shape: Any, message_class: Callable[[str], Any]) -> Any:
    point = message_class("geometry_msgs/Point32")
    corners = [point(x=x, y=y) for x, y in shape.exterior.coords[:-1]]
    return message_class("geometry_msgs/Polygon")(points=corners)


@contextmanager
def _ros1(folder: Path) -> Iterator[Any]:
    """Yield rospy, with this process as a node of a roscore of its own.

    Raises:
        HypermapError: If ROS 1 is not here.
    """
    if shutil.which("roscore") is None:
        raise HypermapError("there is no roscore")
    with socket.create_server(("127.0.0.1", 0)) as probe:
        port = probe.getsockname()[1]
    os.environ.update(
        ROS_MASTER_URI=f"http://127.0.0.1:{port}", ROS_HOSTNAME="127.0.0.1", ROS_HOME=str(folder)
    )
    from hypermap.ros.ros1.libraries import rospy

    with _running(["roscore", "-p", str(port)]):
        _wait_for(lambda: _answers(port), "the roscore")
        rospy.init_node("readers", disable_signals=True)
        try:
            yield rospy
        finally:
            rospy.signal_shutdown("the readers have ended")


@contextmanager
def _running(command: list[str]) -> Iterator[None]:
    """Let a program run; it is told to end as by Ctrl-C."""
    quiet = subprocess.DEVNULL
    with subprocess.Popen(command, stdin=quiet, stdout=quiet, stderr=quiet) as program:
        try:
            yield
        finally:
            program.send_signal(signal.SIGINT)
            try:
                program.wait(_PATIENCE)
            except subprocess.TimeoutExpired:
                program.kill()


def _answers(port: int) -> bool:
    try:
        socket.create_connection(("127.0.0.1", port), timeout=1).close()
    except OSError:
        return False
    return True


def _wait_for(condition: Callable[[], Any], what: str) -> None:
    end = time.monotonic() + _PATIENCE
    while not condition():
        if time.monotonic() > end:
            raise TimeoutError(f"timed out waiting for {what}")
        time.sleep(0.002)
