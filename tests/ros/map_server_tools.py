"""A small building to serve, and a client that asks as any ROS 1 program does."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import shapely

from hypermap.core.frames import FrameTree, Pose2D, Transform
from hypermap.core.hypermap import Hypermap
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.formats import save_map
from hypermap.testing import occupancy_from_text, square

from .conftest import wait_for, wait_for_listener

# The lab's frame stands at (10, 0) in the map, turned left by 90 degrees:
# (x, y) in the lab is (10 - y, x) in the map.
LAB = Transform("map", "lab", Pose2D(10.0, 0.0, math.pi / 2))


def building(**settings: Any) -> Hypermap:
    """A grid in the frame `map`, and objects in the frame `lab`."""
    sofa = shapely.box(10, 0, 14, 4).difference(shapely.box(11, 1, 13, 3))
    objects = [
        SemanticObject("table", shapely.box(0, 0, 2, 1), id=7),
        square("cup", 0.5, 0.5, 0.1),
        square("chair", 5, 5, tags=("chair", "stool"), confidence=(0.75, 0.25), existence=3.5),
        SemanticObject("sofa", sofa),
    ]
    grid = occupancy_from_text("##?\n..#", name="occupancy")
    semantic = SemanticLayer("semantic", "lab", objects)
    for layer in (grid, semantic):
        layer.settings.update(settings)
    return Hypermap([grid, semantic], FrameTree([LAB]))


def saved(hypermap: Hypermap, path: Path) -> Path:
    save_map(hypermap, path)
    return path


class Client:
    """Calls the services of a node and listens to its topics."""

    def __init__(self, rospy: Any, node: str) -> None:
        from hypermap.ros.ros1 import messages as ros1_messages

        self.rospy = rospy
        self.node = node
        self.messages = ros1_messages

    def message(self, type_name: str, **fields: Any) -> Any:
        return self.messages.message_class(type_name)(**fields)

    def proxy(self, service: str, type_name: str, **options: Any) -> Any:
        name = service if service.startswith("/") else f"/{self.node}/{service}"
        self.rospy.wait_for_service(name, 120)
        return self.rospy.ServiceProxy(name, self.messages.service_class(type_name), **options)

    def call(self, service: str, type_name: str, **fields: Any) -> Any:
        if "/" not in type_name:
            type_name = f"hypermap_msgs/{type_name}"
        return self.proxy(service, type_name)(**fields)

    def refused(self, service: str, type_name: str, **fields: Any) -> str:
        """Return the text of the error that a call ends with."""
        try:
            answer = self.call(service, type_name, **fields)
        except self.rospy.ServiceException as error:
            return str(error).replace("\\'", "'")  # rospy shows the text as Python's bytes
        raise AssertionError(f"answered {answer}")

    def heard(
        self,
        topic: str,
        type_name: str,
        until: Callable[[Any], Any] = lambda _: True,
        timeout: float = 120.0,
    ) -> Any:
        """Return the first message of a topic, latched or new, that is as it should be."""
        name = topic if topic.startswith("/") else f"/{self.node}/{topic}"
        found: list[Any] = []

        def take(message: Any) -> None:
            if until(message):
                found.append(message)

        subscriber = self.rospy.Subscriber(name, self.messages.message_class(type_name), take)
        try:
            return wait_for(lambda: found, f"a message on {name}", timeout)[0]
        finally:
            subscriber.unregister()

    def published(self) -> set[str]:
        """Return what the node publishes; private names as such."""
        import rosgraph

        state = rosgraph.Master("/tests").getSystemState()[0]
        own = {topic for topic, nodes in state if f"/{self.node}" in nodes}
        return {topic.removeprefix(f"/{self.node}/") for topic in own}

    def publisher(self, topic: str, type_name: str, *, latch: bool = True) -> Any:
        """Return a publisher that somebody listens to."""
        name = topic if topic.startswith("/") else f"/{self.node}/{topic}"
        made = self.rospy.Publisher(
            name, self.messages.message_class(type_name), latch=latch, queue_size=10
        )
        wait_for_listener(made, f"a listener of {name}")
        return made

    def point(self, x: float, y: float, frame: str = "", stamp: Any = None) -> Any:
        message = self.message("geometry_msgs/PointStamped")
        message.header.frame_id = frame
        message.point.x, message.point.y = x, y
        if stamp is not None:
            message.header.stamp = stamp
        return message

    def area(self, corners: Iterable[tuple[float, float]], frame: str = "") -> Any:
        message = self.message("geometry_msgs/PolygonStamped")
        message.header.frame_id = frame
        message.polygon.points = [
            self.message("geometry_msgs/Point32", x=x, y=y) for x, y in corners
        ]
        return message

    def box(self, x0: float, y0: float, x1: float, y1: float, frame: str = "") -> Any:
        return self.area([(x0, y0), (x1, y0), (x1, y1), (x0, y1)], frame)

    def string(self, layer: str, x: float, y: float, frame: str = "", stamp: Any = None) -> str:
        location = self.point(x, y, frame, stamp)
        answer = self.call(
            "get_string_at_point", "GetStringAtPoint", layer=layer, location=location
        )
        return str(answer.name)


def places(points: Iterable[Any]) -> list[tuple[float, float]]:
    return [(round(point.x, 4), round(point.y, 4)) for point in points]


class Robot:
    """Says on tf, ten times a second, where frames lie in the map; they need not stand still.

    `robot` stands at (2, 0), `camera` looks forward from there, and `cart` was at (0.5, 0.5) at the
    time `began` and at (50.5, 0.5) a second later.
    """

    def __init__(self, client: Client) -> None:
        self._client = client
        self.began = client.rospy.Time.now() - client.rospy.Duration(2)
        kind = client.messages.message_class("tf2_msgs/TFMessage")
        self._publisher = client.rospy.Publisher("/tf", kind, queue_size=10)
        self._kind = kind
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def wait_until_known_to(self, client: Client) -> None:
        """Wait until a server that has a grid listens to tf and has heard of the frames."""

        def is_known() -> bool:
            try:
                return bool(client.string("occupancy", 0.0, 0.0, "robot"))
            except client.rospy.ServiceException:
                return False

        wait_for(is_known, "the robot's frame at the server")

    def close(self) -> None:
        self._end.set()
        self._thread.join()
        self._publisher.unregister()

    def _run(self) -> None:
        now = self._client.rospy.Time.now
        second = self._client.rospy.Duration(1)
        while not self._end.is_set():
            transforms = [
                self._transform("robot", 2.0, 0.0, now()),
                self._transform("camera", 2.0, 0.0, now(), (-0.5, 0.5, -0.5, 0.5)),
                self._transform("cart", 0.5, 0.5, self.began),
                self._transform("cart", 50.5, 0.5, self.began + second),
            ]
            self._publisher.publish(self._kind(transforms=transforms))
            time.sleep(0.1)

    def _transform(
        self,
        child: str,
        x: float,
        y: float,
        stamp: Any,
        quat_xyzw: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0),
    ) -> Any:
        made = self._client.message("geometry_msgs/TransformStamped", child_frame_id=child)
        made.header.frame_id, made.header.stamp = "map", stamp
        made.transform.translation.x, made.transform.translation.y = x, y
        rotation = made.transform.rotation
        rotation.x, rotation.y, rotation.z, rotation.w = quat_xyzw
        return made
