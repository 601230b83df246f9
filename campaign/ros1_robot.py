"""A robot on ROS 1 for the live node: its clock, its camera, tf and detections, on a roscore."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable
from typing import Any

from campaign.fuzz_targets.target import of_tests
from hypermap.perception.frame import RgbdFrame

_FRAME = 60.0  # s until a frame counts as lost that must be mapped
_MAYBE = 2.0  # s for one that need not be
_NOT_WHOLE = 0.05  # s for a frame of which nothing can be waited for


class Ros1Robot:
    """A node of this process, which registers again with each new roscore.

    Args:
        node: the name of the live node that it shows frames to.

    Attributes:
        fates: how many frames met each fate, as the node has reported last.
    """

    def __init__(self, node: str) -> None:
        from hypermap.ros.ros1.libraries import rospy
        from hypermap.ros.ros1.messages import message_class
        from hypermap.ros.ros1.port import Ros1Port

        port = Ros1Port("robot", ["robot"])
        camera = of_tests("ros.live_camera")
        self._node, self._time = node, rospy.Time.from_sec
        self._make = {
            "tf": (camera.TF, camera.tf),
            "info": (camera.INFO, camera.camera_info),
            "depth": (camera.DEPTH, camera.depth),
            "detections": (camera.DARKNET, camera.darknet),
        }
        self._clock_message = message_class("rosgraph_msgs/Clock")
        self._clock = port.publisher("/clock", "rosgraph_msgs/Clock")
        self._topics = {
            topic: rospy.Publisher(topic, message_class(camera.TYPES[topic]), queue_size=100)
            for topic, _ in self._make.values()
        }
        self._newest_area = self._reports = 0
        self._old: list[Any] = []  # connections of nodes that have ended
        self.fates: dict[str, int] = {}
        port.subscribe(f"/{node}/observed_area", "geometry_msgs/PolygonStamped", self._hear_area)
        port.subscribe("/diagnostics", "diagnostic_msgs/DiagnosticArray", self._hear_report)

    def tell_time(self, clock: float) -> None:
        """Publish what time it is [s]."""
        self._clock.publish(self._clock_message(self._time(clock)))

    def is_heard(self) -> bool:
        """Return whether the live node listens to all topics; a killed one seems to for a while."""
        return all(
            any(link.endpoint_id == f"/{self._node}" and link not in self._old for link in links)
            for links in self._links()
        )

    def show(self, frame: RgbdFrame, *, must: bool) -> bool:
        """Show a frame whole, and return whether it was mapped, or looked at and found to be still.

        One that must be is waited for longer.

        The node shows the area of a frame that is mapped at once; it reports still ones every
        second.
        """
        stamp, still = round(frame.stamp * 1e9), self._still
        self._publish(frame, *self._make)
        return _becomes_true(
            lambda: self._newest_area == stamp or self._still > still, _FRAME if must else _MAYBE
        )

    def forget(self) -> None:
        """Forget a node that has ended or is to end: another one is to listen."""
        self.fates = {}
        self._old = [link for links in self._links() for link in links]

    def _links(self) -> list[list[Any]]:
        """Return the connections of each topic."""
        return [list(topic.impl.connections) for topic in self._topics.values()]

    def show_without(self, frame: RgbdFrame, lacking: str) -> None:
        """Show a frame but for tf, info, depth or detections."""
        self._publish(frame, *(kind for kind in self._make if kind != lacking))
        time.sleep(_NOT_WHOLE)

    def settle(self) -> None:
        """Wait until two reports of the node are alike: it has done all that it was shown."""
        heard = [(self._reports, self.fates)]

        def is_alike() -> bool:
            if self._reports > heard[-1][0]:
                heard.append((self._reports, self.fates))
            return len(heard) > 2 and heard[-1][1] == heard[-2][1]

        _becomes_true(is_alike, _FRAME)

    def _publish(self, frame: RgbdFrame, *kinds: str) -> None:
        frame = dataclasses.replace(frame, color_stamp=frame.stamp)
        for kind in kinds:
            topic, make = self._make[kind]
            self._topics[topic].publish(make(frame))

    @property
    def _still(self) -> int:
        return self.fates.get("camera hardly moved", 0)

    def _hear_area(self, area: Any) -> None:
        self._newest_area = int(area.header.stamp.to_nsec())

    def _hear_report(self, report: Any) -> None:
        for status in report.status:
            if self._node in status.name:
                pairs = [pair for pair in status.values if pair.key.startswith("frames: ")]
                self._reports += 1
                self.fates = {pair.key[len("frames: ") :]: int(pair.value) for pair in pairs}


def _becomes_true(condition: Callable[[], bool], seconds: float) -> bool:
    end = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > end:
            return False
        time.sleep(0.002)
    return True
