"""A robot for the live mapper: its messages, its tf and its clock, in this process.

Messages pass as bytes, as Foxglove's port has them; there is no network between.
"""

# ruff: noqa: D102  (`Port` says what they do)

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from hypermap.core.arrays import FloatArray
from hypermap.core.errors import FrameError
from hypermap.perception.frame import RgbdFrame
from hypermap.ros import typestore
from hypermap.ros.parameters import checked
from hypermap.ros.typestore import decode, encode, message_class, request_class, response_class

FRAME = "camera_optical_frame"
DEPTH, INFO, DETECTIONS = "/camera/depth/image_rect", "/camera/depth/camera_info", "/detections"
_KEPT = 100  # poses that tf remembers


class _Closable:
    """A publisher to whom nobody listens, a subscription, a service or a timer."""

    listeners = 1

    def __init__(self, close: Callable[[], object] = lambda: None) -> None:
        self.close = close

    def publish(self, message: Any) -> None:
        encode(message)


class Robot:
    """A port whose node sees what `show` is given.

    Attributes:
        parameters_given: values of the node's parameters that are not the defaults.
        services: of the node; each takes a request, and returns the response, as CDR.
        levels: how many lines were logged at each level.
    """

    node_name = "/semantic_mapper"
    is_shut_down = False

    def __init__(self, **parameters: Any) -> None:
        self.parameters_given = {
            "depth_topic": DEPTH,
            "detections_topic": DETECTIONS,
            "detections_type": "vision_msgs/Detection2DArray",
            "tf_timeout": 0.0,
            **parameters,
        }
        self.services: dict[str, Callable[[bytes], bytes]] = {}
        self.levels: Counter[str] = Counter()
        self.clock = 0  # ns
        self._topics: dict[str, Callable[[bytes], None]] = {}
        self._timers: list[Callable[[], None]] = []
        self._poses: dict[int, FloatArray] = {}

    # What the robot does

    def show(self, frame: RgbdFrame, stamp: int, *topics: str) -> None:
        """Send what belongs to a frame as of a time [ns], on all topics or on these."""
        self.clock = stamp
        self._poses[stamp] = frame.map_T_camera
        while len(self._poses) > _KEPT:
            self._poses.pop(next(iter(self._poses)))
        make = {INFO: self._camera_info, DEPTH: self._depth, DETECTIONS: self._detections}
        for topic in topics or make:
            if topic in self._topics:
                self._topics[topic](encode(make[topic](frame, stamp)))

    def tick(self) -> None:
        """Let the node's timers run once."""
        for callback in self._timers:
            callback()

    def _new(self, type_name: str, stamp: int, **values: Any) -> Any:
        header = message_class("std_msgs/Header")(stamp=typestore.stamp(stamp), frame_id=FRAME)
        return message_class(type_name)(header=header, **values)

    def _camera_info(self, frame: RgbdFrame, stamp: int) -> Any:
        height, width = frame.depth.shape
        message = self._new("sensor_msgs/CameraInfo", stamp, height=height, width=width)
        message.k = frame.camera.K.ravel()
        return message

    def _depth(self, frame: RgbdFrame, stamp: int) -> Any:
        height, width = frame.depth.shape
        return self._new(
            "sensor_msgs/Image",
            stamp,
            height=height,
            width=width,
            encoding="32FC1",
            step=4 * width,
            data=np.ascontiguousarray(frame.depth, dtype="<f4").view(np.uint8).ravel(),
        )

    def _detections(self, frame: RgbdFrame, stamp: int) -> Any:
        found = frame.detections
        rows = [] if found is None else zip(found.xyxy, found.names, found.scores, strict=True)
        return self._new(
            "vision_msgs/Detection2DArray",
            stamp,
            detections=[self._detection(*row) for row in rows],
        )

    def _detection(self, box: Any, name: str, score: float) -> Any:
        xmin, ymin, xmax, ymax = map(float, box)
        detection = message_class("vision_msgs/Detection2D")()
        detection.bbox.center.position.x, detection.bbox.size_x = (xmin + xmax) / 2, xmax - xmin
        detection.bbox.center.position.y, detection.bbox.size_y = (ymin + ymax) / 2, ymax - ymin
        hypothesis = message_class("vision_msgs/ObjectHypothesisWithPose")()
        hypothesis.hypothesis.class_id, hypothesis.hypothesis.score = str(name), float(score)
        detection.results = [hypothesis]
        return detection

    # What the node asks

    def message(self, type_name: str) -> type[Any]:
        return message_class(type_name)

    def response(self, type_name: str) -> type[Any]:
        return response_class(type_name)

    def publisher(self, *_: Any, **__: Any) -> _Closable:
        return _Closable()

    def subscribe(self, topic: str, type_name: str, callback: Any, **_: Any) -> _Closable:
        self._topics[topic] = lambda data: callback(decode(data, message_class(type_name)))
        return _Closable(lambda: self._topics.pop(topic, None))

    def service(self, name: str, type_name: str, handler: Any, *_: Any) -> _Closable:
        self.services[name] = lambda data: encode(handler(decode(data, request_class(type_name))))
        return _Closable(lambda: self.services.pop(name, None))

    def timer(self, _: float, callback: Callable[[], None]) -> _Closable:
        self._timers.append(callback)

        def stop() -> None:
            if callback in self._timers:
                self._timers.remove(callback)

        return _Closable(stop)

    def now(self) -> int:
        return self.clock

    def stamp(self, nanoseconds: int) -> Any:
        return typestore.stamp(nanoseconds)

    def static_transforms(self, transforms: Any) -> None:
        pass

    def lookup(self, target: str, source: str, stamp: int | None = None, *_: Any) -> FloatArray:
        if target == source:
            return np.eye(4)
        if (target, source) != ("map", FRAME) or stamp not in self._poses:
            raise FrameError(f"tf knows no {source!r} in {target!r} at {stamp}")
        return self._poses[stamp]

    def forget_transforms(self) -> None:
        pass

    def parameters(self, parameters: Sequence[Any], *_: Any) -> dict[str, Any]:
        given: Mapping[str, Any] = self.parameters_given
        return {p.name: checked(p, given.get(p.name, p.default)) for p in parameters}

    def origins(self) -> dict[str, str]:
        return {}

    def log(self, level: str, text: str) -> None:
        text.encode()  # as a terminal does
        self.levels[level] += 1
