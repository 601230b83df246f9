"""A semantic mapper on a real roscore, and a simulated camera before it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from hypermap.core.errors import FrameError
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.evaluation.metrics import evaluate
from hypermap.mapping import map_recording, profile
from hypermap.perception.detections import Detections
from hypermap.perception.detectors.sources import detections_from_recording
from hypermap.perception.frame import RgbdFrame
from hypermap.ros.mapper.live_map import LiveMap
from hypermap.ros.mapper.semantic_mapper import SemanticMapper
from hypermap.ros.mapper.statistics import Fate
from hypermap.ros.parameters import checked
from hypermap.ros.ros1.messages import message_class
from hypermap.simulation import SimulatedRecording, demo_world

from . import live_camera as camera
from .conftest import wait_for, wait_for_listener

START = 1_600_000_000  # s; ROS takes a stamp of 0 for none
RAW = {"depth_topic": camera.DEPTH, "detections_topic": camera.DARKNET, "tf_timeout": 10.0}


class Given:
    """A port whose node has these parameters."""

    def __init__(self, port: Any, values: dict[str, Any]) -> None:
        self._port, self._values = port, values

    def __getattr__(self, name: str) -> Any:
        return getattr(self._port, name)

    def parameters(self, parameters: Any, on_change: Any = None) -> dict[str, Any]:
        assert set(self._values) <= {p.name for p in parameters}
        return {p.name: checked(p, self._values.get(p.name, p.default)) for p in parameters}


class Camera:
    """Publishes frames, one kind of message on each topic."""

    def __init__(self, rospy: Any, *topics: str) -> None:
        self.numbers: dict[str, int] = {}
        self._make = {
            camera.TF: camera.tf,
            camera.INFO: camera.camera_info,
            camera.DEPTH: camera.depth,
            camera.COMPRESSED_DEPTH: camera.compressed_depth,
            camera.CLOUD: camera.cloud,
            camera.COLOR: camera.color,
            camera.COMPRESSED_COLOR: camera.compressed_color,
            camera.DARKNET: camera.darknet,
            camera.VISION: lambda frame: camera.vision(frame, self.numbers),
        }
        self._publishers = {
            topic: rospy.Publisher(topic, message_class(camera.TYPES[topic]), queue_size=100)
            for topic in topics
        }

    def wait_for_listeners(self) -> None:
        for topic, publisher in self._publishers.items():
            wait_for_listener(publisher, f"a listener on {topic}")

    def show(self, frame: RgbdFrame, *topics: str) -> None:
        """Publish what belongs to a frame, on all topics or on these."""
        for topic in topics or self._publishers:
            self._publishers[topic].publish(self._make[topic](frame))

    def close(self) -> None:
        for publisher in self._publishers.values():
            publisher.unregister()


class Room:
    """A node in this process, a camera, and what was logged."""

    def __init__(self, rospy: Any, port: Any, topics: tuple[str, ...], values: Any) -> None:
        self.lines: list[tuple[str, str]] = []
        self._port = port
        given = Given(port, values)
        given.log = lambda level, text: self.lines.append((level, text))  # type: ignore[attr-defined]
        self.node = SemanticMapper(given)  # type: ignore[arg-type]
        self.camera = Camera(rospy, camera.TF, *topics)

    def begin(self) -> None:
        """Let the node work, and wait until it hears the camera."""
        self.node.configure()
        self.node.activate()
        self.camera.wait_for_listeners()

    def show_camera_info(self, frame: RgbdFrame) -> None:
        """Publish a frame's intrinsics, and wait for the node to have them before its images."""
        self.camera.show(frame, camera.INFO)
        frames = self.node._life._frames  # type: ignore[union-attr]
        wait_for(lambda: not frames.lacks_camera_info, "the camera info")

    def show_tf(self, frame: RgbdFrame) -> None:
        """Publish where the camera is, and wait for the node to know it before its images."""
        self.camera.show(frame, camera.TF)

        def is_known() -> bool:
            try:
                self._port.lookup("map", camera.FRAME, round(frame.stamp * 1e9))
            except FrameError:
                return False
            return True

        wait_for(is_known, "the pose of the camera")

    @property
    def live_map(self) -> LiveMap:
        live_map = self.node._map
        assert live_map is not None
        return live_map

    @property
    def totals(self) -> dict[Fate, int]:
        report = self.node.report()
        assert report is not None
        return report.totals

    def wait_for(self, **counts: int) -> None:
        wanted = {Fate[name]: count for name, count in counts.items()}
        wait_for(lambda: wanted.items() <= self.totals.items(), f"{counts}, not {self.totals}")

    def wait_until_matched(self, frame: RgbdFrame) -> None:
        """Wait until the messages of a frame have found each other.

        Frames that are shown faster, seconds apart by their stamps, arrive as if one topic lagged
        by seconds behind the other, as the threads that take them happen to run.
        """
        streams = self.node._life._inputs._synchronizer._streams  # type: ignore[union-attr]
        stamp = round(frame.stamp * 1e9)
        wait_for(lambda: streams[""].matched == stamp, f"a match at {frame.stamp:.1f}")

    def map(self, frames: list[RgbdFrame]) -> SemanticLayer:
        """Show frames one after the other, each when the last is done, and return the objects."""
        for number, frame in enumerate(frames, start=1):
            self.camera.show(frame)
            wait_for(lambda n=number: sum(self.totals.values()) >= n, f"frame {number}")  # type: ignore[misc]
        return self.semantic

    @property
    def semantic(self) -> SemanticLayer:
        layer = self.node.hypermap()["semantic"]
        assert isinstance(layer, SemanticLayer)
        return layer

    def logged(self, text: str) -> list[str]:
        return [line for _, line in self.lines if text in line]


@pytest.fixture
def room(rospy: Any, port: Any) -> Iterator[Callable[..., Room]]:
    opened: list[Room] = []

    def make(*topics: str, **values: Any) -> Room:
        port.forget_transforms()  # of the test before
        opened.append(Room(rospy, port, topics, values))  # closed even if it cannot begin
        opened[-1].begin()
        return opened[-1]

    yield make
    for each in opened:
        each.node.deactivate()
        each.node.cleanup()
        each.camera.close()


@pytest.fixture(scope="session")
def drive() -> list[RgbdFrame]:
    """A drive through the demo's room, a frame in each second."""
    return list(_drive())  # the fixture is made anew for each module that imports it


@cache
def _drive() -> list[RgbdFrame]:
    return at(START, list(SimulatedRecording(demo_world(), rate=1.0).frames()))


def at(start: float, frames: list[RgbdFrame]) -> list[RgbdFrame]:
    """The same frames, beginning at another time [s]."""
    shift = start - frames[0].stamp
    return [
        replace(frame, stamp=frame.stamp + shift, color_stamp=frame.color_stamp + shift)
        for frame in frames
        if frame.color_stamp is not None
    ]


class Frames:
    """Frames as a recording."""

    path, frame_id = Path("frames"), "map"

    def __init__(self, frames: list[RgbdFrame]) -> None:
        self._frames = frames

    def __len__(self) -> int:
        return len(self._frames)

    def frames(self, on_bad: Any = None) -> Iterator[RgbdFrame]:
        return iter(self._frames)

    def occupancy(self) -> None:
        return None


def mapped(
    frames: list[RgbdFrame], source: Any = None, occupancy: OccupancyLayer | None = None
) -> list[SemanticObject]:
    """What `map_recording` finds in frames."""
    source = source or detections_from_recording()
    layer = map_recording(Frames(frames), source, profile("default"), occupancy)["semantic"]  # type: ignore[arg-type]
    assert isinstance(layer, SemanticLayer)
    return layer.objects()


def with_numbers(frame: RgbdFrame, names: list[str]) -> RgbdFrame:
    """The frame with the places of classes in a list for their names, as vision_msgs has them."""
    found = frame.detections
    if found is None:
        return frame
    numbers = [str(names.index(name)) for name in found.names]
    return replace(frame, detections=Detections.of(found.xyxy, numbers, found.scores))


def with_whole_pixels(frame: RgbdFrame) -> RgbdFrame:
    """The frame with boxes as darknet_ros has them."""
    found = frame.detections
    assert found is not None
    boxes = [[round(side) for side in box] for box in found.xyxy.tolist()]
    return replace(frame, detections=Detections.of(boxes, list(found.names), found.scores))


def assert_same(objects: list[SemanticObject], expected: list[SemanticObject]) -> None:
    """All objects are there, at the same place and of the same shape but for rounding."""
    assert Counter(o.name for o in objects) == Counter(o.name for o in expected)
    score = evaluate(objects, expected).overall
    assert len(expected) > 5
    assert score.iou > 0.97
    assert score.detection[1].f1 == 1  # at an IoU of 0.5
