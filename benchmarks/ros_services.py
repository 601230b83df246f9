"""How long the map server's services take on ROS 1, and how much of that is rospy.

Starts a roscore and the map server with a map of 4000 x 4000 cells, a layer of 28 objects and one
of 100,000. The client speaks TCPROS on persistent connections and does not decode what it gets.
Beside each service stands an echo in a rospy node of its own: the same types, and a reply of the
same bytes that is ready before it is asked for. Both are asked in turn; printed are medians.

    python benchmarks/ros_services.py [--cells 4000] [--objects 100000] [--repeat 1000]
"""

from __future__ import annotations

import argparse
import io
import os
import shutil
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import time
import xmlrpc.client
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from hypermap.core.grid import GridGeometry
from hypermap.core.hypermap import Hypermap
from hypermap.core.objects import SemanticObject
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticLayer
from hypermap.formats import save_map
from hypermap.ros.ros1.libraries import rospy
from hypermap.ros.ros1.messages import message_class, service_class

RESOLUTION = 0.05  # m
FEW, CLASSES = 28, 20
AREA = (10.0, 10.0, 17.0, 17.0)  # 49 m2, 140 x 140 cells

SERVER = """
import sys
from hypermap.ros.nodes import run_map_server
run_map_server([sys.argv[1]], middleware="ros1")
"""


@dataclass(frozen=True)
class Case:
    """A question to a service.

    Attributes:
        title: what is asked.
        service: name of the service at the map server.
        type_name: its type.
        layer: which layer is asked; empty for a request without fields.
        shape: a point, or an area's bounds; empty for a request without fields.
        first: what the first program took, as it was measured.
        share: how many of the repetitions are enough.
    """

    title: str
    service: str
    type_name: str
    layer: str
    shape: tuple[float, ...]
    first: str
    share: float = 1.0

    @property
    def echo(self) -> str:
        """The name of its echo."""
        return "".join(sign if sign.isalnum() else "_" for sign in self.title.lower())


def cases(objects: int, side: float) -> list[Case]:
    """Return what is asked of a map with that many objects on a square of that side [m]."""
    everywhere = (-1.0, -1.0, side + 1, side + 1)
    point, area = "hypermap_msgs/GetStringAtPoint", "hypermap_msgs/GetStringsByArea"
    strings = "get_strings_by_area"
    return [
        Case(f"point, {FEW} objects", "get_string_at_point", point, "few", (5, 5), "0.06 to 0.11"),
        Case(
            f"point, {objects} objects",
            "get_string_at_point",
            point,
            "many",
            (5, 5),
            "0.23 to 0.32",
        ),
        Case("49 m2 of cells", strings, area, "occupancy", AREA, "32 to 52", 0.1),
        Case("49 m2 of many objects", strings, area, "many", AREA, "4 to 8", 0.5),
        Case("all objects", strings, area, "many", everywhere, "700 to 900", 0.02),
        Case(
            "whole map", "occupancy_static_map", "nav_msgs/GetMap", "", (), "21000 to 28000", 0.01
        ),
    ]


def make_map(cells: int, objects: int, rng: np.random.Generator) -> Hypermap:
    """Return a map of a square hall."""
    grid = GridGeometry(cells, cells, RESOLUTION)
    values = rng.choice(np.array([-1, 0, 0, 100], dtype=np.int8), grid.shape)
    layers: list[Any] = [OccupancyLayer("occupancy", "map", grid, values)]
    for name, count in (("few", FEW), ("many", objects)):
        centers = rng.uniform(0, cells * RESOLUTION, (count, 2))
        boxes = shapely.box(*(centers - 0.25).T, *(centers + 0.25).T)
        layers.append(
            SemanticLayer(
                name,
                "map",
                [SemanticObject(f"class {i % CLASSES}", box) for i, box in enumerate(boxes)],
            )
        )
    return Hypermap(layers)


def request_of(case: Case) -> bytes:
    """Return a request as ROS 1 sends it."""
    request = service_class(case.type_name)._request_class()
    if len(case.shape) == 2:
        request.layer, request.location.header.frame_id = case.layer, "map"
        request.location.point.x, request.location.point.y = case.shape
    elif case.shape:
        point = message_class("geometry_msgs/Point32")
        corners = shapely.get_coordinates(shapely.box(*case.shape))[:-1].tolist()
        request.layer, request.area.header.frame_id = case.layer, "map"
        request.area.polygon.points = [point(x, y, 0) for x, y in corners]
    buffer = io.BytesIO()
    request.serialize(buffer)
    return struct.pack("<I", buffer.tell()) + buffer.getvalue()


class Client:
    """A persistent connection to a service, without rospy."""

    def __init__(self, service: str, type_name: str) -> None:
        host, _, port = self._address(service).removeprefix("rosrpc://").partition(":")
        self._socket = socket.create_connection((host, int(port)), timeout=600)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        fields = {
            "callerid": "/benchmark",
            "service": service,
            "md5sum": service_class(type_name)._md5sum,
            "persistent": "1",
        }
        texts = [f"{key}={value}".encode() for key, value in fields.items()]
        header = b"".join(struct.pack("<I", len(text)) + text for text in texts)
        self._socket.sendall(struct.pack("<I", len(header)) + header)
        answer = self._receive(struct.unpack("<I", self._receive(4))[0])
        if b"error=" in answer:
            raise RuntimeError(answer.decode(errors="replace"))

    def ask(self, request: bytes) -> bytearray:
        """Return the reply's bytes."""
        self._socket.sendall(request)
        is_good, size = struct.unpack("<BI", self._receive(5))
        reply = self._receive(size)
        if not is_good:
            raise RuntimeError(reply.decode(errors="replace"))
        return reply

    def _receive(self, size: int) -> bytearray:
        buffer = bytearray(size)
        view = memoryview(buffer)
        while view:
            count = self._socket.recv_into(view)
            if not count:
                raise RuntimeError("the service has closed the connection")
            view = view[count:]
        return buffer

    @staticmethod
    def _address(service: str) -> str:
        master: Any = xmlrpc.client.ServerProxy(os.environ["ROS_MASTER_URI"])
        end = time.monotonic() + 300
        while time.monotonic() < end:
            code, _, uri = master.lookupService("/benchmark", service)
            if code == 1:
                return str(uri)
            time.sleep(0.1)
        raise RuntimeError(f"no service {service}")


def serve_echoes(folder: Path) -> None:
    """Answer with the bytes of files: rospy doing nothing."""
    rospy.init_node("echo")
    for file in folder.glob("*.reply"):
        type_name, _, content = file.read_bytes().partition(b"\n")
        service = service_class(type_name.decode())

        def serialize(_: Any, buffer: Any, content: bytes = content) -> None:
            buffer.write(content)

        kind = type("Ready", (service._response_class,), {"serialize": serialize})
        reply = kind()
        rospy.Service(f"~{file.stem}", service, lambda _, reply=reply: reply)
    rospy.spin()


@contextmanager
def running(log: Path, *command: str | Path) -> Iterator[None]:
    """Run a program in the background."""
    with log.open("wb") as output:
        process = subprocess.Popen(
            [str(word) for word in command],
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
    try:
        yield
    finally:
        os.killpg(process.pid, signal.SIGINT)
        try:
            process.wait(20)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)


def free_port() -> int:
    """Return a port that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def measure(case: Case, repeat: int) -> tuple[float, float, int]:
    """Return the medians of the map server and of the echo [ms], and the reply's size."""
    request = request_of(case)
    clients = [
        Client(f"/hypermap_server/{case.service}", case.type_name),
        Client(f"/echo/{case.echo}", case.type_name),
    ]
    sizes = [len(client.ask(request)) for client in clients]
    if sizes[0] != sizes[1]:
        raise RuntimeError(f"{case.title}: the replies differ in size: {sizes}")
    taken: list[list[float]] = [[], []]
    count = max(5, round(repeat * case.share))
    for _ in range(count // 2):  # to warm up
        for client in clients:
            client.ask(request)
    for _ in range(count):
        for client, times in zip(clients, taken, strict=True):
            start = time.perf_counter()
            client.ask(request)
            times.append(time.perf_counter() - start)
    ours, echo = (float(np.median(times)) * 1000 for times in taken)
    return ours, echo, sizes[0]


def run(folder: Path, cells: int, objects: int, repeat: int) -> None:
    """Measure, and print a table."""
    questions = cases(objects, cells * RESOLUTION)
    save_map(make_map(cells, objects, np.random.default_rng(1)), folder / "hall.hmap")
    port = str(free_port())
    os.environ.update(
        ROS_MASTER_URI=f"http://127.0.0.1:{port}",
        ROS_HOSTNAME="127.0.0.1",
        ROS_HOME=str(folder / "ros"),
    )
    with ExitStack() as programs:
        programs.enter_context(running(folder / "roscore.log", "roscore", "-p", port))
        wait_for_port(int(port))
        python = sys.executable
        programs.enter_context(
            running(folder / "server.log", python, "-c", SERVER, folder / "hall.hmap")
        )
        for case in questions:
            reply = Client(f"/hypermap_server/{case.service}", case.type_name).ask(request_of(case))
            (folder / f"{case.echo}.reply").write_bytes(
                case.type_name.encode() + b"\n" + bytes(reply)
            )
        programs.enter_context(
            running(folder / "echo.log", python, Path(__file__), "--echo", folder)
        )
        print("| question | reply [bytes] | first program [ms] | ours [ms] | of that rospy [ms] |")
        print("| --- | ---: | ---: | ---: | ---: |")
        for case in questions:
            ours, echo, size = measure(case, repeat)
            print(f"| {case.title} | {size} | {case.first} | {ours:.3g} | {echo:.3g} |", flush=True)


def wait_for_port(port: int) -> None:
    """Return when somebody listens on a port."""
    end = time.monotonic() + 60
    with socket.socket() as probe:
        while probe.connect_ex(("127.0.0.1", port)):
            if time.monotonic() > end:
                raise RuntimeError(f"nobody listens on port {port}")
            time.sleep(0.1)


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cells", type=int, default=4000)
    parser.add_argument("--objects", type=int, default=100_000)
    parser.add_argument("--repeat", type=int, default=1000)
    parser.add_argument("--echo", type=Path, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.echo:
        serve_echoes(args.echo)
        return
    folder = Path(tempfile.mkdtemp())
    try:
        run(folder, args.cells, args.objects, args.repeat)
    except RuntimeError as error:
        logs = "".join(file.read_text(errors="replace") for file in folder.glob("*.log"))
        raise SystemExit(f"{error}\n{logs[-4000:]}") from None
    finally:
        shutil.rmtree(folder, ignore_errors=True)


if __name__ == "__main__":
    main()
