"""A robot for the live mapper: its messages, its tf and its clock, in this process."""

from __future__ import annotations

from typing import Any

import numpy as np

from campaign.in_process_port import InProcessPort
from hypermap.core.arrays import FloatArray
from hypermap.perception.frame import RgbdFrame
from hypermap.ros import typestore
from hypermap.ros.typestore import encode, message_class

FRAME = "camera_optical_frame"
DEPTH, INFO, DETECTIONS = "/camera/depth/image_rect", "/camera/depth/camera_info", "/detections"
_KEPT = 100  # poses that tf remembers


class Robot(InProcessPort):
    """A port whose node sees what `show` is given."""

    def __init__(self, **parameters: Any) -> None:
        super().__init__(
            depth_topic=DEPTH,
            detections_topic=DETECTIONS,
            detections_type="vision_msgs/Detection2DArray",
            tf_timeout=0.0,
            **parameters,
        )
        self._poses: dict[int, FloatArray] = {}

    def show(self, frame: RgbdFrame, stamp: int, *topics: str, is_posed: bool = True) -> None:
        """Send what belongs to a frame as of a time [ns], on all topics or on these.

        Without a pose, tf does not know where the camera was.
        """
        self.clock = stamp
        if is_posed:
            self._poses[stamp] = frame.map_T_camera
        while len(self._poses) > _KEPT:
            self._poses.pop(next(iter(self._poses)))
        make = {INFO: _camera_info, DEPTH: _depth, DETECTIONS: _detections}
        for topic in topics or make:
            if topic in self.topics:
                self.topics[topic](encode(make[topic](frame, stamp)))

    def lookup(self, target: str, source: str, stamp: int | None = None, *_: Any) -> FloatArray:
        """Return the camera's pose at one of the last frames."""
        if (target, source) == ("map", FRAME) and stamp in self._poses:
            return self._poses[stamp]
        return super().lookup(target, source, stamp)


def _new(type_name: str, stamp: int, **values: Any) -> Any:
    header = message_class("std_msgs/Header")(stamp=typestore.stamp(stamp), frame_id=FRAME)
    return message_class(type_name)(header=header, **values)


def _camera_info(frame: RgbdFrame, stamp: int) -> Any:
    height, width = frame.depth.shape
    message = _new("sensor_msgs/CameraInfo", stamp, height=height, width=width)
    message.k = frame.camera.K.ravel()
    return message


def _depth(frame: RgbdFrame, stamp: int) -> Any:
    height, width = frame.depth.shape
    return _new(
        "sensor_msgs/Image",
        stamp,
        height=height,
        width=width,
        encoding="32FC1",
        step=4 * width,
        data=np.ascontiguousarray(frame.depth, dtype="<f4").view(np.uint8).ravel(),
    )


def _detections(frame: RgbdFrame, stamp: int) -> Any:
    found = frame.detections
    rows = [] if found is None else zip(found.xyxy, found.names, found.scores, strict=True)
    detections = [_detection(*row) for row in rows]
    return _new("vision_msgs/Detection2DArray", stamp, detections=detections)


def _detection(box: Any, name: str, score: float) -> Any:
    xmin, ymin, xmax, ymax = map(float, box)
    detection = message_class("vision_msgs/Detection2D")()
    detection.bbox.center.position.x, detection.bbox.size_x = (xmin + xmax) / 2, xmax - xmin
    detection.bbox.center.position.y, detection.bbox.size_y = (ymin + ymax) / 2, ymax - ymin
    hypothesis = message_class("vision_msgs/ObjectHypothesisWithPose")()
    hypothesis.hypothesis.class_id, hypothesis.hypothesis.score = str(name), float(score)
    detection.results = [hypothesis]
    return detection
